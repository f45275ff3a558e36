"""Robust estimation for the detection of gross errors, before data snooping.

Every observation is weighted down by a factor f(|w|) of its weight, w = v/(σ √r) studentized with the
redundancy number of the ordinary adjustment, and the block is adjusted again until the factors stand
still: many gross errors at once then no longer hide each other. Both coordinates of an image point
share the factor of the larger |w|. Robust estimates are used to find gross errors and for nothing else:
what they find is taken out, all statistics come from ordinary adjustments, and what was found wrongly
comes back when it is tested again in the end.

| function | f(|w|) |
|---|---|
| huber | min(1, k/|w|), k = 1.5 |
| cauchy | 1/(1 + (w/c)²), c = 2.385 |
| tukey | (1 − (w/c)²)² up to c = 4.685, then 0; the first three rounds are Huber's, for it is not convex |
| biber | min(1, k/|w|), k = 3: only what is suspicious loses weight (Wicki 1999) |
| danish | 1 up to 3, then exp(−0.05 |w|^4.4) for two rounds, then exp(−0.05 |w|³) |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from adjust.arrays import Floats
from adjust.least_squares import Adjusted, Adjuster
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from adjust.quality.control_locatability import doubtful_control
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.redundancy import GroupResiduals
from adjust.quality.rejection import Rejection, SnoopingRule, choose, located
from adjust.solve.gauss_newton import Iteration, converge
from adjust.solve.normal_equations import reduced_normals, weighted_squares
from adjust.solve.right_hand_side import with_right_hand_sides
from adjust.solve.step import Step
from adjust.solve.system import Observations, System

RobustFunction = Literal["huber", "cauchy", "tukey", "biber", "danish"]

_MOST_ROUNDS = 12
# Weights and values are found together: there is no use in converging with weights of one round.
# So many steps where one alone leaves the domain of the model.
_STEPS = 2
# Factors that change by less than this no longer move what is found.
_SETTLED = 0.05
# Even a robust estimate bends under errors of many hundred σ: what is below this part of the largest |w| is
# judged again when those are gone.
_SWAMPED = 0.2
# A factor of zero would leave an object point without any rays.
_LEAST = 1e-4


def _huber(w: Floats, _: int) -> Floats:
    return np.minimum(1.0, 1.5 / np.maximum(w, 1.5))


def _cauchy(w: Floats, _: int) -> Floats:
    return np.asarray(1.0 / (1.0 + (w / 2.385) ** 2))


def _tukey(w: Floats, number: int) -> Floats:
    if number < 3:
        return _huber(w, number)
    return np.asarray(np.where(w < 4.685, (1.0 - np.minimum(w / 4.685, 1.0) ** 2) ** 2, 0.0))


def _biber(w: Floats, _: int) -> Floats:
    return np.minimum(1.0, 3.0 / np.maximum(w, 3.0))


def _danish(w: Floats, number: int) -> Floats:
    power = 4.4 if number < 2 else 3.0
    return np.asarray(np.where(w > 3.0, np.exp(-0.05 * np.minimum(w, 1e3) ** power), 1.0))


WEIGHT_FUNCTIONS: Mapping[RobustFunction, Callable[[Floats, int], Floats]] = {
    "huber": _huber,
    "cauchy": _cauchy,
    "tukey": _tukey,
    "biber": _biber,
    "danish": _danish,
}


def robust_rejection(
    adjuster: Adjuster, adjusted: Adjusted, function: RobustFunction, rule: SnoopingRule
) -> Rejection:
    """Outliers of a robust adjustment: the largest of every object point and image."""
    state, observations = adjusted.state, adjusted.observations
    doubtful = doubtful_control(adjusted, rule.critical_value)
    if doubtful is not None and doubtful.size > 0.0:
        # Sound image points would be weighted down in their place.
        return Rejection.nothing(observations, len(state.object_point))
    scales = scales_of(observations, adjusted.residuals)
    statistics = studentized(observations, state, scales)
    factors = tuple(np.ones(len(w)) for w in statistics)
    step: Step | None = None
    for number in range(_MOST_ROUNDS):
        weigh = WEIGHT_FUNCTIONS[function]
        following = tuple(np.maximum(weigh(w, number), _LEAST) for w in statistics)
        change = max(
            (float(np.max(np.abs(a - b), initial=0.0)) for a, b in zip(factors, following, strict=True))
        )
        factors = following
        if change < _SETTLED:
            break
        system = adjusted.system.remaining(_weighted_down(observations, factors))
        state, step = _moved(adjuster, system, state, step)
        statistics = studentized(observations, state, scales)
    largest = max((float(w.max(initial=0.0)) for w in statistics), default=0.0)
    least = max(rule.critical_value, _SWAMPED * largest)
    bounds = tuple(np.full(len(w), least) for w in statistics)
    return located(adjusted, choose(observations, state, statistics, bounds), rule)


def _moved(
    adjuster: Adjuster, system: System, state: State, before: Step | None
) -> tuple[State, Step | None]:
    """The state after one step with the weights of a round, and that step if it may serve the next round.

    Object points take the weights of this round. The matrix of the other unknowns, which hardly changes, is
    that of an earlier round while the steps become shorter.
    """
    step = None if before is None else _repeated(before, system, state)
    if step is None:
        step = Step.newton(system, state, reduced_normals(system, state))
    if not np.isfinite(weighted_squares(system, step.moved)):
        return converge(system, state, _STEPS, adjuster.progress, may_stall=True).state, None
    if adjuster.progress is not None:
        adjuster.progress(Iteration(1, step.normals.weighted_squares, step.largest_move, 0.0))
    return step.moved, step if step.movements is None else None


def _repeated(before: Step, system: System, state: State) -> Step | None:
    """A step with the matrix of an earlier one; None where it would be longer than that."""
    normals = with_right_hand_sides(before.normals, system, state)
    if normals is None:
        return None
    step = replace(before, system=system).then(state, normals)
    return step if step.largest_move <= before.largest_move else None


def _weighted_down(observations: Observations, factors: tuple[Floats, ...]) -> Observations:
    """The observations with weights multiplied by factors (n,)."""
    of_sigma = [1.0 / np.sqrt(factor)[:, None] for factor in factors]
    return Observations(
        observations.image_points.rescaled(of_sigma[0]),
        tuple(
            group.rescaled(factor) for group, factor in zip(observations.others, of_sigma[1:], strict=True)
        ),
    )


def scales_of(observations: Observations, ordinary: tuple[GroupResiduals, ...]) -> tuple[Floats, ...]:
    """What makes w of P v for every component (n, m), by the cofactors of the ordinary adjustment.

    1/√(P Q_vv P)_ii, with which P v is v/(σ √r) where nothing is correlated; errors of considered parameters,
    which make ∇₀ larger, make it smaller. Zero for what is not controlled.
    """
    scales = []
    for group, item in zip(observations.groups, ordinary, strict=True):
        if isinstance(group, ImagePoints):  # without the matrices of the general form, which are large
            sigma, present = group.sigma, group.active[:, None]
        else:
            sigma, present = group.stochastic.sigma, group.stochastic.present
        controlled = (np.nan_to_num(item.control) >= UNCONTROLLED) & present
        with np.errstate(invalid="ignore"):
            inverse = NON_CENTRALITY * sigma**2 / (item.control * item.detectable)
        scales.append(np.where(controlled, inverse, 0.0))
    return tuple(scales)


def studentized(observations: Observations, state: State, scales: tuple[Floats, ...]) -> tuple[Floats, ...]:
    """Largest controlled |w| of every observation (n,)."""
    rays = observations.image_points
    weighted = [np.nan_to_num(rays.misclosure(state)) * rays.inverse_sigma**2]
    for group in observations.others:
        model = group.stochastic
        misclosure = np.where(model.present, np.nan_to_num(group.linearize(state).misclosure), 0.0)
        weighted.append(model.weighted(misclosure))
    return tuple(np.max(np.abs(a) * b, axis=1) for a, b in zip(weighted, scales, strict=True))
