"""Cameras for computer-vision programs: pixels, and distortion from the ideal to the measured point.

Such programs know neither correction polynomials nor mean residuals nor refraction. All go into Brown's coefficients and, for refraction,
the focal length and principal point, fitted over the format with the ground at middle height below the camera's images; what is left is
the misfit, which is computed for every image at three heights of its own ground.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.conversion import Conversion, fitted, refuse_folded
from adjust.camera.additional.correction import measured_from_ideal
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from adjust.errors import AdditionalParametersError
from adjust.handover.cartesian_map import Pose
from tasks.errors import InputError
from tasks.handover.results import CalibratedCamera, Results

_SET = "brown-forward"
_SIDE = 9
# A radial term of some 1e-4: each round gains four digits.
_ROUNDS = 5
# Images of a camera whose refraction is averaged at most.
_AVERAGED = 50


@dataclass(frozen=True)
class LensModel:
    """A camera in pixels from the corner of the first one, column to the right, row downwards.

    Attributes
    ----------
    name, columns, rows : of the camera.
    pixel_size : metres.
    focal : (fx, fy).
    principal_point : (column, row).
    distortion : k1, k2, k3, p1, p2 of OpenCV; those a format does not have are 0.
    misfit_um : largest difference over the format between these and ours, with refraction for ground at
        middle height.
    """

    name: str
    columns: int
    rows: int
    pixel_size: float
    focal: tuple[float, float]
    principal_point: tuple[float, float]
    distortion: dict[str, float]
    misfit_um: float = 0.0


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Forward parameters with their focal length and values, the principal point (2,) and misfit, metres."""

    parameters: AdditionalParameters
    values: Floats
    principal_point: Floats
    misfit: float = 0.0


@dataclass(frozen=True, eq=False)
class Lenses:
    """Models of all cameras of a block.

    Attributes
    ----------
    models : in the order of the cameras.
    misfit_px : (n,) of each image, largest over its format and ground.
    """

    models: tuple[LensModel, ...]
    misfit_px: Floats

    @property
    def names(self) -> list[str]:
        """Names of the cameras."""
        return [model.name for model in self.models]


def lens_models(results: Results, terms: tuple[str, ...], fitted_pose: Pose | None = None) -> Lenses:
    """Models with these of the terms k1, k2, k3, p1, p2, b1.

    Parameters
    ----------
    fitted_pose : orientations that were fitted to the program's model, with a focal length and radial term of
        each camera; these go into the models, and refraction is in the orientations. None: true ones.

    Raises
    ------
    InputError
        If the distortion of a camera cannot be expressed.
    """
    misfit, models = np.zeros(len(results.images.names)), []
    for number, camera in enumerate(results.cameras):
        of_camera = np.flatnonzero(results.images.camera == number)
        try:
            if fitted_pose is None:
                fit = _fit(results, camera, of_camera, terms)
            else:
                c, k1 = (float(of[of_camera[0]]) for of in (fitted_pose.focal_length, fitted_pose.radial))
                fit = _fit_with_pose(camera, c, k1, terms)
        except AdditionalParametersError as error:
            raise InputError(error.what, error.remedy, entity=f"camera {camera.frame.name}") from error
        models.append(_in_pixels(camera, fit))
        if fitted_pose is not None:
            misfit[of_camera] = _misfit_with_pose(camera, c, k1, fit)
            continue
        for image in of_camera:
            misfit[image] = _misfit(results, camera, int(image), fit)
    return Lenses(tuple(models), misfit)


def _fit(results: Results, camera: CalibratedCamera, of_camera: Ints, terms: tuple[str, ...]) -> _Fitted:
    """Focal length and principal point of straight rays, then the distortion."""
    frame, x0 = camera.frame, np.array(camera.frame.principal_point)
    xy = refuse_folded(_with_format(camera), camera.values, x0)
    ideal = camera.corrected(xy + x0)
    straight, c, shift = ideal, frame.focal_length, np.zeros(2)
    if results.images.refracted:
        chosen = of_camera[np.linspace(0, len(of_camera) - 1, min(len(of_camera), _AVERAGED)).astype(int)]
        straight = np.mean([_straight(results, int(image), ideal, 1) for image in chosen], axis=0)
        # Refraction grows with the radius and, in tilted images, is a shift; the distortion takes the rest.
        square = (straight**2).sum(axis=1, keepdims=True) / c**2
        units = np.broadcast_to(np.eye(2), (len(straight), 2, 2))
        columns = np.concatenate([np.stack([straight, straight * square], axis=-1), units], axis=-1)
        found = np.linalg.lstsq(columns.reshape(-1, 4), (ideal - straight).ravel(), rcond=None)[0]
        c, shift = c * (1.0 + found[0]), found[2:]
    wanted = _wanted(camera, float(c), terms)
    if not len(camera.values) and camera.grid is None and not results.images.refracted:
        return _Fitted(wanted, np.zeros(len(terms)), x0)
    return _of_conversion(fitted(wanted, xy - shift, straight * (c / frame.focal_length)), x0 + shift)


