"""Rejected observations that fit once the gross errors around them have been removed.

The residual of an observation that is not used is a prediction error z with the cofactor I + H, whitened;
where errors are correlated over time, the prediction comes from the neighbours that are left, too. Back in
the adjustment, the observation would have the residual (I + H)⁻¹ z with the cofactor (I + H)⁻¹, and it is
this that the next pass would test. A lone rejected observation has the same statistic as before it was
rejected; what another one's gross error had spoilt has a smaller one. An object point that was given up is
intersected again with the present orientations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.intersection import intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.base import JoinsPoints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from adjust.quality.cofactor import with_points
from adjust.quality.locatability import explanations
from adjust.quality.rejection import SnoopingRule, estimated_variance, survey_information
from adjust.quality.single_error import equations_at, single_errors
from adjust.quality.snooping_statistic import (
    EstimatedVariance,
    directional_statistic,
    normal_equivalent,
    of_present,
)
from adjust.solve.system import Observations
from adjust.solve.updated_normals import of_points

# Weight with which rejected rays enter the prediction of their own cofactors: it spoils nothing else by
# more than its square and leaves eight digits.
_ROOT_OF_WEIGHT = 1e-4


@dataclass(frozen=True, eq=False)
class Return:
    """What may come back.

    Attributes
    ----------
    observations : for each group (n,).
    points : (m,) object points with all their rays.
    state : to continue from: the points that come back where they intersect.
    """

    observations: tuple[Bools, ...]
    points: Bools
    state: State

    @property
    def count(self) -> int:
        """Number of observations and points that come back."""
        return int(sum(int(mask.sum()) for mask in self.observations) + self.points.sum())


def fitting_again(
    adjusted: Adjusted,
    given: Observations,
    rejected: tuple[Bools, ...],
    given_up: Bools,
    rule: SnoopingRule,
) -> Return:
    """Test what was rejected against an adjustment without it.

    Parameters
    ----------
    given : all observations, with the weights of the adjustment.
    rejected : for each group (n,) what is to be tested.
    given_up : (m,) object points to be tested.
    """
    variance = estimated_variance(adjusted, rule)
    alone = rejected[0] & adjusted.system.active_point[given.image_points.point]
    back = [np.zeros(len(group.event), dtype=bool) for group in given.groups]
    if alone.any():
        residual = np.nan_to_num(adjusted.residuals[0].residual[alone], nan=np.inf)
        whitened = residual / given.image_points.sigma[alone]
        outside, unit = np.eye(2) + _predicted_hat(adjusted, given, alone), np.eye(2)[None]
        considered = np.zeros_like(outside)
        if adjusted.quality.considered is not None:
            come_back = replace(given.image_points, active=alone).only(np.flatnonzero(alone))
            considered = adjusted.quality.considered.covariance_of_rays(come_back)
        own = np.ones(len(whitened))
        statistic = _predicted(whitened, outside, considered, unit, own, rule, variance)
        rows = np.flatnonzero(alone)
        best = _best_of_points(rows, given.image_points.point[rows], statistic, rule.critical_value)
        back[0][_harmless(adjusted, given, best, rule, variance)] = True
    others = zip(given.others, adjusted.observations.others, rejected[1:], strict=True)
    for k, (group, left, mask) in enumerate(others, start=1):
        rows = np.flatnonzero(mask)
        if len(rows) == 0:
            continue
        found = single_errors(
            group,
            equations_at(group, adjusted.state, adjusted.solution.linearization),
            adjusted.system.layout,
            adjusted.quality,
            left.stochastic.taking_part,
        )
        # The cofactor of an object point that is not used is not known: it does not come back alone.
        rows = rows[np.isfinite(of_present(group.stochastic, found.outside)[rows]).all(axis=(1, 2))]
        outside, considered = (
            of_present(group.stochastic, cofactors)[rows] for cofactors in (found.outside, found.considered)
        )
        whitener, weight = group.stochastic.whitener[rows], found.weight[rows]
        statistic = _predicted(found.pull[rows], outside, considered, whitener, weight, rule, variance)
        back[k][rows] = statistic <= rule.critical_value
    points, state = _closing_points(adjusted, given, given_up, rule, variance)
    return Return(tuple(back), points, state)


def _best_of_points(rays: Ints, point: Ints, statistic: Floats, critical_value: float) -> Ints:
    """Of the rays (k,) of each object point the one that fits best, if it fits.

    Two rays of which one is wrong may both fit alone and not together: the second one is tested again when
    the first one is back.
    """
    order = np.lexsort((statistic, point))
    first = order[np.diff(point[order], prepend=-1) > 0]
    return rays[first[statistic[first] <= critical_value]]


def _harmless(
    adjusted: Adjusted,
    given: Observations,
    rays: Ints,
    rule: SnoopingRule,
    variance: EstimatedVariance | None,
) -> Ints:
    """Those of some rays (k,), one of a point, that do not bring another ray of it above the critical value.

    A survey holds its point, and lets no other ray suffer.
    """
    if len(rays) == 0:
        return rays
    point, surveyed = given.image_points.point[rays], survey_information(given, adjusted.state)
    free = point[[int(p) not in surveyed for p in point]]
    others = adjusted.observations.image_points.active
    active = others.copy()
    active[rays] = True
    without, back = (
        _above(replace(given.image_points, active=those), others, adjusted.state, free, rule, variance)
        for those in (others, active)
    )
    return rays[~np.isin(point, np.setdiff1d(back, without))]


def _predicted(
    pull: Floats,
    outside: Floats,
    considered: Floats,
    whitener: Floats,
    weight: Floats,
    rule: SnoopingRule,
    variance: EstimatedVariance | None,
) -> Floats:
    """Statistic (n,) that observations which are not used would have if they were.

    Whole observations are tested by what the next pass would test, the directions in which the others
    control them, and by all directions: an error in one that nothing controls would stay for good.

    Parameters
    ----------
    pull : (n, m) z of the predictions, whitened.
    outside : (n, m, m) their cofactors, zero for components that are not there.
    considered : (n, m, m) what errors of considered parameters add to them.
    whitener : (n, m, m) or (1, m, m) W; w is a component of Wᵀ z over its root mean square.
    weight : (n,) T_ii: W v inside is T_ii times (I + H)⁻¹ z.
    """
    absent = np.diagonal(outside, axis1=1, axis2=2) == 0.0
    whole = outside + absent[:, :, None] * np.eye(outside.shape[1])
    inverse = np.linalg.inv(whole)
    back, spread = (inverse @ pull[:, :, None])[:, :, 0], inverse + inverse @ considered @ inverse
    if rule.test == "components":
        transposed = np.swapaxes(whitener, 1, 2)
        size = np.abs((transposed @ back[:, :, None])[:, :, 0])
        squares = np.diagonal(transposed @ spread @ whitener, axis1=1, axis2=2)
        size = np.where(absent, 0.0, size) / np.sqrt(np.where(absent, 1.0, squares))
        tests = [(size.max(axis=1) ** 2, np.ones(len(size), dtype=np.int64))]
    else:
        inside = np.where(absent[:, :, None] | absent[:, None, :], 0.0, weight[:, None, None] ** 2 * spread)
        tests = [
            directional_statistic(pull, outside + considered),
            directional_statistic(weight[:, None] * back, inside),
        ]
    if variance is None:
        return np.asarray(np.max([normal_equivalent(*test) for test in tests], axis=0))
    # With the observation back, vᵀPv and the redundancy would be larger by just these.
    more = np.einsum("ni,ni->n", pull, back)
    present = np.sum(~absent, axis=1)
    statistics = np.zeros(len(pull))
    for i in range(len(pull)):
        with_it = EstimatedVariance(
            variance.weighted_squares + float(more[i]), variance.redundancy + int(present[i])
        )
        statistics[i] = max(
            float(normal_equivalent(squares[[i]], dimension[[i]], with_it)[0]) for squares, dimension in tests
        )
    return statistics


def _predicted_hat(adjusted: Adjusted, given: Observations, alone: Bools) -> Floats:
    """A Q Aᵀ P (k, 2, 2) of rejected rays (n,) of points that are there."""
    rays, concerned = given.image_points, np.zeros_like(adjusted.system.active_point)
    concerned[rays.point[alone]] = True
    system, asked = of_points(adjusted.system, concerned), alone[concerned[rays.point]]
    own = system.observations.image_points
    light = replace(
        own,
        sigma=np.where(asked[:, None], own.sigma / _ROOT_OF_WEIGHT, own.sigma),
        active=own.active | asked,
    )
    with_them = replace(system, observations=replace(system.observations, image_points=light))
    quality = with_points(with_them, adjusted.solution, adjusted.quality.reduced)
    hat = quality.hat_of_rays[asked] / _ROOT_OF_WEIGHT**2
    return hat[:, [0, 1, 1, 2]].reshape(-1, 2, 2)


def _closing_points(
    adjusted: Adjusted,
    given: Observations,
    given_up: Bools,
    rule: SnoopingRule,
    variance: EstimatedVariance | None,
) -> tuple[Bools, State]:
    """Object points (m,) given up whose rays all fit together now, and the state with them in place."""
    state, back = adjusted.state, np.zeros_like(given_up)
    if not given_up.any():
        return back, state
    rays = given.image_points.only(np.flatnonzero(given_up[given.image_points.point]))
    found = intersect(rays, state, len(given_up))
    usable = given_up & found.usable
    state = replace(state, object_point=np.where(usable[:, None], found.object_point, state.object_point))
    back[usable] = True
    back[_above(rays, rays.active, state, np.flatnonzero(usable), rule, variance)] = False
    return back, state


def _above(
    rays: ImagePoints,
    asked: Bools,
    state: State,
    points: Ints,
    rule: SnoopingRule,
    variance: EstimatedVariance | None,
) -> Ints:
    """Those of some object points of which a ray is above the critical value, orientations held.

    Parameters
    ----------
    asked : (n,) which of the active rays are asked for.
    """
    factor = 1.0 if variance is None else np.sqrt(variance.weighted_squares / max(variance.redundancy, 1))
    found = []
    for point, item in explanations(rays, state, points, {}).items():
        size = item.component if rule.test == "components" else item.equivalent
        if size[asked[item.ray]].max(initial=0.0) > factor * rule.critical_value:
            found.append(point)
    return np.array(found, dtype=np.int64)


def in_place(adjusted: Adjusted, given: Observations, given_up: Bools) -> Adjusted:
    """The same with object points (m,) that were given up where all their rays meet now, and those residuals.

    Where an iteration has left them depends on when they were given up. Rays that do not meet are compared
    with the approximate place.
    """
    away = given_up & ~adjusted.system.active_point
    if not away.any():
        return adjusted
    state, few = adjusted.state, given.image_points.only(np.flatnonzero(away[given.image_points.point]))
    found = intersect(few, state, len(away))
    approximate = adjusted.system.block.approximate_state().object_point
    places = np.where(found.usable[:, None], found.object_point, approximate)
    state = replace(state, object_point=np.where(away[:, None], places, state.object_point))
    touched = np.append(away, False)  # the last one stands for what belongs to no object point (−1)
    residuals = []
    for group, item in zip(given.groups, adjusted.residuals, strict=True):
        rows = touched[group.point]
        if isinstance(group, JoinsPoints):
            rows |= touched[group.other_point]
        if rows.any():
            is_rays = group is given.image_points
            misclosure = few.misclosure(state) if is_rays else group.linearize(state).misclosure[rows]
            residual = item.residual.copy()
            residual[rows] = np.where(np.isnan(residual[rows]), np.nan, -misclosure)
            item = replace(item, residual=residual)
        residuals.append(item)
    return replace(
        adjusted,
        solution=replace(adjusted.solution, state=state),
        known_quality=adjusted.quality,
        known_residuals=tuple(residuals),
    )
