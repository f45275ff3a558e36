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
for z of random signs on part h, E ‖(R z)_g‖² = S_gh (Hutchinson 1990).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats
from adjust.observations.base import ObservationGroup
from adjust.quality.redundancy import UNCONTROLLED, GroupResiduals
from adjust.quality.residual_operator import residuals_of
from adjust.solve.gauss_newton import Solution
from adjust.solve.normal_equations import Observations, System

#: Redundancy below which a part keeps its weights: the estimate would be wilder than the statement.
LEAST_REDUNDANCY = 10.0
#: Change of any factor below which the iteration may end.
CONVERGED = 0.01
_PARTS: Mapping[str, tuple[tuple[str, tuple[int, ...]], ...]] = {
    "image_points": (("", (0, 1)),),
    "control_points": (("plan", (0, 1)), ("height", (2,))),
    "gnss_positions": (("plan", (0, 1)), ("height", (2,))),
    "ins_attitudes": (("roll and pitch", (0, 1)), ("yaw", (2,))),
}
# Median of |x| of a standard normal variable.
_MEDIAN = 0.6745
# Σ ‖(R z)_g‖² over so many degrees of freedom pins S_gg to √(2/800) = 5 %, its root to half of that.
_PROBED = 800.0
_ROUGHLY_PROBED = 200.0
_MOST_PROBES = 40


@dataclass(frozen=True)
class Part:
    """The components of a group of observations that share one variance component.

    Attributes
    ----------
    group : index of the group in ``Observations.groups``.
    name : name of the group, and what the part is called where a group has several.
    components : indices of its components.
    """

    group: int
    name: str
    components: tuple[int, ...]


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


def parts_of(observations: Observations) -> tuple[Part, ...]:
    """All parts: those of image points, control, GNSS, INS, and one for each family of priors."""
    parts = []
    for index, group in enumerate(observations.groups):
        whole = (("", tuple(range(len(group.components)))),)
        for word, components in _PARTS.get(group.name, whole):
            parts.append(Part(index, f"{group.name} {word}".strip(), components))
    return tuple(parts)


def reweighted(observations: Observations, parts: tuple[Part, ...], factors: Floats) -> Observations:
    """The observations with the standard deviations of every part multiplied by its factor."""
    of_groups = [np.ones(len(group.components)) for group in observations.groups]
    for part, factor in zip(parts, factors, strict=True):
        of_groups[part.group][list(part.components)] *= factor
    return Observations(
        observations.image_points.rescaled(of_groups[0]),
        tuple(
            group.rescaled(factor) for group, factor in zip(observations.others, of_groups[1:], strict=True)
        ),
    )


def variance_factors(
    observations: Observations, residuals: tuple[GroupResiduals, ...], parts: tuple[Part, ...]
) -> Floats:
    """√(Ω_g/r_g) of every part (parts,); 1 where there is nothing to take it from."""
    squares = [_component_squares(*item) for item in zip(observations.groups, residuals, strict=True)]
    factors = np.ones(len(parts))
    for k, part in enumerate(parts):
        redundancy = redundancy_of(residuals, part)
        total = float(squares[part.group][list(part.components)].sum())
        # Correlated components may share Ω so that a part of it is negative; it then says nothing.
        if redundancy > 0.0 and total > 0.0:
            factors[k] = np.sqrt(total / redundancy)
    return factors


def robust_factors(residuals: tuple[GroupResiduals, ...], parts: tuple[Part, ...]) -> Floats:
    """Factors (parts,) from the medians of |w|, which half of the observations may spoil without harm."""
    factors = np.ones(len(parts))
    for k, part in enumerate(parts):
        columns = list(part.components)
        controlled = np.nan_to_num(residuals[part.group].redundancy[:, columns]) >= UNCONTROLLED
        size = np.abs(residuals[part.group].standardized[:, columns])[controlled]
        if size.size and np.median(size) > 0.0:
            factors[k] = float(np.median(size)) / _MEDIAN
    return factors


def redundancy_of(residuals: tuple[GroupResiduals, ...], part: Part) -> float:
    """Sum of the redundancy numbers of a part."""
    return float(np.nansum(residuals[part.group].redundancy[:, list(part.components)]))


def _component_squares(group: ObservationGroup, residuals: GroupResiduals) -> Floats:
    """Σ v_i (P v)_i over the observations, for each component (m,); their sum is vᵀPv."""
    model = group.stochastic
    clean = np.where(model.present, np.nan_to_num(residuals.residual), 0.0)
    whitened = np.einsum("nij,nj->ni", model.whitener, clean)
    pulled = np.einsum("nji,nj->ni", model.whitener, whitened)
    squares: Floats = np.sum(clean * pulled, axis=0)
    return squares


