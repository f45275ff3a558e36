"""Two-step calibration: boresight and offset of GNSS from adjusted minus observed orientations.

First the block is adjusted without the GNSS/INS in question, then the differences of orientation are
averaged. Standard deviations come from the scatter of the strips, with as many degrees of freedom as it has,
and from the errors of the adjustment that strips have in common (`adjusted_strips`), where these are known.
Of orientations of another program they are not: σ then lacks what does not show in the scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.mean_variance import mean_sigma, widening
from adjust.calibration.mountings import MountingRule, Mountings, found_mountings
from adjust.calibration.offset_separation import OffsetSeparation, separated_offset
from adjust.calibration.orientation_differences import LEVER_ARM, SHIFT, OrientationDifferences
from adjust.calibration.robust_mean import RobustMean, robust_mean
from adjust.calibration.strip_means import StripMeans, strip_means

Scope = Literal["all", "mounting", "flight", "heading", "height"]
# Fewer strips do not show how strips scatter.
_FEW_STRIPS = 5


@dataclass(frozen=True, slots=True, eq=False)
class GroupMean:
    """Mean of a group of exposures.

    Attributes
    ----------
    scope : what makes the group.
    number : of the mounting, flight, direction or height; 0 for ``all``.
    mounting : of its exposures; -1 for ``all``.
    images, strips : how many.
    heading, height : (strips' mean direction in radians, median height in metres).
    mean : nine components: see `COMPONENTS`.
    between : (9,) standard deviation of the means of its strips; NaN with one strip.
    sigma : (9,) of the robust mean, from scatter and adjustment; NaN with one exposure.
    freedom : (9,) its degrees of freedom: limits of confidence are Student's quantiles times σ.
    known : (9,) part of σ that comes from the adjustment; NaN: not known.
    """

    scope: Scope
    number: int
    mounting: int
    images: int
    strips: int
    heading: float
    height: float
    mean: RobustMean
    between: Floats
    sigma: Floats
    freedom: Floats
    known: Floats

    @property
    def widened(self) -> Floats:
        """(9,) σ by which limits of the normal distribution hold with the confidence they state (95 %)."""
        return self.sigma * widening(self.freedom)


@dataclass(frozen=True, slots=True, eq=False)
class TwoStep:
    """Result of a two-step calibration.

    Attributes
    ----------
    strips : the strips.
    mountings : with which mounting each was flown, and what stands out.
    offset : what the offset of the main mounting consists of.
    groups : means: ``all`` exposures first, then of mountings, of flights (each of the mounting that most of
        its strips have), and of the directions and heights of the main mounting.
    weight : (n, 9) factors of the exposures in the robust mean of their mounting.
    """

    strips: StripMeans
    mountings: Mountings
    offset: OffsetSeparation
    groups: tuple[GroupMean, ...]
    weight: Floats

    @property
    def main(self) -> GroupMean:
        """The result: exposures of the mounting that most strips have."""
        return next(group for group in self.groups if group.scope == "mounting" and group.number == 0)

    @property
    def others(self) -> tuple[GroupMean, ...]:
        """Means of the other mountings."""
        return tuple(group for group in self.groups if group.scope == "mounting" and group.number > 0)

    @property
    def rms_body(self) -> float:
        """Of the offsets of the main mounting in body axes, plan, about their robust mean, metres."""
        return float(np.hypot(*self.main.mean.rms[LEVER_ARM][:2]))

    @property
    def rms_map(self) -> float:
        """The same in map axes, less the given lever arm."""
        return float(np.hypot(*self.main.mean.rms[SHIFT][:2]))

    @property
    def directions(self) -> int:
        """Number of flight directions of the main mounting."""
        return len(np.unique(self.strips.heading_group[self.mountings.mounting == 0]))


def two_step_calibration(
    differences: OrientationDifferences, rule: MountingRule, errors: StripErrors | None = None
) -> TwoStep:
    """Misalignment, lever arm and shift, and the strips and flights that contradict a common value.

    Parameters
    ----------
    rule : what counts as another mounting.
    errors : of the adjusted orientations, of the strips in ascending order of their numbers; None: not known.
        Then exposures are weighted by their covariances; else alike, as the errors of strips are averages.
    """
    strips = strip_means(differences)
    mountings = found_mountings(strips, rule, errors)
    row = np.searchsorted(strips.strip, differences.strip)
    mounting = mountings.mounting[row]
    groups = [_group("all", 0, -1, differences, strips, errors, np.ones(len(row), dtype=bool))]
    groups += [
        _group("mounting", int(number), int(number), differences, strips, errors, mounting == number)
        for number in np.unique(mounting)
    ]
    for flight in np.unique(differences.flight):
        common = int(np.argmax(np.bincount(mountings.mounting[strips.flight == flight])))
        chosen = (differences.flight == flight) & (mounting == common)
        groups.append(_group("flight", int(flight), common, differences, strips, errors, chosen))
    of_main: tuple[tuple[Scope, Ints], ...] = (
        ("heading", strips.heading_group[row]),
        ("height", strips.height_group[row]),
    )
    for scope, numbers in of_main:
        groups += [
            _group(scope, int(number), 0, differences, strips, errors, (mounting == 0) & (numbers == number))
            for number in np.unique(numbers[mounting == 0])
        ]
    weight = np.ones((len(row), 9))
    for group in groups:
        if group.scope == "mounting":
            weight[mounting == group.number] = group.mean.weight
    return TwoStep(
        strips,
        mountings,
        separated_offset(strips, mountings.mounting, rule.error_probability, errors),
        tuple(_with_scatter(group, groups) for group in groups),
        weight,
    )


def _group(
    scope: Scope,
    number: int,
    mounting: int,
    differences: OrientationDifferences,
    strips: StripMeans,
    errors: StripErrors | None,
    chosen: Bools,
) -> GroupMean:
    own = differences.only(chosen)
    rows = np.isin(strips.strip, own.strip)
    strip_mean = strips.mean[rows]
    weighted = _separate(own.covariance) if errors is None else None
    mean = robust_mean(own.components, own.strip, weighted)
    sigma, freedom, known = _sigmas(mean, own.strip, strip_mean, strips.heading[rows], errors, rows)
    direction = np.arctan2(np.sin(own.heading).mean(), np.cos(own.heading).mean())
    return GroupMean(
        scope,
        number,
        mounting,
        len(own.strip),
        int(rows.sum()),
        float(direction),
        float(np.median(own.height)),
        mean,
        strip_mean.std(axis=0, ddof=1) if len(strip_mean) > 1 else np.full(strip_mean.shape[1], np.nan),
        sigma,
        freedom,
        known,
    )


def _sigmas(
    mean: RobustMean,
    strip: Ints,
    strip_mean: Floats,
    heading: Floats,
    errors: StripErrors | None,
    rows: Bools,
) -> tuple[Floats, Floats, Floats]:
    """σ, degrees of freedom, and the part of σ by the adjustment, (9,) each, of the mean of k strips."""
    k, m = strip_mean.shape
    # Of one strip its exposures are all there is: σ holds within that strip.
    by_scatter = np.full(m, float(max(k - 1 if k > 1 else len(strip) - 1, 1)))
    if errors is None:
        return mean.robust_sigma, by_scatter, np.full(m, np.nan)
    covariance = errors.only(rows).of_components(heading)
    if k == 1:
        known = np.sqrt(np.maximum(covariance[:, 0, 0], 0.0))
        return np.hypot(mean.robust_sigma, known), by_scatter, known
    count = np.unique(strip, return_counts=True)[1]
    found = [mean_sigma(strip_mean[:, c], covariance[c], count) for c in range(m)]
    values = np.array([(item.sigma, item.freedom, item.known) for item in found])
    return values[:, 0], values[:, 1], values[:, 2]


def _with_scatter(group: GroupMean, groups: list[GroupMean]) -> GroupMean:
    """A group of a few strips with the scatter of those of the main mounting: its own hides in one."""
    main = next(one for one in groups if one.scope == "mounting" and one.number == 0)
    by_chance = group.scope in ("mounting", "flight") and group.strips < _FEW_STRIPS
    if not by_chance or main.strips < _FEW_STRIPS:
        return group
    scatter = main.between.copy()
    # In the other axes the headings of the flight are part of it.
    in_plan = min(np.linalg.norm(scatter[3:5]), np.linalg.norm(scatter[6:8])) / np.sqrt(2.0)
    scatter[3:5] = scatter[6:8] = in_plan
    of_strips = np.hypot(scatter / np.sqrt(group.strips), np.nan_to_num(group.known))
    larger = ~(group.sigma >= of_strips)
    return replace(
        group,
        sigma=np.where(larger, of_strips, group.sigma),
        freedom=np.where(larger, main.strips - 1.0, group.freedom),
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
