"""BLUH's additional parameters of the four sub-images of the DMC.

Each quarter of the virtual image comes from one camera head. Upper right is x > 0, y > 0, in normalised
millimetres. With P the value, the image point is displaced by −P times

    34 … 41  xy in x (even) or in y (odd), inside the upper right, lower right, lower left, upper left quarter
    79       (x |y|, y |x|)           the same shear mirrored into all quarters
    80       (u, v) (ρ² − ρ0²)        radial in each head; ρ² = u² + v², ρ0 half the largest ρ
    29, 30   (sgn x, 0), (0, sgn y)   the heads apart
    31       (u, v)                   scale of the heads
    32       sgn(xy) (−v, u)          rotation of the heads, mirrored
    33       (u, −v)                  affinity of the heads

with u, v from the centre of the head's image. 34–41 are published; of the others, only numbers and names
are published, and the formulas are reconstructed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import Column, ImageFormat, Term
from adjust.camera.additional.bluh_general import NormalisedPoints

# Centre of a head's image in the virtual image of the DMC, 92.16 mm × 165.888 mm, as a part of half the side:
# ±22.54 mm and ±38.9 mm from the table of the camera's platform calibration.
_CENTRE_X, _CENTRE_Y = 22.54 / 46.08, 38.9 / 82.944

_QUARTERS = ("upper right", "lower right", "lower left", "upper left")

TERMS = (
    Term("29", "heads apart in x", "mm", "reconstructed"),
    Term("30", "heads apart in y", "mm", "reconstructed"),
    Term("31", "common scale of the heads", "1", "reconstructed"),
    Term("32", "common rotation of the heads, mirrored", "1", "reconstructed"),
    Term("33", "common affinity of the heads", "1", "reconstructed"),
    *(
        Term(
            str(34 + 2 * index + odd), f"DMC {head} {index + 1}: xy in {axis}, {quarter}", "1/mm", "published"
        )
        for index, quarter in enumerate(_QUARTERS)
        for odd, (axis, head) in enumerate((("x", "Y"), ("y", "X")))  # named so in the published table
    ),
    Term("79", "common perspective of the heads", "1/mm", "reconstructed"),
    Term("80", "common radial symmetric distortion of the heads", "1/mm²", "reconstructed"),
)


class _Quarters(NormalisedPoints):
    """Normalised points and their place in the image of their head.

    Attributes
    ----------
    nothing : (n,) zeros.
    radial_zero_squared : ρ0², a quarter of the largest ρ² in a quarter of the image.
    """

    def __init__(self, xy: Floats, image_format: ImageFormat) -> None:
        super().__init__(xy, image_format)
        self._half = np.array([image_format.half_x, image_format.half_y]) / self.metres
        self.nothing = np.zeros_like(self.x)
        # From the centre of the head's image to the corner of the format, or to the axes.
        centre = np.array([_CENTRE_X, _CENTRE_Y])
        self.radial_zero_squared = 0.25 * float(np.sum((self._half * np.maximum(1.0 - centre, centre)) ** 2))

    @cached_property
    def sign_x(self) -> Floats:
        return np.asarray(np.sign(self.x))

    @cached_property
    def sign_y(self) -> Floats:
        return np.asarray(np.sign(self.y))

    @cached_property
    def u(self) -> Floats:
        """(n,) x from the centre of the head's image."""
        return np.asarray(self.x - self.sign_x * (_CENTRE_X * self._half[0]))

    @cached_property
    def v(self) -> Floats:
        """(n,) y from the centre of the head's image."""
        return np.asarray(self.y - self.sign_y * (_CENTRE_Y * self._half[1]))

    def shear(self, right: bool, upper: bool) -> Floats:
        """−xy (n,) inside a quarter, zero outside and on its axes; metres for P = 1."""
        of_x = np.maximum(self.x_metres, 0.0) if right else np.minimum(self.x_metres, 0.0)
        of_y = np.maximum(self.y, 0.0) if upper else np.minimum(self.y, 0.0)
        return np.asarray(-of_x * of_y)

    def displaced(self, x: Floats, y: Floats) -> Column:
        """Δ in metres of a displacement by (x, y) normalised millimetres."""
        return x * -self.metres, y * -self.metres


def _radial_of_heads(points: _Quarters) -> Column:
    factor = points.u**2 + points.v**2 - points.radial_zero_squared
    return points.displaced(points.u * factor, points.v * factor)


def _rotation_of_heads(points: _Quarters) -> Column:
    mirrored = points.sign_x * points.sign_y
    return points.displaced(mirrored * -points.v, mirrored * points.u)


# Δ for P = 1, metres.
_COLUMNS: dict[str, Callable[[_Quarters], Column]] = {
    "29": lambda p: p.displaced(p.sign_x, p.nothing),
    "30": lambda p: p.displaced(p.nothing, p.sign_y),
    "31": lambda p: p.displaced(p.u, p.v),
    "32": _rotation_of_heads,
    "33": lambda p: p.displaced(p.u, -p.v),
    "34": lambda p: (p.shear(right=True, upper=True), p.nothing),
    "35": lambda p: (p.nothing, p.shear(right=True, upper=True)),
    "36": lambda p: (p.shear(right=True, upper=False), p.nothing),
    "37": lambda p: (p.nothing, p.shear(right=True, upper=False)),
    "38": lambda p: (p.shear(right=False, upper=False), p.nothing),
    "39": lambda p: (p.nothing, p.shear(right=False, upper=False)),
    "40": lambda p: (p.shear(right=False, upper=True), p.nothing),
    "41": lambda p: (p.nothing, p.shear(right=False, upper=True)),
    "79": lambda p: p.displaced(p.x * np.abs(p.y), p.y * np.abs(p.x)),
    "80": _radial_of_heads,
}


def columns(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> list[Column]:
    """Correction Δx (n,), Δy (n,) of each term for a value of 1, metres, see ``base.ParameterSet``."""
    points = _Quarters(xy, image_format)
    return [_COLUMNS[name](points) for name in names]
