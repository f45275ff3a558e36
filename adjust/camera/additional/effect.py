"""Effect of additional parameters on the image: of each one, and the systematic image error of all.

The effect of a parameter is the length of its correction |Δ|. The systematic image error is −Δ: what the
image shows too much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.calibration_axes import calibration_from_image
from adjust.camera.additional.correction import correction
from adjust.camera.additional.register import AdditionalParameters

_POINTS_ACROSS = 201


@dataclass(frozen=True, eq=False)
class Effects:
    """Effect over the format of a value of 1 of each of k parameters.

    Attributes
    ----------
    largest : (k,) metres.
    rms : (k,) root mean square over the area of the format, metres.
    """

    largest: Floats
    rms: Floats


@dataclass(frozen=True, eq=False)
class ImageErrorField:
    """The systematic image error −Δ on a grid over the format.

    Attributes
    ----------
    xy : (n, 2) points of the grid, metres from the principal point, image axes.
    error : (n, 2) metres.
    largest, rms : of its length; the latter over the area of the format.
    """

    xy: Floats
    error: Floats
    largest: float
    rms: float


def effects(parameters: AdditionalParameters, points_across: int = _POINTS_ACROSS) -> Effects:
    """Effect of each parameter, from a grid of points that includes the edges of the format."""
    xy, weight = _grid(parameters, points_across, points_across)
    squared = np.sum(parameters.basis(xy) ** 2, axis=1)
    return Effects(np.sqrt(squared.max(axis=0)), np.sqrt(weight @ squared))


def sigma_of_effect(parameters: AdditionalParameters, largest: float) -> Floats:
    """Standard deviations (k,), in the unit of each parameter, with a given largest effect in metres."""
    return np.asarray(largest / effects(parameters).largest)


def image_error_field(
    parameters: AdditionalParameters, values: Floats, columns: int = 25, rows: int = 25
) -> ImageErrorField:
    """Systematic image error of parameter values (k,) on a grid of columns × rows over the format."""
    xy, weight = _grid(parameters, columns, rows)
    error = -correction(parameters, values, xy)
    squared = np.sum(error**2, axis=1)
    return ImageErrorField(xy, error, float(np.sqrt(squared.max())), float(np.sqrt(weight @ squared)))


def _grid(parameters: AdditionalParameters, columns: int, rows: int) -> tuple[Floats, Floats]:
    """Points (n, 2) over the format in image axes, edges included, and the share (n,) of each in its area."""
    image_format, turn = parameters.image_format, calibration_from_image(parameters.turn_deg)
    half_x, half_y = np.abs(turn.T @ [image_format.half_x, image_format.half_y])
    x, y = np.meshgrid(np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows))
    weight = np.outer(_trapezoid(rows), _trapezoid(columns))
    return np.stack([x.ravel(), y.ravel()], axis=1), weight.ravel()


def _trapezoid(points: int) -> Floats:
    """Weights (points,) of the trapezoidal rule over a length of 1: those at the ends count half."""
    weight = np.full(points, 1.0)
    weight[[0, -1]] = 0.5
    return np.asarray(weight / weight.sum())