def _fit_with_pose(camera: CalibratedCamera, c: float, k1: float, terms: tuple[str, ...]) -> _Fitted:
    """The distortion from points of the program's own pinhole to measured ones."""
    x0 = np.array(camera.frame.principal_point)
    xy = refuse_folded(_with_format(camera), camera.values, x0)
    straight = _without_radial(camera.corrected(xy + x0), c, k1)
    return _of_conversion(fitted(_wanted(camera, c, terms), xy, straight), x0)


def _of_conversion(found: Conversion, principal_point: Floats) -> _Fitted:
    largest = float(np.linalg.norm(found.misfit, axis=1).max())
    return _Fitted(found.parameters, found.values, principal_point, largest)


def _misfit_with_pose(camera: CalibratedCamera, c: float, k1: float, fit: _Fitted) -> float:
    """Largest difference of measured points over the format, pixels."""
    steps = np.linspace(-1.0, 1.0, _SIDE)
    xy = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * np.array(camera.frame.half_format)
    straight = _without_radial(camera.corrected(xy), c, k1)
    found, _ = measured_from_ideal(fit.parameters, fit.values, straight)
    return float(np.linalg.norm(found + fit.principal_point - xy, axis=1).max() / camera.frame.pixel_size)


def _without_radial(ideal: Floats, c: float, k1: float) -> Floats:
    """Points (n, 2) of a pinhole of focal length c that its radial term k1 moves to the ideal ones."""
    found = ideal
    for _ in range(_ROUNDS):
        found = ideal / (1.0 + k1 * (found**2).sum(axis=1, keepdims=True) / c**2)
    return found


def _wanted(camera: CalibratedCamera, c: float, terms: tuple[str, ...]) -> AdditionalParameters:
    image_format = format_in_calibration_axes(camera.frame.half_format, 0, None, c)
    return additional_parameters("+".join(f"{_SET}:{term}" for term in terms), image_format)


def _with_format(camera: CalibratedCamera) -> AdditionalParameters:
    """The camera's parameters over its own format, even if it has no parameters."""
    if len(camera.values):
        return camera.additional
    frame = camera.frame
    return additional_parameters("none", format_in_calibration_axes(frame.half_format, 0))


def _straight(results: Results, image: int, ideal: Floats, level: int) -> Floats:
    one = results.images.only(image)
    height = np.full((1, len(ideal)), results.ground[image, level])
    return np.asarray(one.straight(ideal[None], height)[0])


def _misfit(results: Results, camera: CalibratedCamera, image: int, fit: _Fitted) -> float:
    """Largest difference of measured points, pixels."""
    xy = results.images.only(image).grid_of_image_points(_SIDE)[0]
    ideal = camera.corrected(xy)
    scale = fit.parameters.image_format.needed_focal_length / camera.frame.focal_length
    away = []
    for level in range(3):
        straight = scale * _straight(results, image, ideal, level)
        found, _ = measured_from_ideal(fit.parameters, fit.values, straight)
        away.append(np.linalg.norm(found + fit.principal_point - xy, axis=1).max())
    return float(max(away) / camera.frame.pixel_size)


def _in_pixels(camera: CalibratedCamera, fit: _Fitted) -> LensModel:
    frame, pixel = camera.frame, camera.frame.pixel_size
    names = (name.removeprefix(f"{_SET}:") for name in fit.parameters.names)
    known = dict(zip(names, fit.values.tolist(), strict=True))
    c = fit.parameters.image_format.needed_focal_length / pixel
    x0, y0 = (float(value) / pixel for value in fit.principal_point)
    stretched = c * (1.0 + known.pop("b1", 0.0))
    lens = {name: known.get(name, 0.0) for name in ("k1", "k2", "k3", "p1", "p2")}
    centre = (0.5 * frame.columns + x0, 0.5 * frame.rows - y0)
    size = (frame.columns, frame.rows, pixel)
    return LensModel(frame.name, *size, (stretched, c), centre, lens, fit.misfit * 1e6)


def seen_pixels(lenses: Lenses, camera: Ints, in_camera: Floats) -> Floats:
    """Column and row (m, 2) where cameras (m,) see points (m, 3) in axes x right, y down, z forward."""
    u, v = (in_camera[:, :2] / in_camera[:, 2:]).T
    square = u * u + v * v
    k1, k2, k3, p1, p2 = np.array([list(model.distortion.values()) for model in lenses.models])[camera].T
    focal = np.array([model.focal for model in lenses.models])[camera]
    centre = np.array([model.principal_point for model in lenses.models])[camera]
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    bent = np.column_stack(
        [
            u * radial + 2.0 * p1 * u * v + p2 * (square + 2.0 * u * u),
            v * radial + p1 * (square + 2.0 * v * v) + 2.0 * p2 * u * v,
        ]
    )
    return np.asarray(centre + focal * bent)
