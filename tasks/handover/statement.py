"""HANDOVER.txt: what was written, for which programs, what their users must set, differences from ours."""

from __future__ import annotations

import textwrap

import numpy as np

from adjust.camera.additional.conversion import NOTEWORTHY
from adjust.geometry.earth import TopocentricFrame
from adjust.handover.cartesian_map import EARTH_RADIUS_M
from tasks.handover.delivery import Delivery, DeliveryFormat
from tasks.handover.formats.rigs import written_rigs
from tasks.handover.lens import LensModel
from tasks.handover.receiver import WARNED_PX
from tasks.settings.deliver import OFFERS, World

_WORLDS: dict[World, str] = {
    "local": "The program must treat the coordinates as Cartesian, without any correction for "
    "earth curvature or map scale.",
    "map": "The program must model the map projection and earth curvature. Positions are true; angles "
    "refer to grid north at each camera. In a program that treats map coordinates as Cartesian, they "
    "cause errors of decimetres.",
    "map-cartesian": "For programs that treat map coordinates as Cartesian, with their corrections for "
    "curvature, map scale and refraction switched OFF.",
    "map-cartesian-curved": "For programs that treat map coordinates as Cartesian and correct earth "
    f"curvature themselves: switch that ON (radius {EARTH_RADIUS_M / 1000:,.0f} "
    "km), corrections for map scale and refraction OFF.",
    "rpc": "Latitude, longitude and ELLIPSOIDAL height are converted to row and column of the delivered "
    "image (centre of the first pixel: 0, 0). Camera, distortion, refraction and earth curvature "
    "are contained; no corrections need to be switched.",
}
_AS_DELIVERED = (
    "This block is not adjusted: orientations are delivered or approximate ones, object points are "
    "intersected from them, image points are as measured (not corrected for refraction), cameras as "
    "given."
)
_LEAST_DISTORTION_UM = 0.05
# Below this a misfit is rounding.
_LEAST_MISFIT_PX = 1e-4
_WIDTH = 78


def statement(delivery: Delivery, form: DeliveryFormat, *, adjusted: bool = True) -> str:
    """The text.

    Parameters
    ----------
    adjusted : whether the block is adjusted, or as it was delivered.
    """
    parts = [
        f"{delivery.results.name}: {len(delivery.names)} images, {form.name} ({OFFERS[form.name].meaning})",
        *([] if adjusted else [_AS_DELIVERED]),
        *_about_world(delivery, form),
        *_about_lens(delivery, form),
        *_about_film(delivery),
        *(_about_rigs(delivery, form) if form.oriented else ()),
        *_about_mean_residuals(delivery, form),
        *_about_grids(delivery, form),
        *_about_blanks(delivery, form),
        *_about_incomplete(delivery, form),
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
    return [_WORLDS[delivery.handed.world], _coordinates(delivery, form), *refraction]


def _coordinates(delivery: Delivery, form: DeliveryFormat) -> str:
    images, world = delivery.results.images, delivery.handed.world
    if OFFERS[form.name].placed and world in ("rpc", "map"):
        from_sea = form.name == "kmz" and images.map_frame.heights.geoid is not None
        height = "height above the geoid" if from_sea else "ellipsoidal height"
        return f"Coordinates: latitude, longitude of WGS 84, {height}, from {images.map_frame.description}."
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
            "Refraction of the standard atmosphere, which the adjustment corrected, is removed from the "
            "image points: switch such a correction OFF."
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
                f"; its additional parameters change image points by up to {distortion:.1f} µm and "
                + _contained(form)
                + ("" if corrected or form.grid else ": use corrected images or image coordinates")
            )
        found.append(f"{text}.")
    if form.straight:
        found.append(
            "Image points refer to the centre of the format, x right, y up, and are corrected by the "
            "additional parameters: the program must use a camera without distortion, with this "
            "principal point."
        )
    elif corrected:
        found.append(
            "Image points refer to the principal point and are corrected by the additional parameters: "
            "the program must use a camera without distortion whose principal point is 0, 0."
        )
    return found


def _about_film(delivery: Delivery) -> list[str]:
    """Of cameras whose images are scanned."""
    return [
        f"Camera {camera.frame.name} exposes film: image coordinates refer to its fiducial marks, and pixels "
        "to a scan without shift, turn and deformation. The interior orientation of each scan "
        "(film_orientations.parquet of the results) is NOT contained: the program must determine it from the "
        "fiducial marks."
        for camera in delivery.results.cameras
        if camera.frame.name in delivery.results.film
    ]


