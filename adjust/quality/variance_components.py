"""Variance components: the standard deviations of groups of observations from their residuals.

Every part g of the observations has an unknown factor of its standard deviations. Förstner's
simplified estimate

    σ̂_g² = Ω_g / r_g,    Ω_g = Σ v_i (P v)_i,    r_g = Σ (Q_vv P)_ii

is iterated with the weights it gives until the factors stand still (Förstner 1979). Its fixed
point is that of the rigorous estimate S σ² = q of Helmert, S_gh = tr(R_gh R_hg) with R = Q_vv P,
and there the covariance of the σ̂² is 2 S⁻¹. So σ̂_g² has d_g = 1/(S⁻¹)_gg degrees of freedom, fewer
than r_g because parts borrow from each other, and

    σ̂_g √(d/χ²_{d, 1−α/2})  …  σ̂_g √(d/χ²_{d, α/2})

is its confidence interval. S is found by probing, see :mod:`adjust.quality.trace_matrix`.
Errors of considered parameters are no errors of a part: v is what they leave, and Q_vv that of an adjustment
in which the parameters are observed, so that both estimate the same components.
A correlation time that is to be estimated is one more part of its group and shares S; see
:mod:`adjust.quality.correlation_time`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats
from adjust.least_squares import Adjusted
from adjust.observations.base import CorrelatedOverTime, ObservationGroup
from adjust.observations.image_point import ImagePoints
from adjust.quality import correlation_time
from adjust.quality.considered_errors import ConsideredErrors
from adjust.quality.correlation_time import CorrelationTime
from adjust.quality.detectability import UNCONTROLLED
from adjust.quality.observation_parts import Part
from adjust.quality.redundancy import GroupResiduals
from adjust.quality.trace_matrix import trace_matrix
from adjust.solve.normal_equations import weighted_squares
from adjust.solve.system import Observations

#: Redundancy below which a part keeps its weights: the estimate would be wilder than the statement.
LEAST_REDUNDANCY = 10.0
#: Change of any factor below which the iteration may end.
CONVERGED = 0.01
# Median of |x| of a standard normal variable.
_MEDIAN = 0.6745
# So many image points at a time bound the memory of what is between.
_AT_ONCE = 65_536
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


@dataclass(frozen=True)
class PartSums:
    """What the estimates are made of.

    Attributes
    ----------
    squares : (parts,) Ω_g.
    redundancy : (parts,) r_g, of every observation as far as it is an independent one.
    """

    squares: Floats
    redundancy: Floats

    @classmethod
    def of(cls, adjusted: Adjusted, parts: tuple[Part, ...]) -> Self:
        """Of an adjustment.

        Image points that are one part have what the other groups leave of vᵀPv and of n − u, so nobody
        needs their redundancy numbers.
        """
        others = adjusted.residuals_of_others
        if adjusted.considered is not None:
            pairs = zip(adjusted.observations.others, others, strict=True)
            others = tuple(_left_of(group, item, adjusted.considered) for group, item in pairs)
        return cls(*np.array([_sums_of_part(adjusted, part, others) for part in parts]).reshape(-1, 2).T)


def _sums_of_part(adjusted: Adjusted, part: Part, others: tuple[GroupResiduals, ...]) -> tuple[float, float]:
    """Ω_g and r_g of one part, from the residuals of the groups other than image points."""
    if part.group > 0:
        group, item = adjusted.observations.others[part.group - 1], others[part.group - 1]
        squares, redundancy = _component_squares(group, item), item.redundancy * group.stochastic.shares
    elif part.rows is None:
        squares_left = weighted_squares(adjusted.system, adjusted.state)
        left = float(adjusted.redundancy)
        if adjusted.considered is not None:
            squares_left, left = adjusted.considered.left(squares_left, left)
        squares_left -= sum(item.weighted_squares for item in others)
        return squares_left, left - sum(float(np.nansum(item.redundancy)) for item in others)
    else:
        item = adjusted.residuals[0]
        if adjusted.considered is not None:
            rays = adjusted.observations.image_points
            item = _left_of(rays, item, adjusted.considered)
        squares = (item.residual * adjusted.observations.image_points.inverse_sigma) ** 2
        redundancy = item.redundancy
    return float(np.nansum(squares[part.place])), float(np.nansum(redundancy[part.place]))


def _left_of(
    group: ObservationGroup, residuals: GroupResiduals, considered: ConsideredErrors
) -> GroupResiduals:
    """What the most probable errors of considered parameters leave of residuals and redundancy numbers."""
    residual, redundancy = residuals.residual.copy(), residuals.redundancy.copy()
    rows = len(residual)
    # Image points are many, and independent of each other; the others may be correlated along their strips.
    step = _AT_ONCE if isinstance(group, ImagePoints) else max(rows, 1)
    for first in range(0, rows, step):
        part = slice(first, first + step)
        few = group.only(part) if isinstance(group, ImagePoints) else group
        model = few.stochastic
        moved = considered.of_computed(few.linearize(considered.state))
        moved = np.where(model.present[:, :, None], moved, 0.0)
        residual[part] -= moved @ considered.most_probable
        for spread in np.moveaxis(moved @ considered.remaining_root, 2, 0):
            redundancy[part] -= spread * model.weighted(spread)
    clean = np.where(group.stochastic.present, np.nan_to_num(residual), 0.0)
    squares = float(np.sum(group.stochastic.whitened(clean) ** 2))
    return replace(residuals, residual=residual, redundancy=redundancy, weighted_squares=squares)


def variance_factors(sums: PartSums, parts: tuple[Part, ...]) -> Floats:
    """√(Ω_g/r_g) of every part (parts,); 1 where there is nothing to take it from, and for correlations."""
    # Correlated components may share Ω so that a part of it is negative; it then says nothing.
    usable = (sums.redundancy > 0.0) & (sums.squares > 0.0)
    usable &= ~np.array([part.is_correlation for part in parts], dtype=bool)
    ratio = np.where(usable, sums.squares, 1.0) / np.where(usable, sums.redundancy, 1.0)
    return np.sqrt(ratio)


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


def _component_squares(group: ObservationGroup, residuals: GroupResiduals) -> Floats:
    """v_i (P v)_i of every component (n, m); their sum is vᵀPv."""
    model = group.stochastic
    clean = np.where(model.present, np.nan_to_num(residuals.residual), 0.0)
    return np.asarray(clean * model.weighted(clean))


def variance_components(
    adjusted: Adjusted,
    parts: tuple[Part, ...],
    factors: Floats,
    frozen: Bools,
    confidence: float,
) -> tuple[tuple[VarianceComponent, ...], tuple[CorrelationTime, ...]]:
    """The components and correlation times that the iteration has found.

    Parameters
    ----------
    factors : (parts,) of the stated standard deviations, those of ``adjusted`` divided by them.
    frozen : (parts,) which keep their stated standard deviations.
    confidence : of the intervals.
    """
    groups, redundancy = adjusted.observations.groups, PartSums.of(adjusted, parts).redundancy
    free = ~frozen
    variance = np.full(len(parts), np.nan)
    estimated = [part for part, is_free in zip(parts, free, strict=True) if is_free]
    if estimated:
        known = adjusted.considered
        traces = trace_matrix(adjusted.system, adjusted.solution, tuple(estimated), redundancy[free], known)
        variance[free] = np.diagonal(np.linalg.inv(traces))
    # d ≤ r; probing alone may say a little more.
    degrees = np.minimum(1.0 / variance, redundancy)
    times = []
    for k, part in enumerate(parts):
        process = groups[part.group].stochastic.over_time
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
        model = groups[part.group].stochastic
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
    adjusted: Adjusted, parts: tuple[Part, ...], redundancy: Floats, simplified: Floats
) -> Floats:
    """Factors (parts,) of Helmert's rigorous estimate, from those of the simplified one.

    With x = log σ², log(Ω_g/r_g) has the derivatives −S_gh/r_g, so this is a Newton step for the
    fixed point of both. Probed traces suffice: they decide how fast it is reached, not where it lies. No
    factor moves beyond the square of the simplified one. With a correlation time among the parts it is a
    step of Fisher's scoring for all of them, and moves the factors by up to e^½, too: σ and correlation time
    of a group must be able to move together.
    """
    known = redundancy > 1.0
    steps = np.log(simplified)
    right = redundancy * steps
    for k, part in enumerate(parts):
        if part.is_correlation:
            half = 0.5 * _score(adjusted, part)
            known[k] &= half != 0.0
            right[k] = half
    if known.any():
        chosen = tuple(part for part, is_known in zip(parts, known, strict=True) if is_known)
        of_chosen, considered = redundancy[known], adjusted.considered
        traces = trace_matrix(adjusted.system, adjusted.solution, chosen, of_chosen, considered)
        exact = np.linalg.solve(traces, right[known])
        limit = np.maximum(2.0 * np.abs(steps[known]), _TOGETHER if _has_correlation(chosen) else 0.0)
        correlated = np.array([part.is_correlation for part in chosen])
        steps[known] = np.where(correlated, exact, np.clip(exact, -limit, limit))
    factors: Floats = np.exp(steps)
    for k, part in enumerate(parts):
        process = adjusted.observations.groups[part.group].stochastic.over_time
        if part.is_correlation and process is not None:
            # Factors are of σ, so the steps are halves: of log σ², and of ζ.
            factors[k] = correlation_time.moved(process, 2.0 * float(steps[k]))
    return factors


def _has_correlation(parts: tuple[Part, ...]) -> bool:
    return any(part.is_correlation for part in parts)


def _score(adjusted: Adjusted, part: Part) -> float:
    """Score of a correlation time; 0 where it is at a limit that the likelihood would pass."""
    group = adjusted.observations.groups[part.group]
    quality = replace(adjusted.quality_of_others, considered=adjusted.considered)
    uphill = correlation_time.score(adjusted.system, adjusted.state, quality, group)
    process = group.stochastic.over_time
    return 0.0 if process is None or correlation_time.is_stopped(process, uphill) else uphill
