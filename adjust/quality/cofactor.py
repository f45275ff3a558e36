"""Marginal cofactor matrices of every unknown: the covariance for σ0 = 1."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.parameters import ParameterLayout
from adjust.quality import cofactor_kernel
from adjust.quality.considered_errors import ConsideredErrors
from adjust.quality.joint_cofactor import joint_cofactors
from adjust.quality.unknown_errors import CorrectionErrors
from adjust.solve.border_columns_kernel import TILE
from adjust.solve.factorization import ReducedCofactor
from adjust.solve.full_vectors import FullVectors, joined
from adjust.solve.gauss_newton import Solution
from adjust.solve.lanes import Lane, in_any_order, lanes
from adjust.solve.system import System
from adjust.solve.updated_normals import of_points


@dataclass(frozen=True, eq=False)
class Cofactor:
    """Cofactor matrices, marginal: what nothing else is held for.

    Attributes
    ----------
    reduced : of exposures (with each other where they see common points) and system parameters.
    of_points : (m, 3, 3) of object points, local axes, m²; NaN for points that were not used.
    hat_of_rays : (n, 3) elements xx, xy, yy of the hat matrix A Q Aᵀ P of every image point.
    joined : the object points (k,) and (k,) of every join.
    of_joins : (k, 3, 3) between the two, local axes, m²; zero where one takes no part.
    considered, corrections : what errors of considered parameters and of corrections of image coordinates
        add, not part of the above; None without any.
    """

    reduced: ReducedCofactor
    of_points: Floats
    hat_of_rays: Floats
    joined: tuple[Ints, Ints]
    of_joins: Floats
    considered: ConsideredErrors | None = None
    corrections: CorrectionErrors | None = None

    @property
    def errors_of_unknowns(self) -> FullVectors | None:
        """What k independent errors of unit variance add to the unknowns, (u, k), from all that is known."""
        parts = [item.of_unknowns for item in (self.considered, self.corrections) if item is not None]
        return joined(parts) if parts else None

    def between_joined(self, point: Ints, other: Ints) -> Floats:
        """Cofactors (n, 3, 3) between object points (n,) and (n,) that are joined in this order."""
        pairs = self.joined[0] * len(self.of_points) + self.joined[1]
        order = np.argsort(pairs, kind="stable")
        wanted = point * len(self.of_points) + other
        return np.asarray(self.of_joins[order[np.searchsorted(pairs[order], wanted)]])

    def without_joins(self, layout: ParameterLayout) -> Cofactor:
        """The same of the unknowns of a layout alone: what joins object points has no column any more."""
        reduced, g = self.reduced, layout.border
        if len(reduced.corner) == g:
            return self
        mixed, own = reduced.normal[:g, g:], reduced.normal[g:, g:]
        parameters = replace(
            reduced,
            border=reduced.border[:, :, :g],
            corner=reduced.corner[:g, :g],
            normal=reduced.normal[:g, :g] - mixed @ np.linalg.solve(own, mixed.T),
        )
        return replace(self, reduced=parameters)


def cofactor(system: System, solution: Solution, keep: bool = False) -> Cofactor:
    """Cofactors at the solution, marginal for every unknown and every image point; keep as of the factor."""
    return with_points(system, solution, solution.factorization.cofactor(keep=keep))


def with_points(system: System, solution: Solution, reduced: ReducedCofactor) -> Cofactor:
    """Cofactors of object points and image points from those of exposures and system parameters."""
    rays, state = system.observations.image_points, solution.linearization
    columns, border, corner = system.ray_columns, *_tiled(system, reduced)
    of_points, hat = np.full((len(system.active_point), 3, 3), np.nan), np.zeros((len(rays.image), 3))

    def work(lane: Lane) -> None:
        cofactor_kernel.point_cofactors(
            *system.rays_of_lane(state, lane),
            columns.compact,
            *solution.normals.couplings.columns(len(columns.border)),
            solution.normals.point_factor,
            reduced.pattern.row_start,
            reduced.pattern.column,
            reduced.blocks.reshape(-1, 6),
            border,
            corner,
            of_points,
            hat,
        )

    in_any_order(work, lanes(system.point_start), system.threads)
    return Cofactor(reduced, of_points, hat, system.joined, _between_joined_points(system, solution))


def _tiled(system: System, reduced: ReducedCofactor) -> tuple[Floats, Floats]:
    """Border (6 n, k) and corner (k, k) of the columns that object points touch, zeros up to whole tiles."""
    touched = system.touched_columns
    width, size = len(touched), TILE * -(-len(touched) // TILE)
    border, corner = np.zeros((*reduced.border.shape[:2], size)), np.zeros((size, size))
    border[:, :, :width] = reduced.border[:, :, touched]
    corner[:width, :width] = reduced.corner[np.ix_(touched, touched)]
    return border.reshape(6 * len(border), size), corner


def of_other_rays(before: Cofactor, system: System, solution: Solution, points: Bools) -> Cofactor:
    """Cofactors after some object points (m,) have lost or gained rays: theirs new, the others' as they were.

    One ray of the hundreds of an image changes the redundancy numbers of the others by less than a percent.
    """
    found = with_points(of_points(system, points), solution, before.reduced)
    hat = before.hat_of_rays.copy()
    hat[points[system.observations.image_points.point]] = found.hat_of_rays
    return replace(
        before, of_points=np.where(points[:, None, None], found.of_points, before.of_points), hat_of_rays=hat
    )


def _between_joined_points(system: System, solution: Solution) -> Floats:
    """Cofactors (k, 3, 3) between the two object points of every join."""
    point, other = system.joined
    found = np.zeros((len(point), 3, 3))
    kept = np.flatnonzero(system.active_point[point] & system.active_point[other])
    if len(kept):
        points, place = np.unique(np.stack([point[kept], other[kept]]), return_inverse=True)
        first, second = place.reshape(2, -1)
        joint = joint_cofactors(system, solution, points)
        found[kept] = joint[first, :, second, :]
    return found
