"""Standard deviation and degrees of freedom of a mean of strips of which part of the errors is known.

Strip k shows d_k = d + a_k + e_k: a has the known covariance matrix Q (errors of the adjustment, partly
common to all strips), e_k are errors of GNSS and INS of each strip with an unknown variance s².
Contrasts c_j between the strips, along the eigenvectors of Q without its mean, are independent with the
variances s² + λ_j. With s² given, the mean with weights w has the variance s² Σ w² + wᵀ Q w; of the
second part only λ shows in the scatter.

A few strips do not determine s². Whatever it is, Σ_j c_j² / (s² + λ_j) has the χ²-distribution with k − 1
degrees of freedom, and falls with s²: each value of χ² belongs to one s², or to s² = 0 where the scatter is
less than the known errors alone would make it. So the error of the mean has not one normal distribution
but a mixture of them, over the s² that the distribution of χ² gives (generalized pivotal quantity, Weerahandi
1993, with s² not below zero). Without known errors that is exactly Student's t with k − 1 degrees of freedom
and the scatter of the strips over √k; where known errors prevail, the normal distribution; in between σ is
rather too large than too small. Stated are σ and ν of the t-distribution with the same central intervals of
68.3 and 95 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats, Ints

_INNER, _OUTER = float(special.ndtr(1.0)), 0.975
# More degrees of freedom are as good as all.
_MOST, _LEAST = 1e6, 0.5
# χ² of one degree of freedom, and at how many places; halvings of the range of s².
_RANGE, _PLACES = (1e-10, 1e3), 300
_HALVINGS = 60


@dataclass(frozen=True, slots=True, eq=False)
class MeanSigma:
    """σ and degrees of freedom of one component of the mean of k strips.

    Attributes
    ----------
    sigma : standard deviation σ of the mean; times Student's quantile it is a limit of confidence.
    freedom : ν.
    known : √(wᵀ Q w), its part by known errors.
    """

    sigma: float
    freedom: float
    known: float


def mean_sigma(strips: Floats, covariance: Floats, count: Ints) -> MeanSigma:
    """σ and ν of the mean of k > 1 strips.

    Parameters
    ----------
    strips : (k,) what each shows.
    covariance : (k, k) Q.
    count : (k,) their exposures: the weights w are their shares.
    """
    k = len(strips)
    across = np.linalg.svd(np.ones((1, k)))[2][1:]
    values, axes = np.linalg.eigh(across @ covariance @ across.T)
    share = count / count.sum()
    known = float(share @ covariance @ share)
    squares = (axes.T @ (across @ strips)) ** 2
    variance, mass = _mixture(squares, np.maximum(values, 0.0))
    sigma = np.sqrt(variance * float(share @ share) + known)
    if not np.any(sigma > 0.0):
        return MeanSigma(0.0, float(k - 1), 0.0)
    inner, outer = (_quantile(sigma, mass, level) for level in (_INNER, _OUTER))
    freedom = _freedom(outer / inner)
    return MeanSigma(inner / float(special.stdtrit(freedom, _INNER)), freedom, float(np.sqrt(known)))


def widening(freedom: Floats | float, level: float = _OUTER) -> Floats:
    """Student's quantile divided by the normal one, for a σ with this number of degrees of freedom.

    Parameters
    ----------
    level : one-sided probability of the limits it is used for.
    """
    finite = np.clip(np.nan_to_num(freedom, nan=_MOST, posinf=_MOST), _LEAST, _MOST)
    return np.where(finite < _MOST, special.stdtrit(finite, level) / special.ndtri(level), 1.0)


def _mixture(squares: Floats, known: Floats) -> tuple[Floats, Floats]:
    """Values (n,) of s², and the probability of each.

    Parameters
    ----------
    squares, known : (k − 1,) c², λ.
    """
    freedom = len(squares)
    # The spread of log χ² falls with the root of its degrees of freedom.
    part = np.geomspace(*_RANGE, _PLACES) ** (1.0 / np.sqrt(freedom))
    chi = freedom * part
    mass = np.exp(0.5 * freedom * (np.log(part) - part + 1.0))  # equal steps of log χ², 1 at the most
    # With no known errors s² = Σ c² / χ²; known ones leave less of it.
    low, high = np.zeros(_PLACES), squares.sum() / chi
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        with np.errstate(divide="ignore", invalid="ignore"):
            more = np.sum(squares / (middle[:, None] + known), axis=1) > chi
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return high, mass / mass.sum()


def _quantile(sigma: Floats, mass: Floats, level: float) -> float:
    """Of a mixture of normal distributions about zero."""

    def excess(value: float) -> float:
        with np.errstate(divide="ignore"):
            return float(mass @ special.ndtr(value / sigma)) - level

    # Loaded late: few blocks need it, and it takes a tenth of a second.
    from scipy import optimize

    kept = sigma[mass > 1e-12]
    high = float(kept.max()) * 10.0
    return float(optimize.brentq(excess, 0.0, high, xtol=1e-9 * high, rtol=1e-8))


def _freedom(ratio: float) -> float:
    """ν at which the quantiles of Student's t have this ratio."""

    def excess(logarithm: float) -> float:
        freedom = np.exp(logarithm)
        return float(special.stdtrit(freedom, _OUTER) / special.stdtrit(freedom, _INNER)) - ratio

    from scipy import optimize

    low, high = float(np.log(_LEAST)), float(np.log(_MOST))
    if excess(high) >= 0.0:
        return _MOST
    return float(np.exp(optimize.brentq(excess, low, high))) if excess(low) > 0.0 else _LEAST
