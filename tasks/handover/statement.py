"""HANDOVER.txt: what was written, for which programs, what their users must set, how far it is from ours."""

from __future__ import annotations

import textwrap

import numpy as np

from adjust.camera.additional.conversion import NOTEWORTHY
from adjust.geometry.earth import TopocentricFrame
from adjust.handover.cartesian_map import EARTH_RADIUS_M
from tasks.handover.delivery import Delivery, DeliveryFormat
from tasks.handover.lens import LensModel
from tasks.handover.receiver import WARNED_PX
from tasks.settings.deliver import World

_WORLDS: dict[World, str] = {
    "local": "The program must take the coordinates as Cartesian, without any correction for the "
    "curvature of the earth or the scale of a map.",
    "map": "The program must know the map projection and compute with the curved earth. Positions are "
    "true, angles count from grid north at each camera. A program that takes map coordinates as "
    "Cartesian is wrong by decimetres with them.",
    "map-cartesian": "For programs that take map coordinates as Cartesian, with their corrections for "
    "curvature, map scale and refraction switched OFF.",
    "map-cartesian-curved": "For programs that take map coordinates as Cartesian and correct the "
    f"curvature of the earth themselves: switch that ON (radius {EARTH_RADIUS_M / 1000:,.0f} km), "
    "corrections for map scale and refraction OFF.",
    "rpc": "Latitude, longitude and ELLIPSOIDAL height lead to row and column of the delivered image "
    "(centre of the first pixel: 0, 0). Camera, distortion, refraction and the earth are contained; no "
    "switch is needed.",
}
_AS_DELIVERED = (
    "Nothing of this block is adjusted: orientations are delivered or approximate ones, object points are "
    "intersected from them, image points are as measured (refraction is not corrected), cameras as given."
)
_LEAST_DISTORTION_UM = 0.05
# Below this a misfit is rounding.
_LEAST_MISFIT_PX = 1e-4
_WIDTH = 78


def statement(delivery: Delivery, form: DeliveryFormat, project: str, *, adjusted: bool = True) -> str:
    """The text.

    Parameters
    ----------
    adjusted : whether the block is adjusted, or as it was delivered.
    """
    parts = [
        f"{project}: {len(delivery.names)} images, {form.name} ({form.meaning})",
        *([] if adjusted else [_AS_DELIVERED]),
        *_about_world(delivery, form),
        *_about_lens(delivery, form),
        *_about_mean_residuals(delivery, form),
        *_about_grids(delivery, form),
        *(_about_fit(delivery) if form.oriented else ()),
    ]
    if not form.seen:
        parts.append(
            "This format was not yet validated on data of the software that reads it: compare a few points."
        )
    return "\n\n".join(textwrap.fill(part, _WIDTH) for part in parts) + "\n"


