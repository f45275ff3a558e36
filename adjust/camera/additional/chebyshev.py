"""Chebyshev polynomials of degree n, in the pattern of the Legendre sets.

T_i(u) T_j(v) instead of P_i(u) P_j(v). Their size is the same all over the image (|T_i| ≤ 1), but they are
not orthogonal over a uniformly covered one: correlations reach 0.50 for n = 5. Legendre is preferable.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from adjust.arrays import Floats
from adjust.camera.additional.base import ParameterSet
from adjust.camera.additional.legendre import equal_weights
from adjust.camera.additional.orthogonal_products import ProductScheme, all_products

#: The degrees that are offered.
DEGREES = range(2, 11)


@cache
def chebyshev(degree: int) -> ParameterSet:
    """The set ``chebyshev(degree)``.

    Raises
    ------
    ValueError : unless degree is 2 … 10.
    """
    if degree not in DEGREES:
        raise ValueError(f"the degree of a Chebyshev set is 2 … 10, not {degree}")

    def polynomials(t: Floats, half: float) -> Floats:
        return _chebyshev_polynomials(t / half, degree)

    return ProductScheme(
        symbol="T",
        products=all_products(degree),
        polynomials=polynomials,
        weights=equal_weights,
        unit=lambda _: "µm",
        metres=1.0,
        effect=1e-6,
    ).parameter_set(
        f"chebyshev({degree})",
        f"Chebyshev polynomials of degree {degree}",
        "the pattern of Tang, Fritsch and Cramer (2012) with Chebyshev polynomials of the first kind",
        "reconstructed",
        "u and v run from −1 to 1 over the image. Not orthogonal over a uniformly covered image: Legendre"
        " is to be preferred.",
        __doc__ or "",
    )


def _chebyshev_polynomials(u: Floats, degree: int) -> Floats:
    """T_0 … T_degree (degree + 1, n) by T_i+1 = 2 u T_i − T_i−1."""
    result = np.empty((degree + 1, len(u)))
    result[0], result[1] = 1.0, u
    for i in range(1, degree):
        result[i + 1] = 2.0 * u * result[i] - result[i - 1]
    return result
