"""Correlation times: how long the errors of a group last, from its residuals.

The restricted likelihood of the residuals is largest where, with the inverse T(τ) of the correlations of the
standardized observations u (see :mod:`adjust.observations.gauss_markov`) and G = A Q Aᵀ,

    uᵀ T' u = tr(Q_uu T'),    Q_uu = T⁻¹ − G

(Patterson and Thompson 1971). T' is tridiagonal along the strips, so the right side is known exactly from
the cofactors of successive exposures. For whitened observations T' stands as K = −D⁻ᵀ T' D⁻¹, and the
information that τ shares with the variance components is S_gh = tr(R K_g R K_h), with K_g = 1 on its own rows
for a variance component g: one system for all of them.

What is estimated is ζ = artanh φ of the median interval of successive exposures: near φ = 0 it is φ itself,
near φ = 1 ½ log τ but for a constant. Errors of strips of n exposures, directly observed, would determine it
with the standard deviation

    σ_ζ ~ 1/√(1 − φ² (n − 2)/n)

which grows with φ, because σ and τ are less and less distinguished. The confidence limits are those values of
ζ with whose own σ_ζ the estimate would just be compatible (as Wilson 1927 for a proportion); its size at the
estimate comes from S.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.gauss_markov import GaussMarkov, Neighbours, Stencil
from adjust.parameters import State
from adjust.quality.cofactor import Cofactor
from adjust.quality.single_error import hat_matrices
from adjust.solve.system import System
from adjust.solve.whitening import standardize

#: Correlation of successive exposures below which errors count as white.
NO_CORRELATION = 0.01
#: Correlation times beyond so many times the longest strip count as those of a constant bias.
STRIPS_TOO_LONG = 10.0
Verdict = Literal["estimated", "none", "longer", "undetermined", "stated"]
# Values of ζ that are tried for the confidence limits: a thousandth of the whole range.
_VALUES = 1001
# No step of ζ goes further: the likelihood is not a parabola.
_LONGEST_STEP = 0.5


@dataclass(frozen=True)
class CorrelationTime:
    """A correlation time after the adjustment.

    Attributes
    ----------
    group : index of the group in ``Observations.groups``.
    name : of the group.
    seconds : estimated, or as stated.
    lower, upper : confidence limits, seconds; 0 and infinity where the errors may be white, or constant along
        the strips; NaN where nothing was estimated.
    redundancy : of the group.
    verdict : "estimated"; "none", the errors may as well be white; "longer", they may as well be constant
        along the strips; "undetermined", both; "stated", nothing was estimated.
    """

    group: int
    name: str
    seconds: float
    lower: float
    upper: float
    redundancy: float
    verdict: Verdict


def limits_of(process: GaussMarkov) -> tuple[float, float]:
    """Smallest and largest ζ that strips like these can tell from none and from a constant."""
    longest = np.exp(-process.interval / (STRIPS_TOO_LONG * process.longest_strip))
    return float(np.arctanh(NO_CORRELATION)), float(np.arctanh(longest))


def zeta_of(process: GaussMarkov, seconds: float) -> float:
    """ζ = artanh φ of a correlation time, within the limits."""
    correlation = np.exp(-process.interval / seconds)
    lower, upper = limits_of(process)
    return float(np.clip(np.arctanh(correlation), lower, upper))


def seconds_of(process: GaussMarkov, zeta: float) -> float:
    """Correlation time of a ζ, seconds; 0 where ζ is not positive."""
    if zeta <= 0.0:
        return 0.0
    correlation = np.tanh(zeta)
    return float(-process.interval / np.log(correlation)) if correlation < 1.0 else float("inf")


def _derivative(process: GaussMarkov, neighbours: Neighbours) -> tuple[Floats, Floats, Stencil]:
    """dφ/dζ (n,) towards the neighbours before and after, and the rows of T'."""
    own = np.exp(-process.interval / process.correlation_time)
    per_zeta = -np.expm1(-2.0 * process.interval / process.correlation_time) / (
        own * process.interval / process.correlation_time
    )
    # dφ/d log τ = φ Δt/τ.
    changes = [
        per_zeta * correlation * np.abs(process.time - process.time[index]) / process.correlation_time
        for correlation, index in (
            (neighbours.of_before, neighbours.before),
            (neighbours.of_after, neighbours.after),
        )
    ]
    return changes[0], changes[1], neighbours.weights_derivative(*changes)


