"""BLUH's additional parameters of the four corners of the image, for CCDs that are not flat.

With u, v the image point as a part of half the format and the signs s of a corner (upper right, lower right,
lower left, upper left), the weight

    w = (max(0, s_x u) · max(0, s_y v))²

is 1 in the corner, and zero with its slope on the axes and beyond. Two parameters of each corner give its
displacement outwards along x and along y in millimetres on the image: Δ = −s w P. Numbers and purpose are
published, the formula is reconstructed.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import Column, ImageFormat, Term

_MILLIMETRE = 1e-3
_CORNERS = {"upper right": (1, 1), "lower right": (1, -1), "lower left": (-1, -1), "upper left": (-1, 1)}

TERMS = tuple(
    Term(str(81 + 2 * index + odd), f"{corner} corner outwards in {axis}", "mm", "reconstructed")
    for index, corner in enumerate(_CORNERS)
    for odd, axis in enumerate("xy")
)
_PLACE = {term.name: index for index, term in enumerate(TERMS)}


def columns(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> list[Column]:
    """Correction Δx (n,), Δy (n,) of each term for a value of 1, metres, see ``base.ParameterSet``."""
    u, v = np.ascontiguousarray(xy.T) / [[image_format.half_x], [image_format.half_y]]
    signs = tuple(_CORNERS.values())
    nothing = np.zeros_like(u)
    result: list[Column] = []
    for name in names:
        corner, axis = divmod(_PLACE[name], 2)
        sign_x, sign_y = signs[corner]
        weight = (np.maximum(sign_x * u, 0.0) * np.maximum(sign_y * v, 0.0)) ** 2
        displacement = weight * (-_MILLIMETRE * signs[corner][axis])
        result.append((displacement, nothing) if axis == 0 else (nothing, displacement))
    return result
