"""Weighted mean of vectors that is robust against gross errors, with a realistic standard deviation.

Minimised is Σ ρ(v_ij / s_j) with Huber's ρ, k = 1.5 (Huber 1964): residuals up to k robust standard
deviations count in full, larger ones linearly. Each observation has the weight matrix C_i⁻¹; the factors of
its components enter on both sides, F^½ C_i⁻¹ F^½, so that correlated components stay consistent. The scale
s_j is 1.4826 times the median of |v_ij| / √C_ijj about the median.

The exposures of one strip share the errors of GNSS and INS. The standard deviation of the mean therefore
comes from sums of influences over whole strips (the cluster-robust, or sandwich, estimate), not from n
exposures taken as independent: with m equal strips it is the standard deviation of their means over √m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints

#: Robust standard deviations up to which a residual counts in full.
HUBER_LIMIT = 1.5
# Median of |v| over σ of normally distributed v.
_NORMAL_MAD = 0.6744897501960817
_MOST_ROUNDS = 100
_SETTLED = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class RobustMean:
    """Means of m components of n observations.

    Attributes
    ----------
    plain : (m,) arithmetic mean.
    plain_sigma : (m,) its standard deviation; NaN with one observation.
    robust : (m,) weighted robust mean.
    robust_sigma : (m,) its standard deviation, likewise.
    rms : (m,) root mean square about the robust mean, gross errors included.
    scatter : (m,) robust standard deviation of one observation.
    weight : (n, m) factors 0 … 1 by which the components of each observation count.
    clusters : number of strips; with one, the standard deviations hold within that strip only.
    """

    plain: Floats
    plain_sigma: Floats
    robust: Floats
    robust_sigma: Floats
    rms: Floats
    scatter: Floats
    weight: Floats
    clusters: int


def robust_mean(values: Floats, cluster: Ints, covariance: Floats | None = None) -> RobustMean:
    """Plain and robust mean.

    Parameters
    ----------
    values : (n, m), n ≥ 1.
    cluster : (n,) the strip of each.
    covariance : (n, m, m) relative or absolute; None: all alike, components uncorrelated. It may be
        singular.
    """
    count, m = values.shape
    spread = np.ones((count, m)) if covariance is None else np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    plain = values.mean(axis=0)
    start = np.median(values, axis=0)
    scale = _robust_scale((values - start) / spread)
    base: Floats = np.broadcast_to(np.eye(m), (count, m, m))
    if covariance is not None:
        base = np.asarray(np.linalg.pinv(covariance, hermitian=True))
    mean, factor = _iterate(values, start, base, spread * scale)
    residual = values - mean
    weighted = _weighted(base, factor)
    normal = weighted.sum(axis=0)
    influence = np.einsum("nij,nj->ni", weighted, residual) @ np.linalg.pinv(normal)
    # Huber's correction: only residuals within the limit determine the mean.
    inside = np.maximum((factor >= 1.0).mean(axis=0), 1.0 / count)
    return RobustMean(
        plain=plain,
        plain_sigma=_cluster_sigma((values - plain) / count, cluster),
        robust=mean,
        robust_sigma=_cluster_sigma(influence * factor.mean(axis=0) / inside, cluster),
        rms=np.sqrt(np.mean(residual**2, axis=0)),
        scatter=_robust_scale(residual),
        weight=factor,
        clusters=len(np.unique(cluster)),
    )


def _iterate(values: Floats, start: Floats, base: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Mean (m,) and factors (n, m), iteratively re-weighted from the median."""
    mean = start
    factor = _huber((values - mean) / sigma)
    for _ in range(_MOST_ROUNDS):
        weighted = _weighted(base, factor)
        right = np.einsum("nij,nj->i", weighted, values - mean)
        step = np.linalg.pinv(weighted.sum(axis=0)) @ right
        mean = mean + step
        factor = _huber((values - mean) / sigma)
        if np.all(np.abs(step) <= _SETTLED * sigma.min(axis=0)):
            break
    return mean, factor


def _huber(standardized: Floats) -> Floats:
    return HUBER_LIMIT / np.maximum(np.abs(standardized), HUBER_LIMIT)


def _weighted(base: Floats, factor: Floats) -> Floats:
    root = np.sqrt(factor)
    return np.asarray(root[:, :, None] * base * root[:, None, :])


def _robust_scale(residual: Floats) -> Floats:
    """Robust standard deviations (m,); the ordinary ones, at least tiny, where half are equal."""
    scale = np.median(np.abs(residual - np.median(residual, axis=0)), axis=0) / _NORMAL_MAD
    ordinary = np.maximum(residual.std(axis=0), np.finfo(np.float64).tiny ** 0.5)
    return np.where(scale > 0.0, scale, ordinary)


def _cluster_sigma(influence: Floats, cluster: Ints) -> Floats:
    """Standard deviations (m,) of a mean from the influences (n, m) of its observations."""
    number = np.unique(cluster, return_inverse=True)[1]
    if number.max(initial=0) == 0:
        # One strip: its exposures are all there is.
        number = np.arange(len(influence))
    total = np.zeros((int(number.max(initial=0)) + 1, influence.shape[1]))
    np.add.at(total, number, influence)
    groups = len(total)
    if groups < 2:
        return np.full(influence.shape[1], np.nan)
    return np.asarray(np.sqrt(groups / (groups - 1.0) * np.sum(total**2, axis=0)))
