"""Sums of products of many cells side by side, compiled.

Cells with the same images are worked on together: a quantity of each of them is a *row* of ``LANES`` numbers
of a flat array, one for each cell, so that the processor works on several cells at once. A row is named by
its array and its first place there. A loop writes to rows of one array that are a known distance apart:
otherwise the compiler would have to find out at run time that they do not overlap. Places are unsigned, so
that none is tested for being negative.
"""

import numpy as np

from adjust.compiled import small_kernel

#: Cells side by side, and the number of which those in use are a multiple.
LANES, STEP = 32, 8


@small_kernel
def clear(out, o, count):
    """Zeros in so many places."""
    for n in range(count):
        out[np.uintp(o + n)] = 0.0


@small_kernel
def add_weighted(out, o, weight, x, at, m):
    """Add a number times a row."""
    for n in range(m):
        out[np.uintp(o + n)] += weight * x[np.uintp(at + n)]


@small_kernel
def add_product(out, o, x, i, y, j, m):
    """Add a row times a row."""
    for n in range(m):
        out[np.uintp(o + n)] += x[np.uintp(i + n)] * y[np.uintp(j + n)]


@small_kernel
def six_rows(values, at):
    """Six rows that follow each other."""
    return (
        values[np.uintp(at)], values[np.uintp(at + LANES)], values[np.uintp(at + 2 * LANES)],
        values[np.uintp(at + 3 * LANES)], values[np.uintp(at + 4 * LANES)], values[np.uintp(at + 5 * LANES)],
    )  # fmt: skip


@small_kernel
def set_six_rows(out, o, a, b, c, d, e, f):
    """Fill six rows that follow each other."""
    out[np.uintp(o)], out[np.uintp(o + LANES)], out[np.uintp(o + 2 * LANES)] = a, b, c
    out[np.uintp(o + 3 * LANES)], out[np.uintp(o + 4 * LANES)], out[np.uintp(o + 5 * LANES)] = d, e, f


@small_kernel
def add_six_rows(out, o, a, b, c, d, e, f):
    """Add to six rows that follow each other."""
    out[np.uintp(o)] += a
    out[np.uintp(o + LANES)] += b
    out[np.uintp(o + 2 * LANES)] += c
    out[np.uintp(o + 3 * LANES)] += d
    out[np.uintp(o + 4 * LANES)] += e
    out[np.uintp(o + 5 * LANES)] += f
