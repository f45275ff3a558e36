"""The twelve general additional parameters of BLUH.

With the direction b of an image point and its coordinates x, y, r in normalised millimetres (the corner of
the image at r = 162.6), the published table displaces the point by −P times

    1  (y, x)             2   (x, −y)             3   (x, y) cos 2b         4   (x, y) sin 2b
    5  (x, y) cos b       6   (x, y) sin b        7   (−y, x) r cos b       8   (−y, x) r sin b
    9  (x, y) (r² − 128²) 10  (x, y) sin(π r/64)  11  (x, y) sin(π r/32)    12  (x, y) sin 4b

9, 10 and 11 vanish at r = 128, 10 also at 64, 11 at all multiples of 32. The table is printed with
b = arctan(y/x); meant is the direction of the point, so cos b = x/r and sin b = y/r.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import Column, ImageFormat, Term

#: Of normalised image coordinates, in which all parts but the corners are defined.
LARGEST_RADIUS = 162.6  # mm, √2 · 115: the corner of a photograph of 23 cm
_RADIAL_ZERO_SQUARED = 128.0**2  # published as 16384
_WAVE_NUMBER_10 = np.pi / 64.0  # published as 0.049087, and twice that for 11: 6e-5 rad apart at r = 162.6


def normalised_millimetre(image_format: ImageFormat) -> float:
    """One normalised millimetre on the image, metres: half the diagonal of the format / 162.6."""
    return float(np.hypot(image_format.half_x, image_format.half_y)) / LARGEST_RADIUS


class NormalisedPoints:
    """Image points in normalised coordinates, calibration axes.

    Attributes
    ----------
    x, y : (n,) normalised millimetres.
    x_metres, y_metres : (n,) the same on the image.
    metres : one normalised millimetre on the image.
    """

    def __init__(self, xy: Floats, image_format: ImageFormat) -> None:
        self.x_metres, self.y_metres = np.ascontiguousarray(xy.T)
        self.metres = normalised_millimetre(image_format)
        self.x, self.y = self.x_metres / self.metres, self.y_metres / self.metres


TERMS = (
    Term("1", "angular affinity", "1", "published"),
    Term("2", "affinity", "1", "published"),
    Term("3", "radial, cos 2b", "1", "published"),
    Term("4", "radial, sin 2b", "1", "published"),
    Term("5", "radial, cos b", "1", "published"),
    Term("6", "radial, sin b", "1", "published"),
    Term("7", "tangential distortion 1", "1/mm", "published"),
    Term("8", "tangential distortion 2", "1/mm", "published"),
    Term("9", "radial symmetric, r³", "1/mm²", "published"),
    Term("10", "radial symmetric, sin(πr/64)", "1", "published"),
    Term("11", "radial symmetric, sin(πr/32)", "1", "published"),
    Term("12", "radial, sin 4b", "1", "published"),
)


class _Directions(NormalisedPoints):
    """Normalised points with the functions of their direction b; at the origin cos b = sin b = 0."""

    @cached_property
    def r_squared(self) -> Floats:
        return np.asarray(self.x**2 + self.y**2)

    @cached_property
    def r(self) -> Floats:
        return np.sqrt(self.r_squared)

    @cached_property
    def _inverse_r(self) -> Floats:
        return np.divide(1.0, self.r, out=np.zeros_like(self.r), where=self.r > 0.0)

    @cached_property
    def cos_b(self) -> Floats:
        return np.asarray(self.x * self._inverse_r)

    @cached_property
    def sin_b(self) -> Floats:
        return np.asarray(self.y * self._inverse_r)

    @cached_property
    def cos_2b(self) -> Floats:
        return (self.cos_b - self.sin_b) * (self.cos_b + self.sin_b)

    @cached_property
    def sin_2b(self) -> Floats:
        return 2.0 * self.cos_b * self.sin_b

    @cached_property
    def sin_10(self) -> Floats:
        return np.sin(_WAVE_NUMBER_10 * self.r)

    @cached_property
    def sin_11(self) -> Floats:
        return 2.0 * self.sin_10 * np.cos(_WAVE_NUMBER_10 * self.r)

    def radial(self, factor: Floats) -> Column:
        """Towards the origin, by the distance times a factor; metres."""
        negative = -factor
        return self.x_metres * negative, self.y_metres * negative

    def tangential(self, factor: Floats) -> Column:
        """Across the radius, clockwise, by the distance times a factor; metres."""
        return self.y_metres * factor, self.x_metres * -factor


# Δ for P = 1, metres: a factor in normalised coordinates times metres on the image. No trigonometry of b is
# needed.
_COLUMNS: dict[str, Callable[[_Directions], Column]] = {
    "1": lambda p: (-p.y_metres, -p.x_metres),
    "2": lambda p: (-p.x_metres, p.y_metres),
    "3": lambda p: p.radial(p.cos_2b),
    "4": lambda p: p.radial(p.sin_2b),
    "5": lambda p: p.radial(p.cos_b),
    "6": lambda p: p.radial(p.sin_b),
    "7": lambda p: p.tangential(p.x),  # r cos b
    "8": lambda p: p.tangential(p.y),  # r sin b
    "9": lambda p: p.radial(p.r_squared - _RADIAL_ZERO_SQUARED),
    "10": lambda p: p.radial(p.sin_10),
    "11": lambda p: p.radial(p.sin_11),
    "12": lambda p: p.radial(2.0 * p.sin_2b * p.cos_2b),
}


def columns(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> list[Column]:
    """Correction Δx (n,), Δy (n,) of each term for a value of 1, metres, see ``base.ParameterSet``."""
    points = _Directions(xy, image_format)
    return [_COLUMNS[name](points) for name in names]
