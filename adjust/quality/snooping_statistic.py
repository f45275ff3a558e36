"""Test statistics of whole observations, all on the scale of a standard normal variable.

A gross error in one component is tested by w = (P v)_i / √(P Q_vv P)_ii (Baarda 1968), one in an
observation of m components by

    T = vᵀ Q_vv⁻ v = uᵀ R⁻ u ~ χ²_m,    u = W v,    R = I − H

over the directions in which R controls it (eigenvalue ≥ 0.1). If σ0 is not trusted, σ0² comes from
the other residuals: x = 1 − T/Ω has the beta distribution B((f − m)/2, m/2) with Ω = vᵀPv and f
degrees of freedom; for m = 1 this is the τ-test (Pope 1976). So that one critical value serves all of
them and "largest first" compares like with like, every statistic is expressed as the |w| of a standard
normal variable that is exceeded with the same probability.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats, Ints
from adjust.observations.base import StochasticModel
from adjust.quality.detectability import UNCONTROLLED

# Logarithms of probabilities below this are rounding of an underflow.
_UNDERFLOW = -700.0


@dataclass(frozen=True)
class EstimatedVariance:
    """σ0² from the residuals: vᵀPv and its degrees of freedom."""

    weighted_squares: float
    redundancy: int


def normal_equivalent(
    statistic: Floats, dimension: Ints, variance: EstimatedVariance | None = None
) -> Floats:
    """The |w| that is exceeded with the probability with which χ²_m exceeds T; 0 where m is 0.

    Parameters
    ----------
    statistic : T of an adjustment with σ0 = 1.
    dimension : m, 0 to 3, of the same shape.
    variance : what T is to be compared with; None: σ0 is 1.
    """
    tail = _log_tail(np.maximum(statistic, 0.0), dimension)
    if variance is not None:
        tail = _log_beta_tail(statistic, dimension, variance, tail)
    result: Floats = np.where(dimension > 0, -special.ndtri_exp(np.minimum(tail, 0.0) - np.log(2.0)), 0.0)
    return result


def _log_tail(statistic: Floats, dimension: Ints) -> Floats:
    """Logarithm of P(χ²_m > T) for m = 1, 2, 3, without underflow."""
    root = np.sqrt(0.5 * statistic)
    tail = np.log(special.erfcx(root))
    tail = np.where(dimension == 2, 0.0, tail)
    with_density = np.log(special.erfcx(root) + 2.0 / np.sqrt(np.pi) * root)
    logarithm: Floats = np.where(dimension == 3, with_density, tail) - 0.5 * statistic
    return logarithm


def _log_beta_tail(statistic: Floats, dimension: Ints, variance: EstimatedVariance, known: Floats) -> Floats:
    """Logarithm of P of the same with σ0² estimated; where that underflows, of T over the estimated σ0²."""
    freedom = variance.redundancy - dimension
    usable = (freedom > 0) & (dimension > 0)
    x = np.clip(1.0 - statistic / max(variance.weighted_squares, np.finfo(float).tiny), 0.0, 1.0)
    probability = special.betainc(0.5 * np.where(usable, freedom, 1), 0.5 * np.where(usable, dimension, 1), x)
    with np.errstate(divide="ignore"):
        tail = np.log(probability)
    # Only the order of the largest ones hangs on this.
    tail = np.where(tail < _UNDERFLOW, np.minimum(known, _UNDERFLOW), tail)
    logarithm: Floats = np.where(usable, tail, 0.0)
    return logarithm


def directional_statistic(whitened: Floats, remainder: Floats) -> tuple[Floats, Ints]:
    """T (n,) and its dimension (n,) over the directions that are controlled.

    Parameters
    ----------
    whitened : (n, m) u, zero for what is not used; with errors correlated over time the pull.
    remainder : (n, m, m) its cofactor R; for a prediction I + H.
    """
    values, vectors = np.linalg.eigh(remainder)
    controlled = values >= UNCONTROLLED
    along = np.einsum("nij,ni->nj", vectors, whitened)
    squares = np.where(controlled, along**2 / np.where(controlled, values, 1.0), 0.0)
    return np.sum(squares, axis=1), np.sum(controlled, axis=1)


def whitened_residuals(model: StochasticModel, residual: Floats) -> Floats:
    """W v (n, m); zero for what is not used."""
    clean = np.where(model.present, np.nan_to_num(residual), 0.0)
    return model.standardized(clean)


def of_present(model: StochasticModel, matrices: Floats) -> Floats:
    """Matrices (n, m, m) on the components that are used, zero elsewhere."""
    return np.where(model.present[:, :, None] & model.present[:, None, :], matrices, 0.0)
