"""Grün's forty-four parameters, orthogonal over 5 × 5 points of the image.

The polynomials of one axis, over the points 0, ±b/2, ±b with half the side of the image b:

    1,  x,  k = x² − b²/2,  p = x (x² − 17/20 b²),  r = x² (x² − 31/28 b²) + 9/70 b⁴.

Their products follow the pattern of Ebner's parameters, with 10/7 instead of 2: see
:mod:`~adjust.camera.additional.orthogonal_products`. The polynomials are recalled and verified by their
orthogonality; the order of the parameters from 7 on is aerocal's own.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.orthogonal_products import (
    ProductScheme,
    all_products,
    per_millimetre,
    weights_against_orientation,
)


def _polynomials(t: Floats, half: float) -> Floats:
    """Polynomials of degree 0 … 4, orthogonal over −b, −b/2, 0, b/2, b; (5, n)."""
    square, b2 = t * t, half**2
    return np.stack(
        [
            np.ones_like(t),
            t,
            square - b2 / 2.0,
            t * (square - 17.0 / 20.0 * b2),
            square * (square - 31.0 / 28.0 * b2) + 9.0 / 70.0 * b2**2,
        ]
    )


def _weights(image_format: ImageFormat) -> Floats:
    return weights_against_orientation(image_format, 1.0 / 2.0, 7.0 / 40.0)


SET = ProductScheme(
    symbol="G",
    products=all_products(4),
    polynomials=_polynomials,
    weights=_weights,
    unit=per_millimetre,
    metres=1e-3,
    effect=1e-3,
).parameter_set(
    "gruen",
    "Grün, 44 parameters",
    "Grün (1978); polynomials recalled, verified by their orthogonality",
    "reconstructed",
    "Orthogonal to each other and to the exterior orientation over 5 × 5 points; focal length and "
    "principal point are not included. The numbering from 7 on is aerocal's own.",
    __doc__ or "",
)