def along_derivative(model: StochasticModel, white: Floats) -> Floats:
    """K z (n, m) of whitened vectors of a group."""
    process, neighbours = model.over_time, model.neighbours
    assert process is not None
    assert neighbours is not None
    *_, stencil = _derivative(process, neighbours)
    changed = neighbours.combined(stencil, neighbours.correlated(white))
    return -neighbours.correlated(changed, transposed=True)


def score(system: System, state: State, quality: Cofactor, group: ObservationGroup) -> float:
    """Twice the derivative of the restricted log-likelihood by ζ: tr(Q_uu T') − uᵀ T' u.

    Of the residuals, and of Q_uu, what the most probable errors of considered parameters leave.
    """
    process, neighbours = group.stochastic.over_time, group.stochastic.neighbours
    assert process is not None
    assert neighbours is not None
    before, _, stencil = _derivative(process, neighbours)
    alone = standardize(group, group.linearize(state))
    changed = alone.combined(neighbours, stencil)
    residual, its = -alone.misclosure, -changed.misclosure
    hat = np.einsum("nii->", hat_matrices(alone, changed, system.layout, quality))
    if (considered := quality.considered) is not None:
        moved, moved_its = considered.of_computed(alone), considered.of_computed(changed)
        residual, its = (
            residual - moved @ considered.most_probable,
            its - moved_its @ considered.most_probable,
        )
        hat += np.sum((moved @ considered.remaining_root) * (moved_its @ considered.remaining_root))
    of_correlations = 2.0 * np.sum(
        np.where(neighbours.taking_part, neighbours.of_before * before / neighbours.free_of_before, 0.0)
    )
    expected = alone.misclosure.shape[1] * of_correlations - hat
    return float(expected - np.sum(residual * its))


def moved(process: GaussMarkov, step: float) -> float:
    """Ratio of the correlation time after a step of ζ to that before, within the limits."""
    start = zeta_of(process, process.correlation_time)
    lower, upper = limits_of(process)
    end = float(np.clip(start + np.clip(step, -_LONGEST_STEP, _LONGEST_STEP), lower, upper))
    return seconds_of(process, end) / process.correlation_time


def is_stopped(process: GaussMarkov, uphill: float) -> bool:
    """Whether ζ is at a limit and the likelihood rises beyond it."""
    lower, upper = limits_of(process)
    zeta = zeta_of(process, process.correlation_time)
    return bool((zeta <= lower and uphill < 0.0) or (zeta >= upper and uphill > 0.0))


def stated_or_estimated(
    group: int, name: str, process: GaussMarkov, redundancy: float, variance: float, confidence: float
) -> CorrelationTime:
    """The correlation time of a group with its limits.

    Parameters
    ----------
    variance : of ζ; NaN where nothing was estimated.
    """
    seconds = process.correlation_time
    if not np.isfinite(variance):
        nothing = float("nan")
        return CorrelationTime(group, name, seconds, nothing, nothing, redundancy, "stated")
    lower, upper = _compatible(process, variance, confidence)
    may_be_white, may_be_constant = np.isneginf(lower), np.isposinf(upper)
    verdicts: dict[tuple[bool, bool], Verdict] = {
        (False, False): "estimated",
        (True, False): "none",
        (False, True): "longer",
        (True, True): "undetermined",
    }
    return CorrelationTime(
        group,
        name,
        seconds,
        0.0 if may_be_white else seconds_of(process, lower),
        float("inf") if may_be_constant else seconds_of(process, upper),
        redundancy,
        verdicts[bool(may_be_white), bool(may_be_constant)],
    )


def _compatible(process: GaussMarkov, variance: float, confidence: float) -> tuple[float, float]:
    """Smallest and largest ζ that the estimate is compatible with; infinite where that is a limit."""
    zeta, (least, most) = zeta_of(process, process.correlation_time), limits_of(process)
    part = 1.0 - 2.0 / process.exposures_of_a_strip
    values = np.linspace(least, most, _VALUES)
    distance = (values - zeta) ** 2 * (1.0 - part * np.tanh(values) ** 2)
    quantile = special.ndtri(0.5 + 0.5 * confidence)
    allowed = distance <= quantile**2 * variance * (1.0 - part * np.tanh(zeta) ** 2)
    inside = values[allowed | (np.abs(values - zeta) <= values[1] - values[0])]
    return (
        float("-inf") if inside[0] == least else float(inside[0]),
        float("inf") if inside[-1] == most else float(inside[-1]),
    )
