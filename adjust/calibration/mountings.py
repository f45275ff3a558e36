"""Which strips were flown with one mounting of the camera, and which with another.

A camera is taken out and put back between flights, so flights are compared first: their boresights by the
t-test, their lever arms in plan by the F-test in addition to a GNSS shift of each flight (`strip_offsets`),
both with the scatter of the strips. Within a flight a mount can slip: the strips before and behind every
strip are compared alike. Flights may have no names: strips that fall apart into two clusters, whichever they
are, are divided (`clusters`). Single strips are found by the test of Rosner (1983). Each of the four has a
quarter of the error probability.

Where the errors of the adjusted orientations are known, what they explain is taken off before the searches,
and what is found must be significant with the joint covariance of all strips (`joint_strips`).

Significant is not enough. Between flights and clusters the difference must exceed what the calibration has to
keep, for less would not change what is certified. Before and behind a strip, and of single strips, it must
exceed what the stated errors of GNSS and INS let expect of a strip: they last as long as a strip and longer,
and look like a mounting. Heights never make a mounting: the height datum and the terrain hide in them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Literal, TypeAlias

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.clusters import split_in_two
from adjust.calibration.joint_strips import JointStrips
from adjust.calibration.orientation_differences import LEVER_ARM, MISALIGNMENT, SHIFT
from adjust.calibration.outlying_strips import LEAST_STRIPS, outlying_strips
from adjust.calibration.strip_comparison import StripComparison
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import body_fixed, linear_fit, map_fixed

TestedAxes: TypeAlias = Literal["body", "map"]

_ROUNDS = 5
# Of the fit that leaves the offsets of the strips, and its weights.
_FIT_ROUNDS = 50
_HUBER_LIMIT = 1.5
# Roll, pitch, yaw, and forward and right together.
_TESTS = 4
_SEARCHES = 4


@dataclass(frozen=True, slots=True, eq=False)
class MountingRule:
    """When strips are assigned to different mountings.

    Attributes
    ----------
    error_probability : of finding any other mounting when all strips have one.
    limits : (4,) roll, pitch, yaw in rad and plan in m: flights that differ by less have one mounting.
    strip_sigma : (4,) likewise: stated errors of INS and GNSS that are common to the exposures of a strip.
    """

    error_probability: float
    limits: Floats
    strip_sigma: Floats

    def beyond_chance(self, strips: int) -> Floats:
        """Limits (4,) that none of this number of strips exceeds, except with the error probability."""
        largest = special.ndtri(1.0 - self.error_probability / (2.0 * 5.0 * strips))
        return np.asarray(largest * self.strip_sigma)


@dataclass(frozen=True, slots=True, eq=False)
class Mountings:
    """The mountings of k strips.

    Attributes
    ----------
    tested : whether there were enough strips.
    outlying : (k, 6) misalignment and offset that stand out; the offset in `tested_axes`.
    tested_axes : the axes in which most strips agree better.
    mounting : (k,) 0 for the mounting of most strips, 1, 2, … for others.
    lever_arms_comparable : whether headings tell a lever arm of a flight from its GNSS shift; True with one.
    joint : all strips with these mountings; None where errors of the adjusted orientations are not known.
    """

    tested: bool
    outlying: Bools
    tested_axes: TestedAxes
    mounting: Ints
    lever_arms_comparable: bool
    joint: JointStrips | None = None


def found_mountings(strips: StripMeans, rule: MountingRule, errors: StripErrors | None = None) -> Mountings:
    """Find the mountings of the strips.

    Parameters
    ----------
    errors : of the adjusted orientations of the strips; None: not known.
    """
    if errors is None or len(strips.strip) < LEAST_STRIPS:
        return _searched(strips, rule)
    mounting = np.zeros(len(strips.strip), dtype=np.int64)
    for _ in range(_ROUNDS):
        joint = JointStrips.of(strips, mounting, errors, rule.strip_sigma)
        found = _searched(joint.less_explained(strips), rule)
        before, mounting = mounting, found.mounting
        if np.array_equal(before, mounting):
            break
    mounting, joint = _confirmed(strips, mounting, errors, rule)
    return replace(found, mounting=mounting, joint=joint)


def _confirmed(
    strips: StripMeans, mounting: Ints, errors: StripErrors, rule: MountingRule
) -> tuple[Ints, JointStrips]:
    """The mountings (k,) without those that do not differ from the main one, the most alike first."""
    each = rule.error_probability / (_SEARCHES * _TESTS)
    while True:
        joint = JointStrips.of(strips, mounting, errors, rule.strip_sigma)
        chances = [joint.differing(int(number), 0, rule.limits) for number in joint.mountings[1:]]
        if max(chances, default=0.0) < each:
            return mounting, joint
        alike = int(joint.mountings[1 + np.argmax(chances)])
        mounting = np.where(mounting == alike, 0, mounting - (mounting > alike))


def _searched(strips: StripMeans, rule: MountingRule) -> Mountings:
    """The mountings by the scatter of the strips."""
    axes = tested_axes(strips)
    count = len(strips.strip)
    single = np.zeros(count, dtype=bool)
    if count < LEAST_STRIPS:
        return Mountings(False, np.zeros((count, 6), dtype=bool), axes, np.zeros(count, dtype=np.int64), True)
    for _ in range(_ROUNDS):
        part = _parts(strips, single, rule)
        left = _left(strips, part, single, axes)
        outlying = outlying_strips(left, rule.error_probability / _SEARCHES)
        found = _of_themselves(left, outlying, rule)
        if np.array_equal(found, single):
            break
        single = found
    mounting = _numbered(part, single, _scaled(left, rule))
    flights = np.unique(strips.flight)
    comparison = StripComparison.of(strips, strips.flight)
    comparable = all(np.isfinite(comparison.probabilities(a, b)[-1]) for a, b in combinations(flights, 2))
    return Mountings(True, outlying, axes, mounting, comparable)


def _left(strips: StripMeans, part: Ints, single: Bools, axes: TestedAxes) -> Floats:
    """What strips (k, 6) show beyond the mounting of their part: misalignment, and offset along the axes."""
    angles = strips.mean[:, MISALIGNMENT]
    left = angles.copy()
    for number in np.unique(part):
        own = part == number
        left[own] -= angles[own & ~single].mean(axis=0) if (own & ~single).any() else angles.mean(axis=0)
    # About the mean of all, so that rounding is told from scatter.
    left += angles.mean(axis=0)
    return np.hstack([left, stable_offsets(strips, part, ~single, axes)])


def _of_themselves(left: Floats, outlying: Bools, rule: MountingRule) -> Bools:
    """Strips (k,) that stand out by more than their stated errors; see above about the height."""
    most = rule.beyond_chance(len(left))[[0, 1, 2, 3, 3]]
    deviation = left[:, :5] - np.median(left[:, :5], axis=0)
    return np.asarray(np.any(outlying[:, :5] & (np.abs(deviation) > most), axis=1))


def _scaled(left: Floats, rule: MountingRule) -> Floats:
    """Misalignment and plan (k, 5) in units of what two strips of one mounting may differ by."""
    return np.asarray(left[:, :5] / (np.sqrt(2.0) * rule.beyond_chance(len(left))[[0, 1, 2, 3, 3]]))


def _numbered(part: Ints, single: Bools, scaled: Floats) -> Ints:
    """Numbers (k,) of the mountings: that of most strips first, then in the order of the strips."""
    label = part.copy()
    label[single] = part.max() + 1 + _linked(scaled[single])
    names, counts = np.unique(label[~single], return_counts=True)
    main = names[np.argmax(counts)]
    others = dict.fromkeys(int(name) for name in label if name != main)
    number = {int(main): 0} | {name: place for place, name in enumerate(others, start=1)}
    return np.array([number[int(name)] for name in label], dtype=np.int64)


def _linked(points: Floats) -> Ints:
    """Clusters (n,) of points nearer than 1 to each other in every component, in order of appearance."""
    cluster = np.arange(len(points))
    near = np.all(np.abs(points[:, None] - points[None]) <= 1.0, axis=2)
    for _ in range(len(points)):
        # Each takes the smallest number among its neighbours, until nothing changes.
        following = np.where(near, cluster[None], len(points)).min(axis=1, initial=len(points))
        if np.array_equal(following, cluster):
            break
        cluster = following
    return np.unique(cluster, return_inverse=True)[1].astype(np.int64)


def _parts(strips: StripMeans, left_out: Bools, rule: MountingRule) -> Ints:
    """Groups (k,) of strips with one mounting: flights, cut where the mount has slipped, joined again."""
    kept = ~left_out
    part = strips.flight.astype(np.int64).copy()
    each = rule.error_probability / _SEARCHES
    while (cut := _cut(strips, part, kept, rule, each)) is not None:
        part[cut] = part.max() + 1
    part = _joined(strips, part, kept, rule, each)
    while (cluster := _cluster(strips, part, kept, rule, each)) is not None:
        part[cluster] = part.max() + 1
    return part


def _cluster(
    strips: StripMeans, part: Ints, kept: Bools, rule: MountingRule, probability: float
) -> Bools | None:
    """The strips (k,) of a part that are a cluster of their own, by roll, pitch, yaw, forward or right."""
    names = np.unique(part[kept])
    offset = stable_offsets(strips, part, kept, "body")[:, :2]
    values = np.hstack([strips.mean[:, MISALIGNMENT], offset])
    limits = rule.limits[[0, 1, 2, 3, 3]]
    for name in names:
        own = np.flatnonzero((part == name) & kept)
        for column, limit in zip(values.T, limits, strict=True):
            split = split_in_two(column[own], probability / (len(limits) * len(names)))
            if split is not None and abs(column[own][split].mean() - column[own][~split].mean()) > limit:
                found = np.zeros(len(part), dtype=bool)
                found[own[split]] = True
                return found
    return None


def _cut(strips: StripMeans, part: Ints, kept: Bools, rule: MountingRule, probability: float) -> Bools | None:
    """The strips (k,) behind the most significant cut of a part; None if there is none."""
    order = np.lexsort((strips.place, part))
    places = [place for place in pairwise(order[kept[order]]) if part[place[0]] == part[place[1]]]
    best, found = probability / max(_TESTS * len(places), 1), None
    limits = np.sqrt(2.0) * rule.beyond_chance(len(part))
    for _, following in places:
        behind = (part == part[following]) & (strips.place >= strips.place[following])
        divided = np.where(behind, part.max() + 1, part)
        comparison = StripComparison.of(strips, divided, kept)
        chance = comparison.differing(part[following], part.max() + 1, limits)
        if chance < best:
            best, found = chance, behind
    return found


def _joined(strips: StripMeans, part: Ints, kept: Bools, rule: MountingRule, probability: float) -> Ints:
    """The parts (k,) with those joined that do not differ, the most alike first."""
    part = part.copy()
    names = np.unique(part[kept])
    # A flight of which no strip is kept says nothing.
    part[~np.isin(part, names)] = names[0]
    each = probability / max(_TESTS * len(names) * (len(names) - 1) // 2, 1)
    in_flight = np.sqrt(2.0) * rule.beyond_chance(len(part))
    while len(names := np.unique(part[kept])) > 1:
        comparison = StripComparison.of(strips, part, kept)
        alike = []
        for one, other in combinations(names, 2):
            of_one, of_other = part == one, part == other
            several = min((of_one & kept).sum(), (of_other & kept).sum()) > 1
            within = bool(np.isin(strips.flight[of_one], strips.flight[of_other]).any())
            # A single strip has the errors of a strip, whatever flight it is of.
            limits = rule.limits if several and not within else in_flight
            chance = comparison.differing(one, other, limits)
            if chance >= each:
                alike.append((chance, one, other))
        if not alike:
            break
        _, one, other = max(alike, key=lambda item: item[0])
        part[part == other] = one
    return part


def tested_axes(strips: StripMeans) -> TestedAxes:
    """The axes in which most strips agree better, whatever the others say."""
    spreads = [_robust_spread(strips.mean[:, part][:, :2]) for part in (LEVER_ARM, SHIFT)]
    return "map" if spreads[1] < spreads[0] else "body"


def stable_offsets(strips: StripMeans, part: Ints, kept: Bools, axes: TestedAxes) -> Floats:
    """Offsets (k, 3) less what a shift of each flight and a lever arm of each mounting explain.

    They are along these axes, the vertical one last and as it is. With fewer strips than unknowns, what is
    subtracted is only the mean offset in these axes.

    Parameters
    ----------
    part : (k,) strips of one number have one lever arm.
    kept : (k,) the strips that say what is subtracted.
    """
    own = LEVER_ARM if axes == "body" else SHIFT
    vertical = strips.mean[:, own][:, 2:]
    count = len(part)
    design = np.hstack([map_fixed(strips.flight), body_fixed(strips.heading, part)])
    if design.shape[1] > count:
        in_axes = strips.mean[:, own][:, :2]
        return np.hstack([in_axes - in_axes[kept].mean(axis=0), vertical])
    left = _left_by(design, strips.mean[:, SHIFT][:, :2].ravel(), kept)
    if axes == "body":
        left = body_fixed(strips.heading, np.arange(count)).T @ left
    return np.hstack([left.reshape(-1, 2), vertical])


def _robust_spread(plan: Floats) -> float:
    """Median distance of strip means (k, 2) from their median."""
    return float(np.median(np.linalg.norm(plan - np.median(plan, axis=0), axis=1)))


def _left_by(design: Floats, offset: Floats, kept: Bools) -> Floats:
    """Residuals (2 k,) of a fit to the strips that are kept, with Huber's weights."""
    weight = kept.astype(np.float64)
    left = offset
    for _ in range(_FIT_ROUNDS):
        root = np.repeat(np.sqrt(weight), 2)
        fitted = linear_fit(design * root[:, None], offset * root)
        before, left = left, offset - design @ fitted.solution
        distance = np.linalg.norm(left.reshape(-1, 2), axis=1)
        limit = _HUBER_LIMIT * max(float(np.median(distance[kept])), 1e-12)
        weight = kept * limit / np.maximum(distance, limit)
        if np.abs(left - before).max() < 1e-9:
            break
    return np.asarray(left)
