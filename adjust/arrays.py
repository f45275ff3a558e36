"""Names of the array types used in signatures, checks of arrays that callers hand over, and their order.

Shapes and units are in the docstrings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adjust.errors import InconsistentBlockError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Numbers of which more than so many times as many are possible as occur are not counted.
_SPARSE = 8


def require_shape(what: str, found: tuple[int, ...], expected: tuple[int, ...]) -> None:
    """Refuse an array of another shape.

    Raises
    ------
    InconsistentBlockError : with both shapes.
    """
    if found != expected:
        raise InconsistentBlockError(f"{what} has the shape {found}; expected: {expected}.")


def as_indices(what: str, values: ArrayLike, count: int) -> Ints:
    """Integers (count,), contiguous: kernels are compiled again for every type and layout of their arrays.

    Raises
    ------
    InconsistentBlockError : if there are not so many, or they are no integers.
    """
    found = np.asarray(values)
    require_shape(what, found.shape, (count,))
    if found.dtype.kind not in "iu" and count:
        raise InconsistentBlockError(f"{what} must be integers, not {found.dtype}.")
    return np.ascontiguousarray(found, dtype=np.int64)


def order_of_numbers(*keys: Ints) -> Ints:
    """``numpy.lexsort(keys)`` of whole numbers from 0 on, which are counted instead of compared.

    Indices of half a million image points take a tenth of the time. Where they are far apart, they are
    compared all the same.

    Parameters
    ----------
    keys : (n,) each; the last one sorts first, equal rows keep their order.
    """
    # Loads more than most processes that check arrays need.
    from scipy.sparse import csr_array

    n = len(keys[0])
    order: Ints = np.arange(n)
    for key in keys:
        own, count = key[order], int(key.max(initial=-1)) + 1
        if count > _SPARSE * n:
            order = order[np.argsort(own, kind="stable")]
        else:
            # One entry in each row: by columns, they are in the order of their numbers.
            rows = csr_array((np.ones(n, dtype=np.int8), own, np.arange(n + 1)), shape=(n, count))
            order = order[rows.tocsc().indices]
    return order


def as_sigmas(sigma: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Standard deviations of this shape from what broadcasts to it.

    Raises
    ------
    InconsistentBlockError : if it does not.
    """
    given = np.asarray(sigma, dtype=np.float64)
    try:
        return np.broadcast_to(given, shape).copy()
    except ValueError as error:
        raise InconsistentBlockError(
            f"The standard deviations have the shape {given.shape}; expected: one, or {shape}."
        ) from error
