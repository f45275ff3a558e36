"""Marginal cofactor matrices of every unknown: the covariance for σ0 = 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Floats
from adjust.quality import cofactor_kernel
from adjust.solve.factorization import ReducedCofactor
from adjust.solve.gauss_newton import Solution
from adjust.solve.lanes import Lane, in_any_order, lanes
from adjust.solve.normal_equations import System

if TYPE_CHECKING:
    from adjust.quality.considered import ConsideredErrors


@dataclass(frozen=True, eq=False)
class Cofactor:
    """Cofactor matrices, marginal: what nothing else is held for.

    Attributes
    ----------
    reduced : of exposures (with each other where they see common points) and system parameters.
    of_points : (m, 3, 3) of object points, local axes, m²; NaN for points that took no part.
    hat_of_rays : (n, 3) elements xx, xy, yy of the hat matrix A Q Aᵀ P of every image point.
    considered : what errors of considered parameters add, not part of the above; None without any.
    """

    reduced: ReducedCofactor
    of_points: Floats
    hat_of_rays: Floats
    considered: ConsideredErrors | None = None


def cofactor(system: System, solution: Solution) -> Cofactor:
    """Cofactors at the solution, marginal for every unknown and every image point."""
    return with_points(system, solution, solution.factorization.cofactor())


def with_points(system: System, solution: Solution, reduced: ReducedCofactor) -> Cofactor:
    """Cofactors of object points and image points from those of exposures and system parameters."""
    rays, state = system.observations.image_points, solution.state
    of_points, hat = np.full((len(system.active_point), 3, 3), np.nan), np.zeros((len(rays.image), 3))

    def work(lane: Lane) -> None:
        cofactor_kernel.point_cofactors(
            *system.rays_of_lane(state, lane),
            system.ray_columns.of_image,
            solution.normals.point_factor,
            system.pattern.row_start,
            system.pattern.column,
            reduced.blocks,
            reduced.border,
            reduced.corner,
            of_points,
            hat,
        )

    in_any_order(work, lanes(system.point_start), system.threads)
    return Cofactor(reduced, of_points, hat)
