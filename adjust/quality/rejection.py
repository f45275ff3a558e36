"""Which observations one pass of data snooping rejects (Baarda 1968), largest first.

An observation is a candidate when its test statistic exceeds the critical value; only what is
controlled (without correlations: redundancy number ≥ 0.1) is tested. One gross error raises the residuals
around it: in one pass only the largest observation of each object point is rejected, no two neighbours of a
strip whose errors are correlated, and none below seven tenths of the largest statistic around it: that of its
image, and of all observations that are no image points. The others are judged again when these are gone. An
object point is given up when it is left with too little to determine it, or when it cannot be determined
which of its rays is wrong; with four rays or more only the two most likely are rejected, and the good one of
them fits again in the end. A survey that most rays of its point contradict is rejected in their place.
A control point from which another one cannot be told is not rejected.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.base import JoinsPoints, ObservationGroup
from adjust.observations.direct import DirectObservations
from adjust.observations.image_point import ImagePoints
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import OBJECT_POINT, State
from adjust.quality.control_locatability import Doubtful, doubtful_control
from adjust.quality.detectability import UNCONTROLLED
from adjust.quality.locatability import Explanations, explanations
from adjust.quality.redundancy import GroupResiduals
from adjust.quality.residual_kernel import largest_controlled
from adjust.quality.single_error import equations_at, single_errors
from adjust.quality.snooping_statistic import (
    EstimatedVariance,
    directional_statistic,
    normal_equivalent,
    of_present,
    whitened_residuals,
)
from adjust.solve.system import Observations
from adjust.solve.whitening import whiten

Test = Literal["components", "observations"]
ReferenceVariance = Literal["a_priori", "a_posteriori"]

# Part of the largest |w| below which an observation may be swamped by another one's gross error; and where
# that one is an image point of another image.
_SWAMPED, _SWAMPED_FAR = 0.7, 0.2
# Statistics whose ratio is above this are equal but for rounding and what linear equations leave out.
_EQUAL = 0.9999
# With so many rays an object point can spare the two of which one is wrong; the good one comes back later.
_ENOUGH_RAYS = 4


@dataclass(frozen=True)
class SnoopingRule:
    """How observations are tested.

    Attributes
    ----------
    critical_value : two-sided, of a standard normal variable.
    test : "components": largest |w| of the components of an observation; "observations": all of them
        together, with two degrees of freedom for image points and three for control points.
    reference_variance : "a_priori": σ0 is 1; "a_posteriori": it is unknown (τ-test).
    """

    critical_value: float
    test: Test = "components"
    reference_variance: ReferenceVariance = "a_priori"


@dataclass(frozen=True, eq=False)
class Rejection:
    """What one pass takes out.

    Attributes
    ----------
    rejected : for each group (n,) true for its rejected observations.
    given_up : (m,) object points taken out with all that belongs to them.
    inseparable : indices of control points one of which is wrong, and it cannot be determined which.
    """

    rejected: tuple[Bools, ...]
    given_up: Bools
    inseparable: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def nothing(cls, observations: Observations, points: int) -> Rejection:
        """No observation, and none of a number of object points."""
        rejected = tuple(np.zeros(len(group.event), dtype=bool) for group in observations.groups)
        return cls(rejected, np.zeros(points, dtype=bool))

    @property
    def count(self) -> int:
        """Number of rejected observations, what is given up with them not counted."""
        return int(sum(int(mask.sum()) for mask in self.rejected))


def estimated_variance(adjusted: Adjusted, rule: SnoopingRule) -> EstimatedVariance | None:
    """σ0² from the residuals where it is not trusted."""
    if rule.reference_variance == "a_priori":
        return None
    return EstimatedVariance(adjusted.weighted_squares, adjusted.redundancy)


def snooping_statistics(adjusted: Adjusted, rule: SnoopingRule) -> tuple[Floats, ...]:
    """Test statistic (n,) of every observation of every group, as |w|; 0 for what is not controlled."""
    variance = estimated_variance(adjusted, rule)
    if rule.test == "components":
        return tuple(_of_components(item, variance) for item in adjusted.residuals)
    rays, of_rays = adjusted.observations.image_points, adjusted.residuals[0]
    pulls = [whitened_residuals(rays.stochastic, of_rays.residual)]
    remainder = np.eye(2) - _hat_of_rays(adjusted.quality.hat_of_rays)
    if adjusted.quality.considered is not None:
        remainder += adjusted.quality.considered.covariance_of_rays(rays)
    remainders = [remainder]
    for group in adjusted.observations.others:
        equations = equations_at(group, adjusted.state, adjusted.solution.linearization)
        found = single_errors(group, equations, adjusted.system.layout, adjusted.quality)
        pulls.append(found.pull)
        remainders.append(found.inside + found.considered)
    results = []
    for group, item, pull, remainder in zip(
        adjusted.observations.groups, adjusted.residuals, pulls, remainders, strict=True
    ):
        if not could_be_gross(group):  # of any number of parameters
            results.append(_of_components(item, variance))
            continue
        statistic, dimension = directional_statistic(pull, of_present(group.stochastic, remainder))
        results.append(normal_equivalent(statistic, dimension, variance))
    return tuple(results)


def _of_components(residuals: GroupResiduals, variance: EstimatedVariance | None) -> Floats:
    """Largest controlled |w| over the components of each observation (n,)."""
    largest: Floats = largest_controlled(residuals.control, residuals.standardized, UNCONTROLLED)
    if variance is None:
        return largest
    return normal_equivalent(largest**2, (largest > 0.0).astype(np.int64), variance)


def _hat_of_rays(elements: Floats) -> Floats:
    """Hat matrices (n, 2, 2) from their elements (n, 3) xx, xy, yy."""
    return elements[:, [0, 1, 1, 2]].reshape(-1, 2, 2)


def reject(adjusted: Adjusted, rule: SnoopingRule) -> Rejection:
    """The observations that one pass of data snooping rejects."""
    statistics = snooping_statistics(adjusted, rule)
    least = _least(adjusted.observations, statistics, rule.critical_value)
    swamped = _SWAMPED * max(float(item.max(initial=0.0)) for item in statistics)
    doubtful = doubtful_control(adjusted, rule.critical_value, swamped)
    if doubtful is not None and doubtful.size > 0.0:
        # What such an error swamps would be rejected for it, and with it what says that there is one.
        least = tuple(np.maximum(item, _SWAMPED * doubtful.size) for item in least)
        statistics[doubtful.number][doubtful.rows] = 0.0
    chosen = choose(adjusted.observations, adjusted.state, statistics, least)
    return located(adjusted, chosen, rule, doubtful)


def located(
    adjusted: Adjusted, chosen: Rejection, rule: SnoopingRule, known: Doubtful | None = None
) -> Rejection:
    """A rejection without the control points of which it cannot be determined which one is wrong."""
    doubtful = doubtful_control(adjusted, rule.critical_value, chosen=chosen.rejected)
    if doubtful is None:
        return chosen
    rejected, given_up = list(chosen.rejected), chosen.given_up.copy()
    rejected[doubtful.number] = rejected[doubtful.number] & ~doubtful.rows
    given_up[adjusted.observations.groups[doubtful.number].point[doubtful.rows]] = False
    points = doubtful.points if known is None else np.union1d(known.points, doubtful.points)
    return Rejection(tuple(rejected), given_up, points)


def _least(
    observations: Observations, statistics: tuple[Floats, ...], critical_value: float
) -> tuple[Floats, ...]:
    """What the statistic of every observation (n,) of every group has to exceed to be rejected in this pass.

    A wrong image point raises the statistics of its image; elsewhere it shows by a small part only. Of the
    other observations, each of which holds many images, the largest counts everywhere; what is known
    beforehand of a parameter counts for image points like one of another image.
    """
    of_rays, image = statistics[0], observations.image_points.image
    largest_of = [float(item.max(initial=0.0)) for item in statistics]
    largest = max(largest_of)
    of_others = (
        value
        for group, value in zip(observations.others, largest_of[1:], strict=True)
        if could_be_gross(group)
    )
    # Nothing takes away what is known beforehand, so what it swamps would hide gross errors for good.
    everywhere = max(critical_value, _SWAMPED * max(of_others, default=0.0), _SWAMPED_FAR * largest)
    of_image, large = np.zeros(1 + int(image.max(initial=0))), of_rays > everywhere  # no others matter
    np.maximum.at(of_image, image[large], of_rays[large])
    least_of_others = max(critical_value, _SWAMPED * largest)
    return (
        np.maximum(everywhere, _SWAMPED * of_image[image]),
        *(np.full(len(item), least_of_others) for item in statistics[1:]),
    )


def could_be_gross(group: ObservationGroup) -> bool:
    """Whether observations of a group may be rejected.

    What is known beforehand of a parameter is not an observation that could be gross: it contradicts, or not.
    """
    return not isinstance(group, DirectObservations | JointPrior)


def contradicting_priors(adjusted: Adjusted, rule: SnoopingRule) -> tuple[Bools, ...]:
    """For each group (n,) what is known beforehand of parameters and contradicts the block."""
    variance = estimated_variance(adjusted, rule)
    return tuple(
        np.zeros(len(group.event), dtype=bool)
        if could_be_gross(group)
        else _of_components(item, variance) > rule.critical_value
        for group, item in zip(adjusted.observations.groups, adjusted.residuals, strict=True)
    )


def choose(
    observations: Observations, state: State, statistics: tuple[Floats, ...], least: tuple[Floats, ...]
) -> Rejection:
    """The largest observation of every object point and event whose statistic exceeds a value of its own."""
    groups = observations.groups
    candidates = [
        (-float(statistics[g][i]), g, int(i))
        for g, group in enumerate(groups)
        if could_be_gross(group)
        for i in np.flatnonzero(statistics[g] > least[g])
    ]
    rejected = tuple(np.zeros(len(group.event), dtype=bool) for group in groups)
    touched: set[tuple[str, int]] = set()
    for _, g, i in _first_of_equals(sorted(candidates), groups):
        point, event = int(groups[g].point[i]), int(groups[g].event[i])
        own = [("point", point)] if point >= 0 else [("event", event)]
        if any(place in touched for place in (("point", point), ("event", event))):
            continue
        rejected[g][i] = True
        touched.update(own, _beside(groups[g], i))
    chosen = np.unique(observations.image_points.point[rejected[0]])
    unclear = _not_located(observations, state, chosen)
    for suspects in unclear.values():
        if len(suspects.ray) >= _ENOUGH_RAYS:
            rejected[0][suspects.likeliest(2)] = True
    _survey_for_most_rays(observations, rejected)
    given_up = _undetermined(observations, rejected, len(state.object_point))
    given_up[[point for point, suspects in unclear.items() if len(suspects.ray) < _ENOUGH_RAYS]] = True
    return Rejection(rejected, given_up)


def _first_of_equals(
    candidates: list[tuple[float, int, int]], groups: tuple[ObservationGroup, ...]
) -> Iterator[tuple[float, int, int]]:
    """The same in the same order, but of the rays of a point that are equally suspicious the first one first.

    Two rays have one residual between them: without this, rounding would say which of them is wrong.
    """
    of_point: dict[int, list[tuple[float, int, int]]] = {}
    for item in candidates:
        if item[1] == 0:
            of_point.setdefault(int(groups[0].point[item[2]]), []).append(item)
    for item in candidates:
        if item[1] == 0:
            equals = of_point[int(groups[0].point[item[2]])]
            yield min(
                (one for one in equals if item[0] / _EQUAL <= one[0] <= _EQUAL * item[0]),
                key=lambda one: one[2],
            )
        else:
            yield item


def _beside(group: ObservationGroup, i: int) -> list[tuple[str, int]]:
    """Events whose observations an error of this one raises because their errors are correlated over time."""
    neighbours = None if isinstance(group, ImagePoints) else group.stochastic.neighbours
    if neighbours is None:
        return []
    return [("event", int(group.event[index[i]])) for index in (neighbours.before, neighbours.after)]


def _survey_for_most_rays(observations: Observations, rejected: tuple[Bools, ...]) -> None:
    """Reject the survey of an object point in place of a ray, if most of its rays would be rejected with it.

    They contradict it, which is one error of it rather than one of each of them: the others would leave it
    with hardly any control, and its error in the block.
    """
    rays, last = observations.image_points, np.flatnonzero(rejected[0])
    points = int(rays.point.max(initial=0)) + 1
    left = rays.seen_from(rays.active & ~rejected[0], points)
    most = 2.0 * left < rays.seen_from(np.ones_like(rays.active), points)
    last = last[most[rays.point[last]]]
    for group, mask in zip(observations.others, rejected[1:], strict=True):
        if not isinstance(group, JoinsPoints):
            surveys = np.isin(group.point, rays.point[last]) & group.stochastic.present.any(axis=1)
            mask |= surveys
            rejected[0][last[np.isin(rays.point[last], group.point[surveys])]] = False


def _undetermined(observations: Observations, rejected: tuple[Bools, ...], points: int) -> Bools:
    """Object points (m,) that keep fewer than two rays and no survey after a rejection."""
    rays = observations.image_points
    support = 2.0 * rays.seen_from(rays.active & ~rejected[0], points)
    touched = np.zeros(points, dtype=bool)
    touched[rays.point[rejected[0]]] = True
    for group, mask in zip(observations.others, rejected[1:], strict=True):
        if isinstance(group, JoinsPoints):  # it determines neither of its points
            continue
        touching = (group.point >= 0) & ~mask
        np.add.at(support, group.point[touching], group.stochastic.present[touching].sum(axis=1))
        touched[group.point[(group.point >= 0) & mask]] = True
    return touched & (support < 3.0)


def _not_located(observations: Observations, state: State, points: Ints) -> dict[int, Explanations]:
    """Those of some object points whose wrong ray cannot be determined; a survey is there to tell."""
    surveyed = survey_information(observations, state)
    unsurveyed = np.array([point for point in points if int(point) not in surveyed], dtype=np.int64)
    found = explanations(observations.image_points, state, unsurveyed, surveyed)
    return {point: item for point, item in found.items() if not item.is_located}


def survey_information(observations: Observations, state: State) -> dict[int, Floats]:
    """Normal matrices (3, 3) of the object points that others than rays and distances belong to."""
    information: dict[int, Floats] = {}
    for group in observations.others:
        if isinstance(group, JoinsPoints) or not (group.point >= 0).any():
            continue
        equations = whiten(group, group.linearize(state))
        jacobian = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
        used = group.stochastic.present.any(axis=1)
        for i in np.flatnonzero(used & (group.point >= 0)):
            matrix = information.setdefault(int(group.point[i]), np.zeros((3, 3)))
            matrix += jacobian[i].T @ jacobian[i]
    return information
