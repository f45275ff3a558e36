"""Sums of products of derivatives and columns of alternatives, compiled."""

import numpy as np

from adjust.compiled import kernel


@kernel
def add_products(index, jacobian, columns, numbers, result):
    """Add Aᵀ C of n observations to the unknowns they touch.

    index (n,) which; jacobian (n, m, d); columns (k, n, m) with their numbers (k,) in result
    (count, d, ·), which is changed.
    """
    n, m, d = jacobian.shape
    k = columns.shape[0]
    # Unsigned: a number that might be negative would be looked at for every product.
    place, mine = numbers.astype(np.uintp), np.empty((m, k))
    for i in range(n):
        for c in range(m):
            for t in range(k):
                mine[c, t] = columns[t, i, c]
        for j in range(d):
            sums = result[index[i], j]
            for c in range(m):
                derivative = jacobian[i, c, j]
                if derivative != 0.0:
                    for t in range(k):
                        sums[place[t]] += derivative * mine[c, t]
