"""Whether a block determines a parameter at all.

Significance asks whether a value differs from zero, determinability whether the block has anything to say
about it. A small correlation proves nothing where a prior has taken over; σ/σ_prior does.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.selection.linear_estimate import LinearEstimate

#: 1 − R² with all other free parameters below which nothing of a parameter is its own: its standard deviation
#: is a hundred times what it would be if the others were known.
INSEPARABLE = 1e-4
#: A parameter whose standard deviation is still this part of its prior has learnt nothing from the block.
PRIOR_ONLY = 0.975
# Part of the strongest from which a parameter is named among those another one cannot be separated from.
_INVOLVED = 0.3
_MOST_NAMED = 3


def own_part(estimate: LinearEstimate) -> Floats:
    """1 − R² (g,) of each free parameter with the other free ones, 0 to 1; NaN where held."""
    weight = np.full(len(estimate.free), np.nan)
    chosen = np.flatnonzero(estimate.free)
    known = np.diagonal(estimate.normals.normal)[chosen]
    weight[chosen] = 1.0 / (known * np.diagonal(estimate.cofactor)[chosen])
    return np.asarray(np.clip(weight, 0.0, 1.0))


def part_of_prior(estimate: LinearEstimate) -> Floats:
    """σ/σ_prior (g,) of each free parameter with a pseudo-observation; NaN for the others."""
    variance = np.where(estimate.free, np.diagonal(estimate.cofactor), np.nan)
    return np.asarray(np.sqrt(variance) / estimate.normals.prior_sigma)


def undetermined(estimate: LinearEstimate) -> Bools:
    """(g,) free parameters that the block does not determine: inseparable, or known by their prior alone."""
    with np.errstate(invalid="ignore"):
        return np.asarray((own_part(estimate) < INSEPARABLE) | (part_of_prior(estimate) > PRIOR_ONLY))


def entangled_with(estimate: LinearEstimate, d: int) -> Ints:
    """The free parameters from which parameter d is hardest to separate, strongest first, three at most.

    They are those that take over its effect when it is held: with the coefficients N_dF Q of the others
    without d, in units of the standard deviation each would have if all others were known.
    """
    without = estimate.without(d) if estimate.free[d] else estimate
    weight = np.sqrt(np.diagonal(without.normals.normal))
    share = np.abs(without.cofactor @ without.normals.normal[:, d]) * weight
    order = np.argsort(-share, kind="stable")[:_MOST_NAMED]
    return np.asarray(order[(share[order] > 0.0) & (share[order] >= _INVOLVED * share[order[0]])])
