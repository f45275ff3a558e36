"""Variance components: the standard deviations of groups of observations from their residuals.

Every part g of the observations has an unknown factor of its standard deviations. Förstner's
simplified estimate

    σ̂_g² = Ω_g / r_g,    Ω_g = Σ v_i (P v)_i,    r_g = Σ (Q_vv P)_ii

is iterated with the weights it gives until the factors stand still (Förstner 1979). Its fixed
point is that of the rigorous estimate S σ² = q of Helmert, S_gh = tr(R_gh R_hg) with R = Q_vv P,
and there the covariance of the σ̂² is 2 S⁻¹. So σ̂_g² has d_g = 1/(S⁻¹)_gg degrees of freedom, fewer
than r_g because parts borrow from each other, and

    σ̂_g √(d/χ²_{d, 1−α/2})  …  σ̂_g √(d/χ²_{d, α/2})

is its confidence interval. S is too large to be formed; its elements are traces, found by probing:
for z of random signs on part h, E ‖(R z)_g‖² = S_gh (Hutchinson 1990). A correlation time that is to be
estimated is one more part of its group and shares S; see :mod:`adjust.quality.correlation_time`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats
from adjust.observations.base import CorrelatedOverTime, ObservationGroup
from adjust.parameters import State
from adjust.quality import correlation_time
from adjust.quality.cofactor import Cofactor
from adjust.quality.correlation_time import CorrelationTime
from adjust.quality.detectability import UNCONTROLLED
from adjust.quality.observation_parts import Part
from adjust.quality.redundancy import GroupResiduals
from adjust.quality.residual_operator import ResidualOperator
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import Observations, System

#: Redundancy below which a part keeps its weights: the estimate would be wilder than the statement.
LEAST_REDUNDANCY = 10.0
#: Change of any factor below which the iteration may end.
CONVERGED = 0.01
# Median of |x| of a standard normal variable.
_MEDIAN = 0.6745
# Σ ‖(R z)_g‖² over so many degrees of freedom pins S_gg to √(2/800) = 5 %, its root to half of that.
_PROBED = 800.0
_ROUGHLY_PROBED = 200.0
_MOST_PROBES = 40
# Step of log σ that is allowed for one of a correlation time.
_TOGETHER = 0.5


@dataclass(frozen=True)
class VarianceComponent:
    """An estimated variance component.

    Attributes
    ----------
    part : what it belongs to.
    factor : estimated over stated standard deviation; 1 where nothing was estimated.
    lower, upper : its confidence limits; NaN where nothing was estimated.
    redundancy : Σ (Q_vv P)_ii of the part at the last weights.
    degrees_of_freedom : of the estimate; NaN where nothing was estimated.
    sigma : median of the estimated standard deviations of the part, SI and radians; NaN without any.
    """

    part: Part
    factor: float
    lower: float
    upper: float
    redundancy: float
    degrees_of_freedom: float
    sigma: float

    @property
    def estimated(self) -> bool:
        """Whether the redundancy sufficed."""
        return bool(np.isfinite(self.degrees_of_freedom))


def reweighted(observations: Observations, parts: tuple[Part, ...], factors: Floats) -> Observations:
    """The observations with the standard deviations of every part multiplied by its factor.

    The factor of a correlation multiplies the correlation time.
    """
    divided = {part.group for part in parts if part.rows is not None}
    of_groups = [
        np.ones((len(group.event) if index in divided else 1, len(group.components)))
        for index, group in enumerate(observations.groups)
    ]
    stretched = np.ones(len(observations.groups))
    for part, factor in zip(parts, factors, strict=True):
        if part.is_correlation:
            stretched[part.group] *= factor
        else:
            of_groups[part.group][part.place] *= factor
    return Observations(
        observations.image_points.rescaled(of_groups[0]),
        tuple(
            _stretched(group.rescaled(factor), float(ratio))
            for group, factor, ratio in zip(observations.others, of_groups[1:], stretched[1:], strict=True)
        ),
    )


def _stretched(group: ObservationGroup, ratio: float) -> ObservationGroup:
    """A group whose correlation time is multiplied by a ratio."""
    process = group.stochastic.over_time
    if process is None or ratio == 1.0 or not isinstance(group, CorrelatedOverTime):
        return group
    return group.with_correlation_time(process.correlation_time * ratio)


def variance_factors(
    observations: Observations, residuals: tuple[GroupResiduals, ...], parts: tuple[Part, ...]
) -> Floats:
    """√(Ω_g/r_g) of every part (parts,); 1 where there is nothing to take it from, and for correlations."""
    squares = [_component_squares(*item) for item in zip(observations.groups, residuals, strict=True)]
    factors = np.ones(len(parts))
    for k, part in enumerate(parts):
        redundancy = redundancy_of(observations, residuals, part)
        total = float(squares[part.group][part.place].sum())
        # Correlated components may share Ω so that a part of it is negative; it then says nothing.
        if redundancy > 0.0 and total > 0.0 and not part.is_correlation:
            factors[k] = np.sqrt(total / redundancy)
    return factors


def robust_factors(
    observations: Observations, residuals: tuple[GroupResiduals, ...], parts: tuple[Part, ...]
) -> Floats:
    """Factors (parts,) from the medians of |w|, which half of the observations may spoil without harm."""
    factors = np.ones(len(parts))
    for k, part in enumerate(parts):
        if part.is_correlation:
            continue
        controlled = np.nan_to_num(residuals[part.group].control[part.place]) >= UNCONTROLLED
        alone = residuals[part.group].standardized / np.sqrt(
            observations.groups[part.group].stochastic.shares
        )
        size = np.abs(alone[part.place])[controlled]
        if size.size and np.median(size) > 0.0:
            factors[k] = float(np.median(size)) / _MEDIAN
    return factors


def redundancy_of(observations: Observations, residuals: tuple[GroupResiduals, ...], part: Part) -> float:
    """Sum of the redundancy numbers of a part, each as far as it is of an independent observation."""
    own = residuals[part.group].redundancy * observations.groups[part.group].stochastic.shares
    return float(np.nansum(own[part.place]))


def _component_squares(group: ObservationGroup, residuals: GroupResiduals) -> Floats:
    """v_i (P v)_i of every component (n, m); their sum is vᵀPv."""
    model = group.stochastic
    clean = np.where(model.present, np.nan_to_num(residuals.residual), 0.0)
    return np.asarray(clean * model.weighted(clean))


def variance_components(
    system: System,
    solution: Solution,
    residuals: tuple[GroupResiduals, ...],
    parts: tuple[Part, ...],
    factors: Floats,
    frozen: Bools,
    confidence: float,
) -> tuple[tuple[VarianceComponent, ...], tuple[CorrelationTime, ...]]:
    """The components and correlation times that the iteration has found.

    Parameters
    ----------
    factors : (parts,) of the stated standard deviations, those of ``system`` divided by them.
    frozen : (parts,) which keep their stated standard deviations.
    confidence : of the intervals.
    """
    redundancy = np.array([redundancy_of(system.observations, residuals, part) for part in parts])
    free = ~frozen
    variance = np.full(len(parts), np.nan)
    estimated = [part for part, is_free in zip(parts, free, strict=True) if is_free]
    if estimated:
        traces = trace_matrix(system, solution, tuple(estimated), redundancy[free])
        variance[free] = np.diagonal(np.linalg.inv(traces))
    # d ≤ r; probing alone may say a little more.
    degrees = np.minimum(1.0 / variance, redundancy)
    times = []
    for k, part in enumerate(parts):
        process = system.observations.groups[part.group].stochastic.over_time
        if part.is_correlation and process is not None:
            # The information of log σ² and of ζ is S/2.
            times.append(
                correlation_time.stated_or_estimated(
                    part.group, part.name, process, float(redundancy[k]), 2.0 * float(variance[k]), confidence
                )
            )
    results = []
    for k, part in enumerate(parts):
        if part.is_correlation:
            continue
        lower = upper = float("nan")
        if free[k]:
            tail = 0.5 * (1.0 - confidence)
            limits = np.sqrt(
                degrees[k] / (2.0 * special.gammaincinv(0.5 * degrees[k], np.array([1.0 - tail, tail])))
            )
            lower, upper = (float(factors[k] * limit) for limit in limits)
        model = system.observations.groups[part.group].stochastic
        sigma = model.sigma[part.place][model.present[part.place]]
        results.append(
            VarianceComponent(
                part,
                float(factors[k]),
                lower,
                upper,
                float(redundancy[k]),
                float(degrees[k]),
                float(np.median(sigma)) if sigma.size else float("nan"),
            )
        )
    return tuple(results), tuple(times)


def helmert_step(
    system: System,
    solution: Solution,
    quality: Cofactor,
    residuals: tuple[GroupResiduals, ...],
    parts: tuple[Part, ...],
    simplified: Floats,
) -> Floats:
    """Factors (parts,) of Helmert's rigorous estimate, from those of the simplified one.

    With x = log σ², log(Ω_g/r_g) has the derivatives −S_gh/r_g, so this is a Newton step for the
    fixed point of both. Roughly probed traces suffice: they decide how fast it is reached, not where it
    lies. No factor moves beyond the square of the simplified one. With a correlation time among the parts
    it is a step of Fisher's scoring for all of them, and moves the factors by up to e^½, too: σ and
    correlation time of a group must be able to move together.
    """
    redundancy = np.array([redundancy_of(system.observations, residuals, part) for part in parts])
    known = redundancy > 1.0
    steps = np.log(simplified)
    right = redundancy * steps
    for k, part in enumerate(parts):
        if part.is_correlation:
            half = 0.5 * _score(system, solution.state, quality, part)
            known[k] &= half != 0.0
            right[k] = half
    if known.any():
        chosen = tuple(part for part, is_known in zip(parts, known, strict=True) if is_known)
        traces = trace_matrix(system, solution, chosen, redundancy[known], _ROUGHLY_PROBED)
        exact = np.linalg.solve(traces, right[known])
        limit = np.maximum(2.0 * np.abs(steps[known]), _TOGETHER if _has_correlation(chosen) else 0.0)
        correlated = np.array([part.is_correlation for part in chosen])
        steps[known] = np.where(correlated, exact, np.clip(exact, -limit, limit))
    factors: Floats = np.exp(steps)
    for k, part in enumerate(parts):
        process = system.observations.groups[part.group].stochastic.over_time
        if part.is_correlation and process is not None:
            # Factors are of σ, so the steps are halves: of log σ², and of ζ.
            factors[k] = correlation_time.moved(process, 2.0 * float(steps[k]))
    return factors


def _has_correlation(parts: tuple[Part, ...]) -> bool:
    return any(part.is_correlation for part in parts)


def _score(system: System, state: State, quality: Cofactor, part: Part) -> float:
    """Score of a correlation time; 0 where it is at a limit that the likelihood would pass."""
    group = system.observations.groups[part.group]
    uphill = correlation_time.score(system, state, quality, group)
    process = group.stochastic.over_time
    return 0.0 if process is None or correlation_time.is_stopped(process, uphill) else uphill


def trace_matrix(
    system: System,
    solution: Solution,
    parts: tuple[Part, ...],
    redundancy: Floats,
    probed: float = _PROBED,
) -> Floats:
    """S_gh = tr(R K_g R K_h) of the parts, (parts, parts), by probing with random signs from a fixed seed.

    K is one on the rows of a part; for a correlation time see :mod:`adjust.quality.correlation_time`.
    Correlated components of an observation are distinguished after whitening.

    Parameters
    ----------
    redundancy : (parts,) of the parts; weak parts are probed more often.
    probed : redundancy over which the traces of each part are collected.
    """
    groups = system.observations.groups
    operator = ResidualOperator.of(system, solution)
    random = np.random.default_rng(0)
    traces = np.zeros((len(parts), len(parts)))
    for h, part in enumerate(parts):
        probes = int(np.clip(np.ceil(probed / redundancy[h]), 1, _MOST_PROBES))
        for _ in range(probes):
            signs = _signs(groups, part, random)
            found = with_signs = operator.residuals(signs)
            if part.is_correlation:
                signs[part.group][:] = correlation_time.along_derivative(
                    groups[part.group].stochastic, signs[part.group]
                )
                found = operator.residuals(signs)
            for g, other in enumerate(parts):
                one, its = with_signs[other.group] * _roots(groups[other.group]), found[other.group]
                if other.is_correlation:
                    its = correlation_time.along_derivative(groups[other.group].stochastic, its)
                traces[g, h] += float(np.sum(one[other.place] * its[other.place])) / probes
    symmetric: Floats = 0.5 * (traces + traces.T)
    return symmetric


def _signs(
    groups: tuple[ObservationGroup, ...], part: Part, random: np.random.Generator
) -> tuple[Floats, ...]:
    """Whitened vectors (n, m) of all groups: random signs on one part, zero elsewhere."""
    vectors = tuple(np.zeros(group.stochastic.present.shape) for group in groups)
    present: Bools = groups[part.group].stochastic.present[part.place]
    vectors[part.group][part.place] = np.where(present, random.choice((-1.0, 1.0), present.shape), 0.0)
    # Of a vector and what it is compared with, each has half of the roots of the shares.
    vectors[part.group][:] *= np.sqrt(_roots(groups[part.group]))
    return vectors


def _roots(group: ObservationGroup) -> Floats:
    """(n, 1) roots of the shares."""
    return np.asarray(np.sqrt(group.stochastic.shares))
