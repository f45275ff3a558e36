"""Whether values form two clusters, without knowing which of them belong together.

Among all divisions of n normally distributed values into two groups, that with the largest t between their
means cuts the sorted values once. There are 2^(n−1) − 1 divisions, so the probability of a t as large in any
of them is at most that many times that of a single one (Bonferroni). What passes has a clear gap.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats

# One value by itself is an outlier, not a cluster.
_LEAST = 2


def split_in_two(values: Floats, probability: float) -> Bools | None:
    """The smaller cluster (n,) of values (n,); None if there is one only.

    Parameters
    ----------
    probability : of dividing values that belong together, at most.
    """
    count = len(values)
    if count < 2 * _LEAST + 1:
        return None
    order = np.argsort(values, kind="stable")
    best, size = -1.0, 0
    for below in range(_LEAST, count - _LEAST + 1):
        t = _t(values[order[:below]], values[order[below:]])
        if t > best:
            best, size = t, below
    # In logarithms: of a hundred values there are 2^99 divisions.
    with np.errstate(divide="ignore"):
        log_chance = np.log(special.stdtr(count - 2, -best)) + count * np.log(2.0)
    if log_chance >= np.log(probability):
        return None
    cluster = np.zeros(count, dtype=bool)
    cluster[order[:size] if 2 * size <= count else order[size:]] = True
    return cluster


def _t(one: Floats, other: Floats) -> float:
    """Student's t between two groups; without any scatter infinite if they differ, but for rounding."""
    n, m = len(one), len(other)
    difference = abs(float(one.mean() - other.mean()))
    variance = (n * one.var() + m * other.var()) / (n + m - 2)
    rounding = 1e-12 * max(float(np.abs(one).max()), float(np.abs(other).max()))
    if variance <= rounding**2:
        return np.inf if difference > rounding else 0.0
    return difference / float(np.sqrt(variance * (1.0 / n + 1.0 / m)))
