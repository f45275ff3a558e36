"""Dense linear algebra in place, without copies and without the interpreter's lock.

scipy's own wrappers of LAPACK hold the lock while they compute, so that two fronts could never be
worked on at the same time, and they copy what they change. scipy also publishes the addresses of the
routines (``scipy.linalg.cython_blas``, ``cython_lapack``); called through ctypes they let go of the
lock. Matrices are in Fortran order; of triangular and symmetric ones only the lower triangle counts.
"""

from __future__ import annotations

import ctypes
from ctypes import POINTER, byref, c_char, c_double, c_int, c_void_p
from typing import Any

import numpy as np
from scipy.linalg import cython_blas, cython_lapack

from adjust.arrays import Floats

_SIZE = POINTER(c_int)
_FLAG = POINTER(c_char)
_NUMBER = POINTER(c_double)


def _routine(module: Any, name: str, *arguments: Any) -> Any:
    """A routine of BLAS or LAPACK as a function; all arguments are addresses."""
    address = ctypes.pythonapi.PyCapsule_GetPointer
    address.restype, address.argtypes = c_void_p, [ctypes.py_object, ctypes.c_char_p]
    name_of = ctypes.pythonapi.PyCapsule_GetName
    name_of.restype, name_of.argtypes = ctypes.c_char_p, [ctypes.py_object]
    capsule = module.__pyx_capi__[name]
    return ctypes.CFUNCTYPE(None, *arguments)(address(capsule, name_of(capsule)))


# Signatures: netlib.org, reference BLAS and LAPACK.
_DPOTRF = _routine(cython_lapack, "dpotrf", _FLAG, _SIZE, c_void_p, _SIZE, _SIZE)
_DPOTRI = _routine(cython_lapack, "dpotri", _FLAG, _SIZE, c_void_p, _SIZE, _SIZE)
_DTRSM = _routine(
    cython_blas, "dtrsm", _FLAG, _FLAG, _FLAG, _FLAG, _SIZE, _SIZE, _NUMBER, c_void_p, _SIZE, c_void_p, _SIZE
)  # fmt: skip
_DTRSV = _routine(cython_blas, "dtrsv", _FLAG, _FLAG, _FLAG, _SIZE, c_void_p, _SIZE, c_void_p, _SIZE)
_DSYRK = _routine(
    cython_blas, "dsyrk", _FLAG, _FLAG, _SIZE, _SIZE, _NUMBER, c_void_p, _SIZE, _NUMBER, c_void_p, _SIZE
)  # fmt: skip

_DSYMM = _routine(
    cython_blas, "dsymm", _FLAG, _FLAG, _SIZE, _SIZE, _NUMBER, c_void_p, _SIZE, c_void_p, _SIZE, _NUMBER,
    c_void_p, _SIZE,
)  # fmt: skip
_DGEMM = _routine(
    cython_blas, "dgemm", _FLAG, _FLAG, _SIZE, _SIZE, _SIZE, _NUMBER, c_void_p, _SIZE, c_void_p, _SIZE,
    _NUMBER, c_void_p, _SIZE,
)  # fmt: skip

# Triangles of more rows are solved with in halves.
_SOLVED_WHOLE = 64
_LOWER, _LEFT, _RIGHT = byref(c_char(b"L")), byref(c_char(b"L")), byref(c_char(b"R"))
_PLAIN, _TRANSPOSED, _NOT_UNIT = byref(c_char(b"N")), byref(c_char(b"T")), byref(c_char(b"N"))
_ZERO, _ONE, _MINUS_ONE, _NEXT = (
    byref(c_double(0.0)), byref(c_double(1.0)), byref(c_double(-1.0)), byref(c_int(1)),
)  # fmt: skip


def factorize_columns(columns: Floats) -> bool:
    """Eliminate the unknowns of the first columns of a symmetric matrix, in place.

    Parameters
    ----------
    columns : (p + q, p) the first p columns [F11; F21]; on return [L; M] with F11 = L Lᵀ, M = F21 L⁻ᵀ.
        Above the diagonal of L stands what stood there.

    Returns
    -------
    positive : False if F11 is not positive definite.
    """
    size, p = columns.shape
    if p == 0:
        return True
    info, order, rest, step = c_int(), c_int(p), c_int(size - p), _step(columns)
    start = columns.ctypes.data
    _DPOTRF(_LOWER, byref(order), start, step, byref(info))
    if info.value != 0:
        return False
    if size > p:
        _DTRSM(
            _RIGHT, _LOWER, _TRANSPOSED, _NOT_UNIT, byref(rest), byref(order), _ONE,
            start, step, start + p * columns.itemsize, step,
        )  # fmt: skip
    return True


def subtract_square(rest: Floats, below: Floats, fresh: bool = False) -> None:
    """F22 −= M Mᵀ in the lower triangle, in place; rest (q, q), below (q, p).

    Parameters
    ----------
    fresh : F22 counts as zero, whatever stands there.
    """
    q, p = below.shape
    if p and q:
        _DSYRK(
            _LOWER, _PLAIN, byref(c_int(q)), byref(c_int(p)), _MINUS_ONE, below.ctypes.data, _step(below),
            _ZERO if fresh else _ONE, rest.ctypes.data, _step(rest),
        )  # fmt: skip
    elif fresh:
        rest[:] = 0.0


