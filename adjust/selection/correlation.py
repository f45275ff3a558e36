"""Correlations of parameters: pairwise and total.

The total (multiple) correlation R_i of a parameter with others is that with the best linear combination
of them: R_i² = 1 − 1/(n_ii q_ii), where 1/q_ii is its weight when all others are unknown, and n_ii when they
are known. Which others are meant makes three versions, distinguished by n_ii.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse.csgraph import connected_components

from adjust.arrays import Bools, Floats
from adjust.selection.linear_estimate import LinearEstimate


def correlation_matrix(cofactor: Floats) -> Floats:
    """Correlations (g, g) of parameters with the cofactor matrix Q (g, g); NaN for a zero variance."""
    variance = np.diagonal(cofactor)
    scale = 1.0 / np.sqrt(np.where(variance > 0.0, variance, np.nan))
    return np.asarray(cofactor * scale[:, None] * scale[None, :])


def correlated_groups(correlation: Floats, limit: float) -> Mapping[tuple[int, ...], float]:
    """Groups in which a chain of correlations beyond ±limit links all members, the strongest first.

    Parameters
    ----------
    correlation : (g, g) of the parameters; NaN links nothing.

    Returns
    -------
    Members of each group → the correlation of its most strongly correlated pair.
    """
    if len(correlation) == 0:
        return {}
    apart = np.where(np.eye(len(correlation), dtype=bool), 0.0, np.nan_to_num(correlation))
    _, label = connected_components(np.abs(apart) > limit, directed=False)
    groups = {}
    for one in np.unique(label):
        members = np.flatnonzero(label == one)
        own = apart[np.ix_(members, members)].ravel()
        if len(members) > 1:
            groups[tuple(members.tolist())] = float(own[np.argmax(np.abs(own))])
    return dict(sorted(groups.items(), key=lambda group: -abs(group[1])))


def total_correlation(cofactor: Floats) -> Floats:
    """Correlation R (g,) of each parameter with all others of the cofactor matrix Q (g, g), 0 to 1.

    n_ii = (Q⁻¹)_ii: the others of the matrix are known, everything else remains unknown.
    """
    if len(cofactor) == 0:
        return np.zeros(0)
    # Of the correlation matrix: its diagonal is one, and units do not spoil the inverse.
    inverse = np.linalg.inv(correlation_matrix(cofactor))
    return _total(np.diagonal(inverse))


def total_correlation_within(estimate: LinearEstimate, members: Bools) -> Floats:
    """R (g,) of each free one of the members (g,) with the other free ones; NaN elsewhere."""
    chosen = np.flatnonzero(members & estimate.free)
    result = np.full(len(members), np.nan)
    result[chosen] = total_correlation(estimate.cofactor[np.ix_(chosen, chosen)])
    return result


def total_correlation_in_block(estimate: LinearEstimate) -> Floats:
    """R (g,) of each free parameter with all exposures and all other free parameters; NaN where held.

    n_ii = S_ii of the reduced system: only the object points are unknown.
    """
    variance = np.where(estimate.free, np.diagonal(estimate.cofactor), np.nan)
    return _total(variance * estimate.normals.reduced_diagonal)


def variance_inflation(total: Floats) -> Floats:
    """VIF = 1/(1 − R²): by how much the others, being unknown, multiply the variance."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (1.0 - total**2))


def _total(inflation: Floats) -> Floats:
    return np.asarray(np.sqrt(np.clip(1.0 - 1.0 / inflation, 0.0, 1.0)))