def variance_components(
    system: System,
    solution: Solution,
    residuals: tuple[GroupResiduals, ...],
    parts: tuple[Part, ...],
    factors: Floats,
    frozen: Bools,
    confidence: float,
) -> tuple[VarianceComponent, ...]:
    """State the components that the iteration has found.

    Parameters
    ----------
    factors : (parts,) of the stated standard deviations, those of ``system`` divided by them.
    frozen : (parts,) which keep their stated standard deviations.
    confidence : of the intervals.
    """
    redundancy = np.array([redundancy_of(residuals, part) for part in parts])
    free = ~frozen
    degrees = np.full(len(parts), np.nan)
    estimated = [part for part, is_free in zip(parts, free, strict=True) if is_free]
    if estimated:
        traces = trace_matrix(system, solution, tuple(estimated), redundancy[free])
        # d ≤ r; probing alone may say a little more.
        degrees[free] = np.minimum(1.0 / np.diagonal(np.linalg.inv(traces)), redundancy[free])
    results = []
    for k, part in enumerate(parts):
        lower = upper = float("nan")
        if free[k]:
            tail = 0.5 * (1.0 - confidence)
            limits = np.sqrt(
                degrees[k] / (2.0 * special.gammaincinv(0.5 * degrees[k], np.array([1.0 - tail, tail])))
            )
            lower, upper = (float(factors[k] * limit) for limit in limits)
        model = system.observations.groups[part.group].stochastic
        sigma = model.sigma[:, list(part.components)][model.present[:, list(part.components)]]
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
    return tuple(results)


def helmert_step(
    system: System,
    solution: Solution,
    residuals: tuple[GroupResiduals, ...],
    parts: tuple[Part, ...],
    simplified: Floats,
) -> Floats:
    """Factors (parts,) of Helmert's rigorous estimate, from those of the simplified one.

    With x = log σ², log(Ω_g/r_g) has the derivatives −S_gh/r_g, so this is a Newton step for the
    fixed point of both. Roughly probed traces suffice: they decide how fast it is reached, not where it
    lies. No factor moves beyond the square of the simplified one.
    """
    redundancy = np.array([redundancy_of(residuals, part) for part in parts])
    known = redundancy > 1.0
    steps = np.log(simplified)
    if known.any():
        chosen = tuple(part for part, is_known in zip(parts, known, strict=True) if is_known)
        traces = trace_matrix(system, solution, chosen, redundancy[known], _ROUGHLY_PROBED)
        exact = np.linalg.solve(traces, redundancy[known] * steps[known])
        limit = 2.0 * np.abs(steps[known])
        steps[known] = np.clip(exact, -limit, limit)
    factors: Floats = np.exp(steps)
    return factors


def trace_matrix(
    system: System,
    solution: Solution,
    parts: tuple[Part, ...],
    redundancy: Floats,
    probed: float = _PROBED,
) -> Floats:
    """S_gh = tr(R_gh R_hg) of the parts, (parts, parts), by probing with random signs from a fixed seed.

    Correlated components of an observation are told apart after whitening.

    Parameters
    ----------
    redundancy : (parts,) of the parts; weak parts are probed more often.
    probed : redundancy over which the traces of each part are collected.
    """
    groups = system.observations.groups
    random = np.random.default_rng(0)
    traces = np.zeros((len(parts), len(parts)))
    for h, part in enumerate(parts):
        probes = int(np.clip(np.ceil(probed / redundancy[h]), 1, _MOST_PROBES))
        for _ in range(probes):
            found = residuals_of(system, solution, _signs(groups, part, random))
            for g, other in enumerate(parts):
                traces[g, h] += float(np.sum(found[other.group][:, list(other.components)] ** 2)) / probes
    symmetric: Floats = 0.5 * (traces + traces.T)
    return symmetric


def _signs(
    groups: tuple[ObservationGroup, ...], part: Part, random: np.random.Generator
) -> tuple[Floats, ...]:
    """Whitened vectors (n, m) of all groups: random signs on one part, zero elsewhere."""
    vectors = tuple(np.zeros(group.stochastic.present.shape) for group in groups)
    columns = list(part.components)
    present: Bools = groups[part.group].stochastic.present[:, columns]
    vectors[part.group][:, columns] = np.where(present, random.choice((-1.0, 1.0), present.shape), 0.0)
    return vectors
