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
