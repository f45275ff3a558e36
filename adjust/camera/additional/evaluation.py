"""The correction Δ of given parameter values, and its derivatives.

Δ = Σ f_k(x̄) a_k. Parameters that come first (the geometry of the pixels) make it a composition: with the
point moved by them, x̃ = x̄ + Σ_first f_k(x̄) a_k,

    Δ = x̃ − x̄ + Σ_others f_k(x̃) a_k,    ∂Δ/∂a_k = (I + ∂Σ_others/∂x̃) f_k(x̄) for those that come first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from adjust.arrays import Bools, Floats

# Metres. A step of central differences far below any distance of a measured point from a seam, where Δ
# jumps, and far above the rounding of coordinates; leaves eight digits of the slope.
_STEP = 1e-9
_POINTS_AT_ONCE = 4000


class Correction(Protocol):
    """What the corrections of one camera are made of, see ``register.AdditionalParameters``."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name ``SET:NAME`` of each of the k parameters."""
        ...

    @property
    def first(self) -> Bools:
        """(k,) which of them come first: the others are evaluated where these have moved the point to."""
        ...

    def basis(self, xy: Floats) -> Floats:
        """Corrections (n, 2, k), metres for each unit, at (n, 2) metres from the principal point."""
        ...


def total_correction(item: Correction, xy: Floats, values: Floats) -> Floats:
    """Δ (n, 2) of parameter values (k,), metres.

    Parameters
    ----------
    xy : (n, 2) measured, metres from the principal point.
    """
    result = np.zeros((len(xy), 2))
    if not np.any(values):
        return result
    # In parts: the basis of all points together would be k times as large as the result.
    for first in range(0, len(xy), _POINTS_AT_ONCE):
        part = slice(first, first + _POINTS_AT_ONCE)
        result[part] = _of_one_part(item, xy[part], values)
    return result


def _of_one_part(item: Correction, xy: Floats, values: Floats) -> Floats:
    basis, first = item.basis(xy), item.first
    if not first.any():
        return _times(basis, values)
    moved = xy + _times(basis, np.where(first, values, 0.0))
    return np.asarray(moved - xy + _times(item.basis(moved), np.where(first, 0.0, values)))


def correction_and_derivatives(item: Correction, xy: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Δ (n, 2) of parameter values (k,), metres, and its derivatives (n, 2, k) by the parameters.

    Parameters
    ----------
    xy : (n, 2) measured, metres from the principal point.
    """
    basis, first = item.basis(xy), item.first
    if not first.any():
        return _times(basis, values), basis
    moved, of_others = xy + _times(basis, np.where(first, values, 0.0)), np.where(first, 0.0, values)
    after = item.basis(moved)
    slope = slope_of(lambda at: total_correction(item, at, of_others), moved)
    return moved - xy + _times(after, of_others), np.where(first, basis + slope @ basis, after)


def _times(basis: Floats, values: Floats) -> Floats:
    """Σ f_k a_k (n, 2); one product of a matrix with a vector, where basis @ values makes n of them."""
    return np.asarray((basis.reshape(-1, len(values)) @ values).reshape(len(basis), 2))


def slope_of(correction: Callable[[Floats], Floats], xy: Floats) -> Floats:
    """∂Δ/∂(x, y) (n, 2, 2) of a correction at points (n, 2), by central differences."""
    result = np.empty((len(xy), 2, 2))
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = _STEP
        ahead, behind = xy + step, xy - step
        difference = correction(ahead) - correction(behind)
        result[:, :, axis] = difference / (ahead - behind)[:, axis, None]
    return result
