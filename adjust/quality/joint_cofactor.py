"""Joint cofactors of some object points, which the selected inverse does not hold.

With N_j the normal matrix of point j, C_j its mixed part with exposures and system parameters, and S the
reduced system,

    Q_ij = δ_ij N_j⁻¹ + N_i⁻¹ C_iᵀ S⁻¹ C_j N_j⁻¹.

S⁻¹ C_j N_j⁻¹ takes one solution with the factors that are there for each coordinate, so this is for
some hundred points, not for all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System
from adjust.solve.whitening import add_border_columns, whiten

# Object points that are solved for together: much faster than one by one, in little memory.
_TOGETHER = 8


@dataclass(frozen=True, eq=False)
class MixedParts:
    """C of k points: (r, 6, 3) of every ray with its image and point (0 … k − 1), (k, g, 3) of the border.

    Attributes
    ----------
    of_rays, image, point : with the exposures, ray by ray.
    of_border : with the system parameters and joins.
    """

    of_rays: Floats
    image: Ints
    point: Ints
    of_border: Floats


@dataclass(frozen=True, eq=False)
class JointCofactor:
    """Joint cofactor matrix of some object points.

    Attributes
    ----------
    points : (k,) indices of the points, ascending.
    matrix : (k, 3, k, 3) for σ0 = 1, local axes, m².
    """

    points: Ints
    matrix: Floats


def joint_cofactors(system: System, solution: Solution, points: Ints) -> Floats:
    """Cofactor matrix (k, 3, k, 3) of object points (k,), all different and active; local axes, m²."""
    k, n = len(points), system.layout.images
    half = np.linalg.inv(solution.normals.point_factor[points])
    own = np.swapaxes(half, 1, 2) @ half
    mixed = mixed_parts(system, solution, points)
    joint = np.zeros((k, 3, k, 3))
    for first in range(0, k, _TOGETHER):
        chosen = np.arange(first, min(first + _TOGETHER, k))
        d = len(chosen)
        rays = np.flatnonzero((mixed.point >= first) & (mixed.point < first + d))
        place = mixed.point[rays]
        # The axis of the image and that of the point beside each other, as one index wants them.
        loads = np.zeros((n, d, 6, 3))
        np.add.at(loads, (mixed.image[rays], place - first), mixed.of_rays[rays] @ own[place])
        of_exposures = np.swapaxes(loads, 1, 2).reshape(n, 6, 3 * d)
        of_border = np.moveaxis(mixed.of_border[chosen] @ own[chosen], 0, 1)
        x, border = solution.factorization.factor.solve(of_exposures, of_border.reshape(-1, 3 * d))
        projected = np.swapaxes(mixed.of_border, 1, 2) @ border
        np.add.at(projected, mixed.point, np.swapaxes(mixed.of_rays, 1, 2) @ x[mixed.image])
        joint[:, :, chosen] = (own @ projected).reshape(k, 3, d, 3)
    joint[np.arange(k), :, np.arange(k), :] += own
    return joint


def mixed_parts(system: System, solution: Solution, points: Ints) -> MixedParts:
    """Mixed parts of the normal equations, from the rays of these points alone."""
    rays, g = system.observations.image_points, system.border
    place = np.full(system.layout.points, -1, dtype=np.int64)
    place[points] = np.arange(len(points))
    part = rays.only(np.flatnonzero((place[rays.point] >= 0) & rays.active))
    equations = whiten(part, part.linearize(solution.state))
    of_border = np.zeros((len(part.image), 2, g))
    of_exposure, of_point = np.zeros((len(part.image), 2, 6)), np.zeros((len(part.image), 2, 3))
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            of_exposure = term.jacobian
        elif term.block == OBJECT_POINT:
            of_point = term.jacobian
        else:
            add_border_columns(of_border, system.layout.columns[term.block][term.index], term.jacobian)
    point = place[part.point]
    border = np.zeros((len(points), g, 3))
    np.add.at(border, point, np.swapaxes(of_border, 1, 2) @ of_point)
    start, column, vector = solution.normals.couplings.columns(system.layout.border)
    for k, j in enumerate(points):
        own = slice(start[j], start[j + 1])
        np.add.at(border[k], column[own], vector[own])
    return MixedParts(np.swapaxes(of_exposure, 1, 2) @ of_point, part.image, point, border)