def times_inverse(below: Floats, lower: Floats) -> Floats:
    """M L⁻¹, (q, p), for M (q, p) and L (p, p)."""
    result = np.array(below, order="F")
    q, p = result.shape
    if p and q:
        _DTRSM(
            _RIGHT, _LOWER, _PLAIN, _NOT_UNIT, byref(c_int(q)), byref(c_int(p)), _ONE,
            lower.ctypes.data, _step(lower), result.ctypes.data, _step(result),
        )  # fmt: skip
    return result


def invert_square(lower: Floats, result: Floats) -> None:
    """Result = (L Lᵀ)⁻¹, lower triangle, both (p, p); above the diagonal stands anything.

    Raises
    ------
    LinAlgError : if a diagonal element of L is zero.
    """
    result[:] = lower
    info, order = c_int(), c_int(len(result))
    if len(result):
        _DPOTRI(_LOWER, byref(order), result.ctypes.data, _step(result), byref(info))
    if info.value != 0:
        raise np.linalg.LinAlgError("a front of the normal equations cannot be inverted")


def negative_product(symmetric: Floats, factor: Floats, result: Floats) -> None:
    """Result = −S G for a symmetric S (q, q) and G (q, p)."""
    q, p = factor.shape
    if p and q:
        _DSYMM(
            _LEFT, _LOWER, byref(c_int(q)), byref(c_int(p)), _MINUS_ONE, symmetric.ctypes.data,
            _step(symmetric), factor.ctypes.data, _step(factor), _ZERO, result.ctypes.data, _step(result),
        )  # fmt: skip


def subtract_product(square: Floats, left: Floats, right: Floats) -> None:
    """Square (p, p) −= leftᵀ right, in place; left and right (q, p)."""
    q, p = left.shape
    if p and q:
        _DGEMM(
            _TRANSPOSED, _PLAIN, byref(c_int(p)), byref(c_int(p)), byref(c_int(q)), _MINUS_ONE,
            left.ctypes.data, _step(left), right.ctypes.data, _step(right), _ONE, square.ctypes.data,
            _step(square),
        )  # fmt: skip


def solve_lower(lower: Floats, x: Floats) -> None:
    """X = L⁻¹ x in place; lower (p, p), x (p,) or (p, k) with contiguous rows."""
    if x.ndim > 1:
        _solve_many(lower, x, _TRANSPOSED)
        return
    _DTRSV(
        _LOWER, _PLAIN, _NOT_UNIT, byref(c_int(len(x))), lower.ctypes.data, _step(lower), x.ctypes.data, _NEXT
    )  # fmt: skip


def solve_lower_transposed(lower: Floats, x: Floats) -> None:
    """X = L⁻ᵀ x in place; lower (p, p), x (p,) or (p, k) with contiguous rows."""
    if x.ndim > 1:
        _solve_many(lower, x, _PLAIN)
        return
    _DTRSV(
        _LOWER, _TRANSPOSED, _NOT_UNIT, byref(c_int(len(x))), lower.ctypes.data, _step(lower), x.ctypes.data,
        _NEXT,
    )  # fmt: skip


def _solve_many(lower: Floats, x: Floats, side: Any) -> None:
    """xᵀ L⁻ᵀ (transposed) or xᵀ L⁻¹ in place: rows of x (p, k) are columns of its transpose.

    In halves, as long as these are large: products are several times as fast as solutions.
    """
    p, k = x.shape
    if p > _SOLVED_WHOLE:
        half = p // 2
        upper, below, rest = lower[:half, :half], lower[half:, :half], lower[half:, half:]
        first, last = x[:half], x[half:]
        if side is _TRANSPOSED:
            _solve_many(upper, first, side)
            subtract_rows(last, below, first)
            _solve_many(rest, last, side)
        else:
            _solve_many(rest, last, side)
            subtract_rows(first, below.T, last)
            _solve_many(upper, first, side)
    elif p and k:
        transposed = x.T
        _DTRSM(
            _RIGHT, _LOWER, side, _NOT_UNIT, byref(c_int(k)), byref(c_int(p)), _ONE, lower.ctypes.data,
            _step(lower), transposed.ctypes.data, _step(transposed),
        )  # fmt: skip


def subtract_rows(x: Floats, factor: Floats, y: Floats) -> None:
    """X −= B y in place, B (p, q) in either order; x (p,), y (q,) or (p, k), (q, k) with contiguous rows."""
    if x.ndim == 1:
        x -= factor @ y
    elif x.size and y.size:
        swapped = factor.strides[1] < factor.strides[0]
        plain = factor.T if swapped else factor
        _DGEMM(
            _PLAIN, _PLAIN if swapped else _TRANSPOSED, byref(c_int(x.shape[1])), byref(c_int(len(x))),
            byref(c_int(len(y))), _MINUS_ONE, y.ctypes.data, _step(y.T), plain.ctypes.data, _step(plain),
            _ONE, x.ctypes.data, _step(x.T),
        )  # fmt: skip


def _step(matrix: Floats) -> Any:
    """Distance of two columns in elements, for matrices whose columns are contiguous."""
    if matrix.shape[0] > 1 and matrix.strides[0] != matrix.itemsize:
        raise ValueError("the columns of the matrix are not contiguous")
    return byref(c_int(max(matrix.strides[1] // matrix.itemsize, matrix.shape[0], 1)))
