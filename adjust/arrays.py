"""Names of the array types used in signatures, and checks of arrays that callers hand over.

Shapes and units are in the docstrings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adjust.errors import InconsistentBlockError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


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
