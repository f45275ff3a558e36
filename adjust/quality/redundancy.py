"""Residuals and redundancy numbers of every observation.

For a whitened group with hat matrix H = A Q Aᵀ of one observation (m × m) the redundancy matrix is
I − H. The redundancy number of component i of correlated components is (Q_vv P)_ii; their sum over
all observations is n − u. The standardized residual is w = (P v)_i / √(P Q_vv P)_ii, which for
uncorrelated components is v/(σ √r), and the minimal detectable bias δ0/√(P Q_vv P)_ii, there
σ δ0/√r (Baarda 1968).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.observations.base import Linearization, ObservationGroup
from adjust.observations.image_point import ImagePoints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout, State
from adjust.quality.cofactor import Cofactor
from adjust.solve.normal_equations import System, add_border_columns, whiten


@dataclass(frozen=True, eq=False)
class GroupResiduals:
    """Residuals of one group; arrays (n, m), NaN where a component takes no part.

    Attributes
    ----------
    residual : v = adjusted − observed, SI and radians; also of rejected observations.
    redundancy : redundancy number r, 0 … 1.
    standardized : w, dimensionless, for an a-priori σ0 of 1; NaN where r is too small to divide by.
    detectable : minimal detectable bias at α0 = 0.1 % and a power of 80 %, SI and radians; NaN likewise.
    weighted_squares : vᵀPv of the group.
    """

    residual: Floats
    redundancy: Floats
    standardized: Floats
    detectable: Floats
    weighted_squares: float


# Below this redundancy number an observation is not controlled by others and w means nothing.
UNCONTROLLED = 0.1
# Below this the division by √r would only magnify rounding.
_NO_REDUNDANCY = 1e-6
# Non-centrality of the w-test for α0 = 0.1 % (two-sided) and power 80 %: 3.2905 + 0.8416.
NON_CENTRALITY = 4.132


def group_residuals(system: System, state: State, cofactor: Cofactor) -> tuple[GroupResiduals, ...]:
    """Residuals and redundancy numbers of all groups, in the order of ``observations.groups``."""
    rays = system.observations.image_points
    results = [_residuals_of_rays(rays, -rays.misclosure(state), cofactor.hat_of_rays)]
    for group in system.observations.others:
        equations = group.linearize(state)
        hat = hat_of_group(whiten(group, equations), system.layout, cofactor)
        results.append(_residuals(group, -equations.misclosure, hat))
    return tuple(results)


def hat_of_group(equations: Linearization, layout: ParameterLayout, cofactor: Cofactor) -> Floats:
    """Hat matrix (n, m, m) of the whitened observations of one group."""
    n, m = equations.misclosure.shape
    of_border = np.zeros((n, m, layout.border))
    of_exposure, image = np.zeros((n, m, 6)), np.zeros(n, dtype=np.int64)
    of_point, point = np.zeros((n, m, 3)), None
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            of_exposure, image = term.jacobian, term.index
        elif term.block == OBJECT_POINT:
            of_point, point = term.jacobian, term.index
        else:
            add_border_columns(of_border, layout.columns[term.block][term.index], term.jacobian)
    if point is not None:
        return of_point @ cofactor.of_points[point] @ np.swapaxes(of_point, 1, 2)
    transposed = np.swapaxes(of_border, 1, 2)
    hat: Floats = of_border @ cofactor.reduced.corner @ transposed
    if np.any(of_exposure):
        mixed = of_exposure @ cofactor.reduced.border[image] @ transposed
        own = of_exposure @ cofactor.reduced.of_exposures[image] @ np.swapaxes(of_exposure, 1, 2)
        hat = hat + mixed + np.swapaxes(mixed, 1, 2) + own
    return hat


def _residuals_of_rays(rays: ImagePoints, residual: Floats, hat: Floats) -> GroupResiduals:
    """The same as :func:`_residuals` for image points: uncorrelated components need no matrices.

    Parameters
    ----------
    hat : (n, 3) elements xx, xy, yy of the hat matrices.
    """
    active = rays.active[:, None]
    redundancy = np.where(active, 1.0 - hat[:, ::2], np.nan)
    with np.errstate(invalid="ignore"):
        root = np.where(redundancy > _NO_REDUNDANCY, np.sqrt(redundancy), np.nan)
    whitened = np.where(active, np.nan_to_num(residual), 0.0) * rays.inverse_sigma
    return GroupResiduals(
        residual,
        redundancy,
        whitened / root,
        NON_CENTRALITY * rays.sigma / root,
        float(np.sum(whitened**2)),
    )


def _residuals(group: ObservationGroup, residual: Floats, hat: Floats) -> GroupResiduals:
    """Redundancy numbers and standardized residuals from the hat matrices of whitened observations."""
    model = group.stochastic
    whitener = model.whitener
    transposed = np.swapaxes(whitener, 1, 2)
    remainder = np.eye(hat.shape[1]) - hat
    # Q_vv P = W⁻¹ (I − H) W; its diagonal needs no inverse: diag(Wᵀ (I − H) W ∘ Σ) with Σ = P⁻¹.
    weight = transposed @ whitener
    weighted = transposed @ remainder @ whitener
    redundancy = np.einsum("nij,nji->ni", _covariance(weight, model.present), weighted)
    scatter = np.diagonal(weighted, axis1=1, axis2=2)
    clean = np.where(model.present, np.nan_to_num(residual), 0.0)
    pulled = np.einsum("nij,nj->ni", weight, clean)
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.where(redundancy > _NO_REDUNDANCY, np.sqrt(scatter), np.nan)
    whitened = np.einsum("nij,nj->ni", whitener, clean)
    return GroupResiduals(
        np.where(np.isnan(model.sigma), np.nan, residual),
        np.where(model.present, redundancy, np.nan),
        np.where(model.present, pulled / root, np.nan),
        np.where(model.present, NON_CENTRALITY / root, np.nan),
        float(np.sum(whitened**2)),
    )


def _covariance(weight: Floats, present: Bools) -> Floats:
    """Inverse (n, m, m) of the weight matrices on the present components, zero elsewhere."""
    m = present.shape[1]
    absent = np.zeros_like(weight)
    diagonal = np.arange(m)
    absent[:, diagonal, diagonal] = np.where(present, 0.0, 1.0)
    inverse = np.linalg.inv(weight + absent)
    both = present[:, :, None] & present[:, None, :]
    return np.where(both, inverse, 0.0)
