"""Expected root mean square, mean and largest value of correlated errors of known covariance.

The mean square of q errors e ~ N(0, Σ) has the expectation tr Σ/q and the variance 2 tr Σ²/q². It is nearly
distributed as tr Σ/q · χ²_ν/ν with the degrees of freedom

    ν = (tr Σ)² / tr Σ²

(Satterthwaite 1946; Box 1954, theorem 3.1): q for independent errors of equal size, one if all errors are the
same. Errors of a calibration are common to all points, so many check points may hold little more than one
draw of it, and the limits between which the found value may lie are wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.georeferencing.sensitivity import Sensitivity

_DRAWS = 200
_DRAWS_AT_ONCE = 20


@dataclass(frozen=True)
class PredictedRms:
    """Prediction for the root mean square and the mean of q errors.

    Attributes
    ----------
    rms : √(tr Σ/q).
    degrees_of_freedom : ν.
    sigma_of_mean : standard deviation of the mean of all errors.
    """

    rms: float
    degrees_of_freedom: float
    sigma_of_mean: float

    def limits(self, confidence: float) -> tuple[float, float]:
        """Limits that contain the actual root mean square with this probability."""
        tail = 0.5 * (1.0 - confidence)
        quantiles = special.chdtri(self.degrees_of_freedom, np.array([1.0 - tail, tail]))
        low, high = self.rms * np.sqrt(quantiles / self.degrees_of_freedom)
        return float(low), float(high)


def predicted_rms(errors: Sensitivity, own_variance: Floats) -> PredictedRms:
    """Prediction for quantities that answer to common sources and have variances (q,) of their own.

    Raises
    ------
    ValueError : if there are no quantities, or nothing makes them wrong.
    """
    q = len(own_variance)
    by_sources = errors.variance()
    trace = float(by_sources.sum() + own_variance.sum())
    if q == 0 or not trace > 0.0:
        raise ValueError("There is no quantity for which a root mean square could be predicted.")
    trace_of_square = float(
        errors.trace_of_square() + 2.0 * own_variance @ by_sources + own_variance @ own_variance
    )
    return PredictedRms(
        float(np.sqrt(trace / q)),
        trace**2 / trace_of_square,
        float(np.sqrt(errors.variance_of_sum() + own_variance.sum())) / q,
    )


def rms_of_covariance(covariance: Floats) -> PredictedRms:
    """Prediction for errors of known covariance matrix (q, q).

    Raises
    ------
    ValueError : if there are no errors, or they are all zero.
    """
    q, trace = len(covariance), float(np.trace(covariance))
    if q == 0 or not trace > 0.0:
        raise ValueError("There is no quantity for which a root mean square could be predicted.")
    return PredictedRms(
        float(np.sqrt(trace / q)),
        trace**2 / float(np.sum(covariance**2)),
        float(np.sqrt(max(covariance.sum(), 0.0))) / q,
    )


@dataclass(frozen=True)
class PredictedLargest:
    """Prediction for the largest size of q errors.

    Attributes
    ----------
    median : exceeded in half of all cases.
    limit : exceeded in one of twenty.
    """

    median: float
    limit: float


def predicted_largest(errors: Sensitivity, own_variance: Floats, seed: int = 0) -> PredictedLargest:
    """Prediction from draws of all sources: the largest of correlated errors has no closed distribution.

    200 draws leave an uncertainty of some 2 % to the median; the same seed gives the same numbers.
    """
    own, random = np.sqrt(own_variance)[:, None], np.random.default_rng(seed)
    largest = [
        np.abs(
            errors.draws(random, _DRAWS_AT_ONCE) + own * random.standard_normal((len(own), _DRAWS_AT_ONCE))
        ).max(axis=0)
        for _ in range(_DRAWS // _DRAWS_AT_ONCE)
    ]
    median, limit = np.quantile(np.concatenate(largest), [0.5, 0.95])
    return PredictedLargest(float(median), float(limit))
