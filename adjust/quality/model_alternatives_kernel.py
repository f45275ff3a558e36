"""Sums of products of derivatives and columns of alternatives, compiled."""

from adjust.compiled import kernel


@kernel
def add_products(index, jacobian, columns, numbers, result):
    """Add Aᵀ C of n observations to the unknowns they touch.

    index (n,) which; jacobian (n, m, d); columns (k, n, m) with their numbers (k,) in result
    (count, d, ·), which is changed.
    """
    n, m, d = jacobian.shape
    for i in range(n):
        touched = index[i]
        for c in range(m):
            for j in range(d):
                derivative = jacobian[i, c, j]
                if derivative != 0.0:
                    for t in range(columns.shape[0]):
                        result[touched, j, numbers[t]] += derivative * columns[t, i, c]
