"""Strips that do not fit the others: the generalised extreme studentized deviate test (Rosner 1983).

It finds several outliers without their hiding one another and, if there are none, declares one with the
stated probability only. The critical values are Rosner's approximation: where 5 % is stated, one of 20 strips
in six components is called outlying in 5.9 % of the blocks, of 30 strips in 5.3 %.
"""

from __future__ import annotations

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats

#: Strips below which one outlier cannot be separated from the scatter.
LEAST_STRIPS = 5


def outlying_strips(mean: Floats, error_probability: float) -> Bools:
    """Components (k, m) of strip means that stand out; with the probability any does by chance."""
    each = error_probability / mean.shape[1]
    return np.column_stack([extreme_deviates(column, each) for column in mean.T])


def extreme_deviates(values: Floats, probability: float) -> Bools:
    """Outliers (n,) among values by the generalised extreme studentized deviate test (Rosner 1983).

    Up to (n − 1) // 2 values are taken away one by one, each time the one farthest from the mean of the rest;
    the outliers are all those up to the last whose deviate exceeds its critical value.
    """
    count = len(values)
    kept = np.ones(count, dtype=bool)
    removed: list[int] = []
    found = 0
    for number in range(1, (count - 1) // 2 + 1):
        spread = float(values[kept].std(ddof=1))
        deviate = np.where(kept, np.abs(values - values[kept].mean()), -1.0)
        farthest = int(np.argmax(deviate))
        # Equal but for rounding: nothing stands out of them.
        if spread <= 1e-12 * float(np.abs(values).max(initial=0.0)):
            break
        kept[farthest] = False
        removed.append(farthest)
        if deviate[farthest] / spread > _critical(count, number, probability):
            found = number
    outlying = np.zeros(count, dtype=bool)
    outlying[removed[:found]] = True
    return outlying


def _critical(count: int, number: int, probability: float) -> float:
    """Critical value λ_i of Rosner's test."""
    rest = count - number
    t = float(-special.stdtrit(rest - 1, probability / (2.0 * (rest + 1))))
    return rest * t / float(np.sqrt((rest - 1 + t * t) * (rest + 1)))
