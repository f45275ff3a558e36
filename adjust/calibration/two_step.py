"""Two-step calibration: boresight and offset of GNSS from adjusted minus observed orientations.

First the block is adjusted without the GNSS/INS in question, then the differences of orientation are
averaged. What the first step cannot know (correlations between the orientations of neighbouring images,
errors of the interior orientation that the orientations have taken up) the second cannot either: standard
deviations come from the scatter of the strips. A lever arm is fixed in the aircraft, a shift of GNSS in the
map: the axes in which the offset scatters less tell which of the two is there, if the block was flown in
more than one direction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import stats

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.orientation_differences import LEVER_ARM, MISALIGNMENT, SHIFT, OrientationDifferences
from adjust.calibration.outlying_strips import MountingRule, OutlyingStrips, outlying_strips
from adjust.calibration.robust_mean import RobustMean, robust_mean
from adjust.calibration.strip_means import StripMeans, strip_means

Scope = Literal["all", "mounting", "flight", "heading", "height"]
Axes = Literal["body", "map", "undecided"]
# Probability of calling axes better that are not.
_AXES_PROBABILITY = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class GroupMean:
    """Mean of a group of exposures.

    Attributes
    ----------
    scope : what makes the group.
    number : of the mounting, flight, direction or height; 0 for ``all``.
    images, strips : how many.
    heading, height : (strips' mean direction in radians, median height in metres).
    mean : nine components: see `COMPONENTS`.
    between : (9,) standard deviation of the means of its strips; NaN with one strip.
    """

    scope: Scope
    number: int
    images: int
    strips: int
    heading: float
    height: float
    mean: RobustMean
    between: Floats


@dataclass(frozen=True, slots=True)
class AxesChoice:
    """In which axes the offset is fixed.

    Attributes
    ----------
    axes : those with the significantly smaller scatter in plan; else ``undecided``.
    rms_body, rms_map : metres, plan, of one exposure about the robust mean.
    probability : of a ratio of the strips' scatters as large by chance (F-test); NaN with too few strips.
    directions : number of flight directions; with one the two cannot be told apart.
    """

    axes: Axes
    rms_body: float
    rms_map: float
    probability: float
    directions: int


@dataclass(frozen=True, slots=True, eq=False)
class TwoStep:
    """Result of a two-step calibration.

    Attributes
    ----------
    strips : the strips.
    outlying : what was found about them: misalignment, and the offset in ``tested_axes``.
    tested_axes : the axes in which most strips agree better.
    axes : in which axes the offset is fixed.
    groups : means: ``all`` exposures first, then of mountings, and of the flights, directions and heights of
        the main mounting.
    weight : (n, 9) factors of the exposures in the robust mean of their mounting.
    """

    strips: StripMeans
    outlying: OutlyingStrips
    tested_axes: Literal["body", "map"]
    axes: AxesChoice
    groups: tuple[GroupMean, ...]
    weight: Floats

    @property
    def main(self) -> GroupMean:
        """The result: exposures of the mounting that most strips have."""
        return next(group for group in self.groups if group.scope == "mounting" and group.number == 0)


def two_step_calibration(differences: OrientationDifferences, rule: MountingRule | None = None) -> TwoStep:
    """Misalignment, lever arm and shift, with what contradicts one value for all.

    Parameters
    ----------
    rule : what counts as another mounting; None: the defaults.
    """
    strips = strip_means(differences)
    # Strips are compared in the axes in which most of them agree, whatever the others say.
    in_body, in_map = strips.mean[:, LEVER_ARM], strips.mean[:, SHIFT]
    in_map_better = _robust_spread(in_map[:, :2]) < _robust_spread(in_body[:, :2])
    stable = in_map if in_map_better else in_body
    outlying = outlying_strips(np.hstack([strips.mean[:, MISALIGNMENT], stable]), rule or MountingRule())
    row = np.searchsorted(strips.strip, differences.strip)
    mounting = outlying.mounting[row]
    main = mounting == 0
    groups = [_group("all", 0, differences, strips, np.ones(len(row), dtype=bool))]
    groups += [
        _group("mounting", int(number), differences, strips, mounting == number)
        for number in np.unique(mounting)
    ]
    for scope, numbers in _scopes(differences, strips, row):
        groups += [
            _group(scope, int(number), differences, strips, main & (numbers == number))
            for number in np.unique(numbers[main])
        ]
    weight = np.ones((len(row), 9))
    for group in groups:
        if group.scope == "mounting":
            weight[mounting == group.number] = group.mean.weight
    tested: Literal["body", "map"] = "map" if in_map_better else "body"
    return TwoStep(strips, outlying, tested, _axes(strips, groups, outlying), tuple(groups), weight)


def _scopes(
    differences: OrientationDifferences, strips: StripMeans, row: Ints
) -> tuple[tuple[Scope, Ints], ...]:
    return (
        ("flight", differences.flight),
        ("heading", strips.heading_group[row]),
        ("height", strips.height_group[row]),
    )


def _group(
    scope: Scope, number: int, differences: OrientationDifferences, strips: StripMeans, chosen: Bools
) -> GroupMean:
    own = differences.only(chosen)
    rows = np.isin(strips.strip, own.strip)
    mean = strips.mean[rows]
    direction = np.arctan2(np.sin(own.heading).mean(), np.cos(own.heading).mean())
    return GroupMean(
        scope,
        number,
        len(own.strip),
        int(rows.sum()),
        float(direction),
        float(np.median(own.height)),
        robust_mean(own.components, own.strip, _separate(own.covariance)),
        mean.std(axis=0, ddof=1) if len(mean) > 1 else np.full(mean.shape[1], np.nan),
    )


def _separate(covariance: Floats | None) -> Floats | None:
    """Covariances (n, 9, 9) without those of the shift with the rest.

    Lever arm and shift are two views of the same differences: averaged together they would count twice.
    """
    if covariance is None:
        return None
    separate = covariance.copy()
    separate[:, SHIFT, : SHIFT.start] = 0.0
    separate[:, : SHIFT.start, SHIFT] = 0.0
    return separate


def _robust_spread(mean: Floats) -> float:
    """Median distance in plan of strip means (k, 2) from their median."""
    return float(np.median(np.linalg.norm(mean - np.median(mean, axis=0), axis=1)))


def _axes(strips: StripMeans, groups: list[GroupMean], outlying: OutlyingStrips) -> AxesChoice:
    main = next(group for group in groups if group.scope == "mounting" and group.number == 0)
    rows = outlying.mounting == 0
    rms = main.mean.rms
    in_body, in_map = (float(np.hypot(*rms[part][:2])) for part in (LEVER_ARM, SHIFT))
    directions = len(np.unique(strips.heading_group[rows]))
    if directions < 2 or rows.sum() < 3:
        return AxesChoice("undecided", in_body, in_map, float("nan"), directions)
    variances = [float(np.var(strips.mean[rows, part][:, :2], axis=0).sum()) for part in (LEVER_ARM, SHIFT)]
    smaller, larger = min(variances), max(variances)
    freedom = 2 * (int(rows.sum()) - 1)
    ratio = larger / smaller if smaller > 0.0 else np.inf
    probability = 2.0 * float(stats.f.sf(ratio, freedom, freedom))
    better: Axes = "body" if variances[0] <= variances[1] else "map"
    return AxesChoice(
        better if probability < _AXES_PROBABILITY else "undecided",
        in_body, in_map, min(probability, 1.0), directions,
    )  # fmt: skip
