"""Residuals and redundancy numbers of every observation.

For a whitened group with hat matrix H = A Q Aᵀ of one observation (m × m) the redundancy matrix is
I − H. The redundancy number of component i of correlated components is (Q_vv P)_ii; their sum over
all observations is n − u. The standardized residual is w = (P v)_i / √(P Q_vv P)_ii, which for
uncorrelated components is v/(σ √r), and the minimal detectable bias δ0/√(P Q_vv P)_ii, there
σ δ0/√r (Baarda 1968). How well an error shows is told by σ² (P Q_vv P)_ii = (δ0 σ/∇₀)²: r itself for
uncorrelated components, more than r for an error that its correlated company betrays. Where errors are
correlated over time, P joins an observation with its neighbours; see :mod:`adjust.quality.single_error`.

Errors of considered parameters add b̃ C b̃ᵀ to the variance of a residual, and nothing to what an error of
the observation does: w is smaller and ∇₀ larger by the root of the ratio of both variances.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.observations.base import ObservationGroup
from adjust.parameters import State
from adjust.quality.cofactor import Cofactor
from adjust.quality.detectability import NON_CENTRALITY
from adjust.quality.residual_kernel import statistics_of_rays
from adjust.quality.single_error import SingleErrors, equations_at, single_errors
from adjust.solve.lanes import Lane, in_order, lanes
from adjust.solve.system import System


@dataclass(frozen=True, eq=False)
class GroupResiduals:
    """Residuals of one group; arrays (n, m), NaN where a component is not used.

    Attributes
    ----------
    residual : v = adjusted − observed, SI and radians; also of rejected observations.
    redundancy : redundancy number r, 0 … 1; with errors correlated over time it may lie a little outside.
    control : σ² (P Q_vv P)_ii, without correlations r: an error of σ δ0/√control is found.
    standardized : w, dimensionless, for an a-priori σ0 of 1; NaN where r is too small to divide by.
    detectable : minimal detectable bias at α0 = 0.1 % and a power of 80 %, SI and radians; NaN likewise.
    weighted_squares : vᵀPv of the group.
    """

    residual: Floats
    redundancy: Floats
    control: Floats
    standardized: Floats
    detectable: Floats
    weighted_squares: float


# Below this the division by √r would only magnify rounding.
_NO_REDUNDANCY = 1e-6


def group_residuals(
    system: System, state: State, cofactor: Cofactor, linearization: State | None = None
) -> tuple[GroupResiduals, ...]:
    """Residuals and redundancy numbers of all groups, in the order of ``observations.groups``.

    Parameters
    ----------
    linearization : the state of the cofactors; None: that of the residuals.
    """
    others = residuals_of_others(system, state, cofactor, linearization)
    return _residuals_of_rays(system, state, cofactor), *others


def residuals_of_others(
    system: System, state: State, cofactor: Cofactor, linearization: State | None = None
) -> tuple[GroupResiduals, ...]:
    """Those of all groups but the image points."""
    results = []
    for group in system.observations.others:
        equations = equations_at(group, state, linearization or state)
        found = single_errors(group, equations, system.layout, cofactor)
        results.append(_residuals(group, -equations.misclosure, found))
    return tuple(results)


def _residuals_of_rays(system: System, state: State, cofactor: Cofactor) -> GroupResiduals:
    """The same as :func:`_residuals` for image points: uncorrelated components need no matrices."""
    rays, hat, added = system.observations.image_points, cofactor.hat_of_rays, None
    if cofactor.considered is not None:
        of_considered = cofactor.considered.covariance_of_rays(rays)
        added = np.ascontiguousarray(np.diagonal(of_considered, axis1=1, axis2=2))
    residual, redundancy, standardized, detectable = (np.empty((len(rays.image), 2)) for _ in range(4))

    def work(lane: Lane) -> float:
        first, last = (int(system.point_start[index]) for index in lane)
        np.negative(rays.misclosure(state, first, last), out=residual[first:last])
        squares: float = statistics_of_rays(
            residual[first:last],
            hat[first:last],
            rays.sigma[first:last],
            rays.active[first:last],
            None if added is None else added[first:last],
            _NO_REDUNDANCY,
            redundancy[first:last],
            standardized[first:last],
            detectable[first:last],
            NON_CENTRALITY,
        )
        return squares

    squares = sum(in_order(work, lanes(system.point_start), system.threads))
    return GroupResiduals(residual, redundancy, redundancy, standardized, detectable, squares)


def _residuals(group: ObservationGroup, residual: Floats, found: SingleErrors) -> GroupResiduals:
    """Redundancy numbers and standardized residuals of the components of a group."""
    model = group.stochastic
    whitener = model.whitener
    transposed = np.swapaxes(whitener, 1, 2)
    # Q_vv P = W⁻¹ (I − L) W; its diagonal needs no inverse: diag(Wᵀ (I − L) W ∘ Σ) with Σ = W⁻¹ W⁻ᵀ.
    weighted = transposed @ (np.eye(whitener.shape[1]) - found.leverage) @ whitener
    unwhitener = model.unwhitener
    redundancy = np.einsum("nij,nji->ni", unwhitener @ np.swapaxes(unwhitener, 1, 2), weighted)
    scatter = np.diagonal(transposed @ found.inside @ whitener, axis1=1, axis2=2)
    added = np.diagonal(transposed @ found.considered @ whitener, axis1=1, axis2=2)
    clean = np.where(model.present, np.nan_to_num(residual), 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.where(scatter > _NO_REDUNDANCY * model.weight_diagonal(), np.sqrt(scatter), np.nan)
        growth = np.sqrt(1.0 + added / scatter)
    return GroupResiduals(
        np.where(np.isnan(model.sigma), np.nan, residual),
        np.where(model.present, redundancy, np.nan),
        np.where(model.present, scatter * model.sigma**2, np.nan),
        np.where(model.present, model.weighted(clean) / root / growth, np.nan),
        np.where(model.present, NON_CENTRALITY / root * growth, np.nan),
        float(np.sum(model.whitened(clean) ** 2)),
    )
