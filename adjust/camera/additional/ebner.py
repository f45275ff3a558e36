"""Ebner's twelve parameters, orthogonal over 3 × 3 points of the image.

With half the sides of the image b_x, b_y, the points at 0 and ±b, and

    k = x² − ⅔ b_x²,    l = y² − ⅔ b_y²,

    Δx = a1 x + a2 y − 2 a3 k + a4 x y + a5 l + a7 x l + a9 y k + a11 k l
    Δy = −a1 y + a2 x + a3 x y − 2 a4 l + a6 k + a8 y k + a10 x l + a12 k l.

They are orthogonal to each other and to shift, scale, rotation and tilt of the image; focal length and
principal point are not included. Ebner's image is square. For other formats, four weights account for the
ratio of the sides (:func:`~adjust.camera.additional.orthogonal_products.weights_against_orientation`), so
that the parameters remain orthogonal.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.orthogonal_products import (
    COMBINED,
    Products,
    ProductScheme,
    per_millimetre,
    weights_against_orientation,
)


def _polynomials(t: Floats, half: float) -> Floats:
    """1, t, t² − ⅔ b²: orthogonal over −b, 0, b; (3, n)."""
    return np.stack([np.ones_like(t), t, t * t - 2.0 / 3.0 * half**2])


def _weights(image_format: ImageFormat) -> Floats:
    return weights_against_orientation(image_format, 2.0 / 3.0, 2.0 / 9.0)


SET = ProductScheme(
    symbol="E",
    products=(
        *COMBINED,
        Products((1, 2), None),
        Products(None, (2, 1)),
        Products((2, 1), None),
        Products(None, (1, 2)),
        Products((2, 2), None),
        Products(None, (2, 2)),
    ),
    polynomials=_polynomials,
    weights=_weights,
    unit=per_millimetre,
    metres=1e-3,
    effect=1e-3,
).parameter_set(
    "ebner",
    "Ebner, 12 parameters",
    "Ebner (1976), as programmed in MicMac (cEbnersModel)",
    "published",
    "Orthogonal to each other and to the exterior orientation over 3 × 3 points at the edges and the "
    "middle of the image; focal length and principal point are not included.",
    __doc__ or "",
)