def _about_rigs(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    """Whether heads of rigs are heads there."""
    if delivery.results.heads is None:
        return []
    alone, found = "Heads of rigs are written as single cameras", written_rigs(delivery)
    if form.rigs == "none":
        return [f"{alone}: the format has no rigs, or none that is written."]
    if found is None:
        return [
            f"{alone}: their pose relative to the reference head differs between events (offsets of "
            "their shutters), or the reference head has no images."
        ]
    heads = int(np.count_nonzero(np.bincount(found.reference)[found.reference] > 1))
    text = f"Rigs: {heads} heads, {len(found.events):,} events."
    without = sum(len(images) for images in found.events) - sum(
        len(images)
        for first, images in found.with_reference()
        if found.reference[found.camera[first]] == found.camera[first]
    )
    if form.rigs == "with-reference" and without:
        text += f" Images of events without the reference head, written as single images: {without:,}."
    return [text]


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
            f"interpolation reproduces the correction to {largest * 1e6:.3f} µm (root mean square "
            f"{max(forth.rms, back.rms) * 1e6:.3f} µm)."
            + (
                " This is more than 0.1 µm: between nodes the correction has a step, a bend, or too strong a "
                "curvature for so many nodes. Corrected image points (--to corrected-csv) are exact."
                if largest > NOTEWORTHY
                else ""
            )
        )
    if found and form.oriented:
        found.append(
            "The grids are written in both directions, ideal_from_measured.dat and "
            "measured_from_ideal.dat: test with a few points which one the program uses. It must not "
            "apply any other distortion of the camera."
        )
    return found


def _about_blanks(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    """Of names that OpenDroneMap does not read whole."""
    blank = [name for name in delivery.names if any(sign.isspace() for sign in name)]
    on_earth = isinstance(delivery.results.images.frame, TopocentricFrame)
    if form.name != "opensfm" or not blank or not on_earth:
        return []
    return [
        f"OpenDroneMap ends the names of images at a blank ({blank[0]}): geo.txt is not written, and it does "
        "not find these images in gcp_list.txt. Rename them before the adjustment if it is to use the lists."
    ]


def _about_incomplete(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    """Of surveyed points that the format cannot have."""
    given = delivery.points.surveyed.in_map
    lacking = int(np.isnan(given).any(axis=1).sum())
    has_all = form.surveyed == "all" and delivery.handed.world != "local"
    if not lacking or has_all or form.surveyed == "none":
        return []
    return [
        f"{lacking:,} of {len(given):,} surveyed points lack a coordinate, which this format does not "
        "support: they are not written as control or check points."
    ]


def _about_mean_residuals(delivery: Delivery, form: DeliveryFormat) -> list[str]:
    """Of cameras whose image points were corrected by mean residuals."""
    return [
        f"Camera {camera.frame.name}: mean residuals, which the adjustment added to image points, change "
        f"them by up to {camera.largest_mean_residual * 1e6:.1f} µm and {_contained(form)}."
        for camera in delivery.results.cameras
        if camera.largest_mean_residual * 1e6 > _LEAST_DISTORTION_UM
    ]


def _about_model(model: LensModel) -> str:
    """The camera model in the files."""
    (fx, fy), (column, row) = model.focal, model.principal_point
    lens = ", ".join(f"{name} {value:.6g}" for name, value in model.distortion.items() if value)
    return (
        f"Camera {model.name}: focal length {fx:.4f}, {fy:.4f} pixels, principal point "
        f"{column:.4f}, {row:.4f} pixels from the corner of the first one; distortion from the ideal to the "
        f"measured point: {lens or 'none'}, fitted over the format to {model.misfit_um:.3f} µm."
        + (
            " This is more than 0.1 µm: compare corrected image points."
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
        text += " This is large: use corrected images, or rational polynomials (--to rpc)."
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
        text += " This is large: if the program supports another kind of coordinates, use it (--world)."
    if not handed.refitted:
        return [text]
    moved = handed.pose.centre - images.map_pose.centre
    changed = (
        "Orientations were fitted to the program's model: they are NO LONGER camera positions (heights "
        f"changed by {moved[:, 2].min():+z.2f} to {moved[:, 2].max():+z.2f} m). Never compare them with "
        "GNSS; the rigorous ones are in eo_rigorous.csv."
    )
    focal = {
        camera.frame.name: 1e3 * float(handed.pose.focal_length[np.argmax(images.camera == k)])
        for k, camera in enumerate(delivery.results.cameras)
    }
    if not np.allclose(handed.pose.focal_length, images.focal_length[images.camera], rtol=0, atol=1e-12):
        listed = ", ".join(f"{name} {value:.4f} mm" for name, value in focal.items())
        changed += f" The focal length to be entered is also fitted: {listed}."
    return [text, changed]
