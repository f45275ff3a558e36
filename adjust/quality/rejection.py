"""Rejection of gross errors by data snooping (Baarda 1968), largest first.

An observation is a candidate when it is controlled (redundancy number ≥ 0.1) and its standardized
residual exceeds the critical value. One gross error raises the residuals around it: in one pass
only the largest observation of each object point is rejected, and none below seven tenths of the
largest standardized residual of the block. The others are judged again when these are gone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.quality.redundancy import UNCONTROLLED, GroupResiduals
from adjust.solve.normal_equations import Observations

# Part of the largest |w| below which an observation may be swamped by another one's gross error.
_SWAMPED = 0.7


@dataclass(frozen=True, eq=False)
class Rejection:
    """What one pass takes out.

    Attributes
    ----------
    rejected : for each group (n,) true for its rejected observations.
    dropped : (k,) indices of image points taken out with them: the last ray of a point cannot
        determine it, and of two rays the wrong one cannot be told.
    """

    rejected: tuple[Bools, ...]
    dropped: Ints

    @property
    def count(self) -> int:
        """Number of rejected observations, dropped rays not counted."""
        return int(sum(int(mask.sum()) for mask in self.rejected))


def snooping_statistic(residuals: GroupResiduals) -> Floats:
    """Largest controlled |w| over the components of each observation (n,); 0 where none is controlled."""
    controlled = np.nan_to_num(residuals.redundancy) >= UNCONTROLLED
    size = np.where(controlled, np.abs(np.nan_to_num(residuals.standardized)), 0.0)
    largest: Floats = size.max(axis=1)
    return largest


def reject(
    observations: Observations, residuals: tuple[GroupResiduals, ...], critical_value: float
) -> Rejection:
    """The observations that one pass of data snooping rejects."""
    groups = observations.groups
    statistic = [snooping_statistic(item) for item in residuals]
    largest = max((float(item.max(initial=0.0)) for item in statistic), default=0.0)
    least = max(critical_value, _SWAMPED * largest)
    candidates = [
        (-float(statistic[g][i]), g, int(i))
        for g in range(len(groups))
        for i in np.flatnonzero(statistic[g] > least)
    ]
    rejected = tuple(np.zeros(len(group.image), dtype=bool) for group in groups)
    touched: set[tuple[str, int]] = set()
    for _, g, i in sorted(candidates):
        point, image = int(groups[g].point[i]), int(groups[g].image[i])
        own = [("point", point)] if point >= 0 else [("image", image)]
        if any(place in touched for place in (("point", point), ("image", image))):
            continue
        rejected[g][i] = True
        touched.update(own)
    return Rejection(rejected, _left_alone(observations, rejected))


def _left_alone(observations: Observations, rejected: tuple[Bools, ...]) -> Ints:
    """Rays of points that keep fewer than two rays and no survey after a rejection."""
    rays = observations.image_points
    active = rays.active & ~rejected[0]
    points = int(rays.point.max()) + 1 if len(rays.point) else 0
    support = 2.0 * np.bincount(rays.point, weights=active, minlength=points)
    for group, mask in zip(observations.others, rejected[1:], strict=True):
        touching = (group.point >= 0) & ~mask
        np.add.at(support, group.point[touching], group.stochastic.present[touching].sum(axis=1))
    return np.flatnonzero(active & (support[rays.point] < 3.0))
