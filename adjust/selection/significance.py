"""Whether parameters differ from their given values: one by one, in groups, and between two sets.

    t_i = a_i / (σ0 √q_ii),   F = aᵀ Q_aa⁻¹ a / (k σ0²)

The F of a group is ((Ω_0 − Ω_1)/k)/(Ω_1/f), Ω_0 with the group held and Ω_1 with it free. σ0 is taken a
posteriori (t and F distributions) unless a known one is given (normal and χ² distributions). A parameter
with a pseudo-observation is tested as it was estimated, drawn to its given value: the test then errs on
the side of "not significant".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats, Ints
from adjust.selection.linear_estimate import LinearEstimate


@dataclass(frozen=True)
class GroupTest:
    """A test of several values against zero at once.

    Attributes
    ----------
    statistic : F; aᵀQ_aa⁻¹a/(k σ0²).
    parameters : k, the degrees of freedom of the numerator.
    redundancy : f, those of the denominator; infinite for a known σ0.
    critical : value that F exceeds with the error probability of the test when all true values are zero.
    probability : with which F is exceeded then.
    """

    statistic: float
    parameters: int
    redundancy: float
    critical: float
    probability: float

    @property
    def is_significant(self) -> bool:
        """Whether the values are not all zero."""
        return self.statistic > self.critical


@dataclass(frozen=True, eq=False)
class DifferenceTest:
    """Test whether two sets of parameters have the same values.

    Attributes
    ----------
    compared : (k,) which of the given pairs are compared: those that are not both held.
    difference : (k,) first minus second.
    sigma : (k,) its standard deviations.
    joint : the test of all differences together.
    """

    compared: Ints
    difference: Floats
    sigma: Floats
    joint: GroupTest

    @property
    def t(self) -> Floats:
        """(k,) each difference over its standard deviation."""
        return np.asarray(self.difference / self.sigma)


def t_values(estimate: LinearEstimate, sigma0: float | None = None) -> Floats:
    """The t (g,) of each free parameter, with the sign of its change; NaN where held.

    Parameters
    ----------
    sigma0 : a known σ0; None takes that of the estimate.
    """
    scale = estimate.sigma0 if sigma0 is None else sigma0
    variance = np.where(estimate.free, np.diagonal(estimate.cofactor), np.nan)
    return np.asarray(estimate.change / (scale * np.sqrt(variance)))


def entering_t_values(estimate: LinearEstimate, sigma0: float | None = None) -> Floats:
    """The t (g,) that each held parameter would have if it alone came in; NaN where free or undetermined."""
    pivot, rest = estimate.entering()
    usable = ~estimate.free & (pivot > 0.0)
    squares = np.where(usable, rest**2 / np.where(usable, pivot, 1.0), np.nan)
    if sigma0 is not None:
        return np.asarray(np.sign(rest) * np.sqrt(squares) / sigma0)
    left = estimate.weighted_squares + estimate.normals.prior_squares - squares
    freedom = estimate.redundancy - 1 + estimate.normals.has_prior
    variance = np.where((freedom > 0) & (left > 0.0), left / np.maximum(freedom, 1), 1.0)
    return np.asarray(np.sign(rest) * np.sqrt(squares / variance))


def limit_of_t(error_probability: float, redundancy: int | None) -> float:
    """Two-sided limit t_{f, 1 − α/2}; of the normal distribution for redundancy None (known σ0)."""
    tail = 1.0 - 0.5 * error_probability
    if redundancy is None or redundancy <= 0:
        return float(special.ndtri(tail))
    return float(special.stdtrit(redundancy, tail))


def group_test(
    estimate: LinearEstimate, members: Bools, error_probability: float, sigma0: float | None = None
) -> GroupTest:
    """F-test whether the free ones of some parameters (g,) are zero together, such as a whole set.

    Raises
    ------
    ValueError : if none of them is free.
    """
    chosen = np.flatnonzero(members & estimate.free)
    cofactor = estimate.cofactor[np.ix_(chosen, chosen)]
    return _joint(estimate, estimate.change[chosen], cofactor, error_probability, sigma0)


def difference_test(
    estimate: LinearEstimate,
    first: Ints,
    second: Ints,
    error_probability: float,
    sigma0: float | None = None,
) -> DifferenceTest:
    """Whether two sets have the same values: those of two flights, two heights, two cameras.

    d = a1 − a2,  Q_d = Q11 + Q22 − Q12 − Q21,  F = dᵀ Q_d⁻¹ d / (k σ0²).

    Parameters
    ----------
    first, second : (k,) indices of the parameters, in the same order; a held one is known to be zero,
        and a pair of two held ones cannot differ and is left out.

    Raises
    ------
    ValueError : if no pair is free.
    """
    compared = np.flatnonzero(estimate.free[first] | estimate.free[second])
    one, two = first[compared], second[compared]
    q = estimate.cofactor
    cofactor = q[np.ix_(one, one)] + q[np.ix_(two, two)] - q[np.ix_(one, two)] - q[np.ix_(two, one)]
    difference = estimate.change[one] - estimate.change[two]
    joint = _joint(estimate, difference, cofactor, error_probability, sigma0)
    scale = estimate.sigma0 if sigma0 is None else sigma0
    return DifferenceTest(compared, difference, np.asarray(scale * np.sqrt(np.diagonal(cofactor))), joint)


def _joint(
    estimate: LinearEstimate,
    values: Floats,
    cofactor: Floats,
    error_probability: float,
    sigma0: float | None,
) -> GroupTest:
    k = len(values)
    if k == 0:
        raise ValueError("none of the parameters of the test is free")
    # Units of many kinds in one matrix: scaled to a unit diagonal first.
    scale = 1.0 / np.sqrt(np.diagonal(cofactor))
    scaled = scale * values
    squares = float(scaled @ np.linalg.solve(cofactor * scale[:, None] * scale[None, :], scaled))
    if sigma0 is not None or estimate.redundancy <= 0:
        statistic = squares / (k * (1.0 if sigma0 is None else sigma0) ** 2)
        critical = 2.0 * float(special.gammainccinv(0.5 * k, error_probability)) / k
        probability = float(special.gammaincc(0.5 * k, 0.5 * k * statistic))
        return GroupTest(statistic, k, float("inf"), critical, probability)
    f = estimate.redundancy
    statistic = squares / (k * estimate.sigma0**2)
    critical = float(special.fdtri(k, f, 1.0 - error_probability))
    return GroupTest(statistic, k, float(f), critical, float(special.fdtrc(k, f, statistic)))
