"""Fourier parameters of order n: a systematic image error is a smooth function of the place in the image.

    Δx = 1e-6 · Σ (a_pq cos w + b_pq sin w),   Δy likewise with parameters of its own,
    w = π (p u + q v),   u = x / b_x,  v = y / b_y

with half the sides b_x, b_y of the image; p = 0 … n, q = −n … n, q > 0 where p = 0. Four parameters for
each of the 2 n (n + 1) pairs: 16, 48, 96 for n = 1, 2, 3. Coefficients are micrometres.

Over a uniformly covered image they are orthogonal to each other, not to the exterior orientation: sin π u
in x has a correlation of 0.55 with a change of scale. Beyond the image they repeat themselves.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Term

#: The orders that are offered.
ORDERS = range(1, 7)


def frequencies(order: int) -> tuple[tuple[int, int], ...]:
    """The pairs (p, q), one of each two that differ by the sign only."""
    return tuple((p, q) for p in range(order + 1) for q in range(-order, order + 1) if p > 0 or q > 0)


@cache
def fourier(order: int) -> ParameterSet:
    """The set ``fourier(order)``; its terms are cos in x, sin in x, cos in y, sin in y, pair by pair.

    Raises
    ------
    ValueError : unless order is 1 … 6.
    """
    if order not in ORDERS:
        raise ValueError(f"the order of a Fourier set is 1 … 6, not {order}")
    pairs = frequencies(order)
    kinds = (("cos", "x"), ("sin", "x"), ("cos", "y"), ("sin", "y"))
    terms = tuple(
        Term(str(4 * pair + kind + 1), f"{function}({p}, {q}) in {axis}", "µm", "reconstructed")
        for pair, (p, q) in enumerate(pairs)
        for kind, (function, axis) in enumerate(kinds)
    )

    def basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
        along_x = _powers(np.pi * xy[:, 0] / image_format.half_x, order)
        along_y = _powers(np.pi * xy[:, 1] / image_format.half_y, order)
        result = np.zeros((len(xy), 2, len(names)))
        for column, name in enumerate(names):
            pair, kind = divmod(int(name) - 1, 4)
            p, q = pairs[pair]
            wave = along_x[p] * (along_y[q] if q >= 0 else along_y[-q].conj())
            result[:, kind // 2, column] = 1e-6 * (wave.imag if kind % 2 else wave.real)
        return result

    return ParameterSet(
        f"fourier({order})",
        f"Fourier series of order {order}",
        "Tang, Fritsch and Cramer (2012); explicit set recalled",
        terms,
        basis,
        "The wave is cos or sin of π (p u + q v), written (p, q); u and v run from −1 to 1 over the image. "
        "Orthogonal to each other over a uniformly covered image, not to the exterior orientation.",
        formulas=__doc__ or "",
    )


def _powers(angle: Floats, order: int) -> list[NDArray[np.complex128]]:
    """exp(i m w) for m = 0 … order: one sine and cosine, then products."""
    base = np.exp(1j * angle)
    powers = [np.ones_like(base)]
    for _ in range(order):
        powers.append(powers[-1] * base)
    return powers
