"""A balanced radial polynomial: c, x0, y0 and a1 … a3, as in the camera test of the DGPF.

    Δ = (x, y) · Σ a_i (r^2i − r0^2i),    i = 1 … 3,    r0 = ⅔ r_max

with half the diagonal of the image r_max. The distortion vanishes at r0, so a_i hardly changes the focal
length; with K1 … K3 of Brown, that leave r unbalanced, the two are strongly correlated. c, x0 and y0 belong
to the interior orientation. The published tables name the parameters; the balance is reconstructed.

Both describe the same camera: with ε = Σ a_i r0^2i the linear term −ε (x, y) is a change of scale, so that

    K_i = a_i / (1 − ε),    c of Brown = c / (1 − ε).
"""

from __future__ import annotations

import math

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Term

_TERMS = (
    Term("a1", "radial, r³ balanced", "1/mm²", "reconstructed"),
    Term("a2", "radial, r⁵ balanced", "1/mm⁴", "reconstructed"),
    Term("a3", "radial, r⁷ balanced", "1/mm⁶", "reconstructed"),
)
_ORDER = {term.name: order for order, term in enumerate(_TERMS, start=1)}


def zero_crossing(image_format: ImageFormat) -> float:
    """Radius r0 in metres at which the correction vanishes: two thirds of half the diagonal."""
    return 2.0 / 3.0 * math.hypot(image_format.half_x, image_format.half_y)


def _basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    xy_mm = 1e3 * xy
    square = np.sum(xy_mm * xy_mm, axis=1)
    balance = (1e3 * zero_crossing(image_format)) ** 2
    result = np.empty((len(xy), 2, len(names)))
    for column, name in enumerate(names):
        order = _ORDER[name]
        result[:, :, column] = (square**order - balance**order)[:, None] * xy
    return result


SET = ParameterSet(
    "dgpf",
    "balanced radial",
    "names from the camera test of the DGPF; balanced form reconstructed",
    _TERMS,
    _basis,
    "c, x0 and y0 of the published set belong to the interior orientation. The correction vanishes at two "
    "thirds of half the diagonal. K_i of Brown = a_i / (1 − ε), c of Brown = c / (1 − ε), ε = Σ a_i r0^2i.",
    formulas=__doc__ or "",
)


def brown_from_balanced(values: Floats, radius: float, focal_length: float) -> tuple[Floats, float]:
    """K1, K2, K3 (3,) and c of Brown's form from a1, a2, a3 (3,), r0 and c; all in one unit of length.

    Both correct the same measurement to the same direction, (x, y)_ideal / c.
    """
    scale = 1.0 - _sum_at(values, radius)
    return values / scale, focal_length / scale


def balanced_from_brown(values: Floats, radius: float, focal_length: float) -> tuple[Floats, float]:
    """a1, a2, a3 (3,) and c of the balanced form from K1, K2, K3 (3,), r0 and c; the inverse."""
    scale = 1.0 + _sum_at(values, radius)
    return values / scale, focal_length / scale


def _sum_at(values: Floats, radius: float) -> float:
    """Σ a_i r^2i."""
    return float(values @ radius ** np.array([2.0, 4.0, 6.0]))
