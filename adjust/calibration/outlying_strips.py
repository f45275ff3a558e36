"""Strips that do not belong to the others: another mounting, or a strip with an error of its own.

The means of the strips are tested with the generalised extreme studentized deviate test (Rosner 1983), which
finds several outliers without their hiding one another and, if there are none, declares one with the stated
probability only. A strip that stands out is *of another mounting* if its misalignment or its lever arm in
plan also differs by more than GNSS and INS errors of a strip do; else it is *outlying*. The vertical
component never makes a mounting: the height datum and the terrain hide in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from adjust.arrays import Bools, Floats, Ints

#: Strips below which one outlier cannot be told from the scatter.
LEAST_STRIPS = 5


@dataclass(frozen=True, slots=True)
class MountingRule:
    """What counts as another mounting.

    Attributes
    ----------
    error_probability : of calling any strip outlying when all belong together.
    offset : m; strips with offsets nearer than this to each other have one mounting. GNSS errors of a strip
        are a few centimetres.
    misalignment : rad; likewise. INS errors of a strip are some thousandths of a degree, of the heading
        a hundredth.
    """

    error_probability: float = 0.01
    offset: float = 0.10
    misalignment: float = float(np.deg2rad(0.03))


@dataclass(frozen=True, slots=True, eq=False)
class OutlyingStrips:
    """What the tests of k strips found.

    Attributes
    ----------
    tested : whether there were enough strips.
    outlying : (k, 6) components that stand out.
    mounting : (k,) 0 for the mounting of most strips, 1, 2, … for others.
    """

    tested: bool
    outlying: Bools
    mounting: Ints


def outlying_strips(mean: Floats, rule: MountingRule) -> OutlyingStrips:
    """Test the means of strips against each other.

    Parameters
    ----------
    mean : (k, 6) means of the strips: misalignment in radians, offset in metres, its vertical component last.
    """
    strips, m = mean.shape
    if strips < LEAST_STRIPS:
        return OutlyingStrips(False, np.zeros((strips, m), dtype=bool), np.zeros(strips, dtype=np.int64))
    each = rule.error_probability / m
    outlying = np.column_stack([extreme_deviates(column, each) for column in mean.T])
    # Misalignment and plan; see above about the vertical component.
    scaled = mean[:, :5] / np.array([rule.misalignment] * 3 + [rule.offset] * 2)
    centre = np.array([column[~out].mean() for column, out in zip(scaled.T, outlying[:, :5].T, strict=True)])
    other = np.any(outlying[:, :5] & (np.abs(scaled - centre) > 1.0), axis=1)
    mounting = np.zeros(strips, dtype=np.int64)
    mounting[other] = 1 + _linked(scaled[other])
    return OutlyingStrips(True, outlying, mounting)


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
    t = float(stats.t.isf(probability / (2.0 * (rest + 1)), rest - 1))
    return rest * t / float(np.sqrt((rest - 1 + t * t) * (rest + 1)))


def _linked(points: Floats) -> Ints:
    """Clusters (n,) of points nearer than 1 to each other in every component, in order of appearance."""
    cluster = np.arange(len(points))
    near = np.all(np.abs(points[:, None] - points[None]) <= 1.0, axis=2)
    for _ in range(len(points)):
        # Each takes the smallest number among its neighbours, until nothing changes.
        following = np.where(near, cluster[None], len(points)).min(axis=1)
        if np.array_equal(following, cluster):
            break
        cluster = following
    return np.unique(cluster, return_inverse=True)[1].astype(np.int64)