def _about_world(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    if not form.oriented:
        return []
    refraction = _about_refraction(delivery, straight=form.straight)
    return [_WORLDS[delivery.handed.world], _coordinates(delivery), *refraction]


def _coordinates(delivery: Delivery) -> str:
    images, world = delivery.results.images, delivery.handed.world
    if world == "rpc":
        return f"Coordinates: latitude and longitude of the datum of {images.map_frame.description}."
    if world == "local" and isinstance(images.frame, TopocentricFrame):
        latitude, longitude = np.rad2deg([images.frame.latitude, images.frame.longitude])
        return (
            f"Coordinates: metres east, north, up of latitude {latitude:.9f}°, longitude "
            f"{longitude:.9f}°, ellipsoidal height {images.frame.height_of_origin_m:g} m, datum of "
            f"{images.map_frame.description}."
        )
    return f"Coordinates: {images.map_frame.description}, metres."


def _about_refraction(delivery: Delivery, *, straight: bool) -> list[str]:
    if not delivery.results.images.refracted or delivery.handed.world == "rpc":
        return []
    if delivery.handed.refitted:
        return ["Refraction of the standard atmosphere is contained in the orientations."]
    if delivery.lenses.models:
        return [
            "Refraction of the standard atmosphere, which the adjustment corrected, is contained in the "
            "cameras: switch such a correction OFF."
        ]
    if straight:
        return [
            "Refraction of the standard atmosphere, which the adjustment corrected, is taken from the image "
            "points: switch such a correction OFF."
        ]
    return ["The adjustment corrected refraction (standard atmosphere): switch such a correction ON."]


def _about_lens(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    corrected = form.corrected
    if delivery.handed.world == "rpc":
        return []
    if delivery.lenses.models:
        return [_about_model(model) for model in delivery.lenses.models] + _about_lens_fit(delivery)
    found = []
    for camera in delivery.results.cameras:
        frame = camera.frame
        x0, y0 = (value * 1e3 for value in frame.principal_point)
        text = (
            f"Camera {frame.name}: focal length {frame.focal_length * 1e3:.4f} mm, principal point "
            f"{x0:.4f}, {y0:.4f} mm from the centre (x right, y up)"
        )
        distortion = camera.largest_distortion * 1e6
        if distortion > _LEAST_DISTORTION_UM:
            text += (
                f"; its additional parameters move image points by up to {distortion:.1f} µm and "
                + _contained(form)
                + ("" if corrected or form.grid else ": use corrected images or image coordinates")
            )
        found.append(f"{text}.")
    if form.straight:
        found.append(
            "Image points count from the centre of the format, x right, y up, and additional parameters are "
            "corrected in them: the program must take a camera without distortion, with this principal point."
        )
    elif corrected:
        found.append(
            "Image points count from the principal point, and additional parameters are corrected in them: "
            "the program must take a camera without distortion whose principal point is 0, 0."
        )
    return found


def _contained(form: DeliveryFormat) -> str:
    if form.grid:
        return "are contained in the distortion grids"
    if form.lens:
        return "are fitted into the coefficients of the lens; what these cannot take is in its misfit"
    return "are contained in the image points" if form.corrected else "are NOT contained"


def _about_grids(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    """How well bilinear interpolation between the nodes reproduces the correction."""
    found = []
    for one in delivery.grids:
        if form.oriented and not one.moves:
            continue
        forth, back = one.ideal_from_measured, one.measured_from_ideal
        largest = max(forth.misfit, back.misfit)
        found.append(
            f"Camera {one.camera}: distortion grids of {len(forth.x)} × {len(forth.y)} nodes; bilinear "
            f"between them the correction is reproduced to {largest * 1e6:.3f} µm (root mean square "
            f"{max(forth.rms, back.rms) * 1e6:.3f} µm)."
            + (
                " That is more than 0.1 µm: the correction jumps or bends between nodes."
                if largest > NOTEWORTHY
                else ""
            )
        )
    if found and form.oriented:
        found.append(
            "The grids are written in both directions, ideal_from_measured.dat and measured_from_ideal.dat: "
            "which one the program takes must be seen from a few points. It must not take a distortion of "
            "the camera besides."
        )
    return found


def _about_mean_residuals(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    """Of cameras whose image points were corrected by mean residuals."""
    return [
        f"Camera {camera.frame.name}: mean residuals, which the adjustment added to image points, move "
        f"them by up to {camera.largest_mean_residual * 1e6:.1f} µm and {_contained(form)}."
        for camera in delivery.results.cameras
        if camera.largest_mean_residual * 1e6 > _LEAST_DISTORTION_UM
    ]


def _about_model(model: LensModel) -> str:
    """The camera as it stands in the files."""
    (fx, fy), (column, row) = model.focal, model.principal_point
    lens = ", ".join(f"{name} {value:.6g}" for name, value in model.distortion.items() if value)
    return (
        f"Camera {model.name}: focal length {fx:.4f}, {fy:.4f} pixels, principal point "
        f"{column:.4f}, {row:.4f} pixels from the corner of the first one; distortion from the ideal to the "
        f"measured point: {lens or 'none'}, fitted over the format to {model.misfit_um:.3f} µm."
        + (
            " That is more than 0.1 µm: compare corrected image points."
            if model.misfit_um > NOTEWORTHY * 1e6
            else ""
        )
    )


def _about_lens_fit(delivery: Delivery) -> list[str]:
    misfit = delivery.lenses.misfit_px
    worst = int(np.argmax(misfit))
    model = delivery.lenses.models[delivery.results.images.camera[worst]]
    if misfit[worst] < _LEAST_MISFIT_PX:
        return []
    text = (
        "Distortion and refraction were fitted to the program's model; misfit at most "
        f"{misfit[worst]:.4f} pixels ({misfit[worst] * model.pixel_size * 1e6:.2f} µm), in image "
        f"{delivery.names[worst]}."
    )
    if misfit[worst] >= WARNED_PX:
        text += " That is much: use corrected images, or rational polynomials (--to rpc)."
    return [text]


def _about_fit(delivery: Delivery) -> list[str]:
    handed, images = delivery.handed, delivery.results.images
    if handed.world in ("local", "map"):
        if delivery.lenses.misfit_px.max(initial=0.0) >= _LEAST_MISFIT_PX:
            return ["Nothing else is approximated."]
        return ["Nothing is approximated."]
    worst = int(np.argmax(handed.misfit_px))
    text = (
        f"Misfit of the program's model to ours: {handed.misfit_px[worst]:.3f} pixels at most "
        f"({100.0 * handed.misfit_m.max():.1f} cm on the ground), in image {delivery.names[worst]}; "
        f"median of the images {np.median(handed.misfit_px):.3f} pixels."
    )
    if handed.misfit_px[worst] >= WARNED_PX:
        text += " That is much: where the program takes another kind, use it (--world)."
    if not handed.refitted:
        return [text]
    moved = handed.pose.centre - images.map_pose.centre
    changed = (
        "Orientations were fitted to the program's model: they are NO positions of the camera any more "
        f"(heights moved by {moved[:, 2].min():+.2f} to {moved[:, 2].max():+.2f} m). Never compare them "
        "with GNSS; the true ones are in eo_rigorous.csv."
    )
    focal = {
        camera.frame.name: 1e3 * float(handed.pose.focal_length[np.argmax(images.camera == k)])
        for k, camera in enumerate(delivery.results.cameras)
    }
    if not np.allclose(handed.pose.focal_length, images.focal_length[images.camera], rtol=0, atol=1e-12):
        listed = ", ".join(f"{name} {value:.4f} mm" for name, value in focal.items())
        changed += f" The focal length to be entered is fitted, too: {listed}."
    return [text, changed]
