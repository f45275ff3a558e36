"""Legendre polynomials of degree n: the pattern of Ebner and Grün for a uniformly covered image.

    Δ = 1e-6 · products of P_i(u) and P_j(v),    u = x / b_x,  v = y / b_y,    i, j ≤ n

with half the sides b_x, b_y of the image, so that coefficients are about micrometres. 2 (n + 1)² − 6
parameters: 12, 26, 44, 66 for n = 2 … 5, in the order of
:mod:`~adjust.camera.additional.orthogonal_products`.

Over a uniformly covered image they are orthogonal to each other; but for 1 … 4, also to the exterior
orientation. Parameters 1 … 4 are combined with equal weights as published: in a square image 3 and 4 have a
correlation of 0.09 with the tilts; in a rectangular one 1 and 2 are correlated with scale and rotation, too.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet
from adjust.camera.additional.orthogonal_products import ProductScheme, all_products

#: The degrees that are offered.
DEGREES = range(2, 11)


@cache
def legendre(degree: int) -> ParameterSet:
    """The set ``legendre(degree)``.

    Raises
    ------
    ValueError : unless degree is 2 … 10.
    """
    if degree not in DEGREES:
        raise ValueError(f"the degree of a Legendre set is 2 … 10, not {degree}")

    def polynomials(t: Floats, half: float) -> Floats:
        return _legendre_polynomials(t / half, degree)

    return ProductScheme(
        symbol="P",
        products=all_products(degree),
        polynomials=polynomials,
        weights=equal_weights,
        unit=lambda _: "µm",
        metres=1.0,
        effect=1e-6,
    ).parameter_set(
        f"legendre({degree})",
        f"Legendre polynomials of degree {degree}",
        "Tang, Fritsch and Cramer (2012); explicit set recalled",
        "reconstructed",
        "u and v run from −1 to 1 over the image. Orthogonal to each other over a uniformly covered "
        "image, and from 5 on to the exterior orientation. The numbering from 7 on is aerocal's own.",
        __doc__ or "",
    )


def equal_weights(image_format: ImageFormat) -> Floats:  # noqa: ARG001
    """Weights (4, 2) of parameters 1 … 4, normalised: (u, −v), (v, u), (u², −u v), (u v, −v²)."""
    return np.array([[1.0, -1.0], [1.0, 1.0], [1.0, -1.0], [1.0, -1.0]])


def _legendre_polynomials(u: Floats, degree: int) -> Floats:
    """P_0 … P_degree (degree + 1, n) by Bonnet's recursion (i + 1) P_i+1 = (2 i + 1) u P_i − i P_i−1."""
    result = np.empty((degree + 1, len(u)))
    result[0], result[1] = 1.0, u
    for i in range(1, degree):
        result[i + 1] = ((2 * i + 1) * u * result[i] - i * result[i - 1]) / (i + 1)
    return result
