"""The normal equations of a block, reduced to exposures and system parameters.

Image points go through the compiled kernel; every other group takes one generic path, which only
knows misclosures, terms and whiteners. ``design_matrix`` builds the same equations in full, as an
independent check.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.observations.base import Linearization
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, ParameterLayout, State
from adjust.solve import reduction_kernel
from adjust.solve.covisibility import Covisibility
from adjust.solve.fronts import HelmertBlocking
from adjust.solve.joined_points import Couplings, Joins
from adjust.solve.lanes import Lane, in_any_order, in_order, lanes
from adjust.solve.reduction import Sums, reduce_image_points
from adjust.solve.system import System
from adjust.solve.whitening import add_border_columns, whiten


@dataclass(frozen=True, eq=False)
class ReducedNormals:
    """S dq = s after elimination of the object points, and what is needed to go back to them.

    The border is that of the system: the system parameters, then one unknown for each join of object points.

    Attributes
    ----------
    blocking : which exposure blocks are there, and in which order they are eliminated.
    blocks : (blocks, 6, 6) upper block triangle of the exposures.
    border : (n, 6, g) exposures × system parameters.  corner : (g, g).
    rhs_exposure : (n, 6).  rhs_border : (g,).
    diagonal_exposure : (n, 6), diagonal_border : (g,) of the unreduced normal equations.
    point_factor : (m, 3, 3) lower Cholesky factors of N_pp.  point_rhs : (m, 3) right-hand sides b_p.
    couplings : of object points with the unknowns of joins.
    weighted_squares : vᵀPv at the state of linearisation.
    eliminated : Σ b_pᵀ N_pp⁻¹ b_p.
    """

    blocking: HelmertBlocking
    blocks: Floats
    border: Floats
    corner: Floats
    rhs_exposure: Floats
    rhs_border: Floats
    diagonal_exposure: Floats
    diagonal_border: Floats
    point_factor: Floats
    point_rhs: Floats
    couplings: Couplings
    weighted_squares: float
    eliminated: float

    @property
    def pattern(self) -> Covisibility:
        """Which exposure blocks are there."""
        return self.blocking.pattern

    @property
    def diagonal_of_parameters(self) -> Floats:
        """(g,) of the corner of the system parameters, with the unknowns of joins eliminated, too."""
        g = len(self.corner) - self.couplings.joins
        mixed, joins = self.corner[:g, g:], self.corner[g:, g:]
        taken = np.einsum("gj,jg->g", mixed, np.linalg.solve(joins, mixed.T))
        return np.asarray(np.diagonal(self.corner)[:g] - taken)


def reduced_normals(system: System, state: State, damping: float = 0.0) -> ReducedNormals:
    """Normal equations at a state, object points eliminated; N + damping · diag N.

    Raises
    ------
    DatumDefectError : if an object point is not determined by its observations.
    InconsistentBlockError : if an object point lies behind a camera that sees it.
    """
    layout = system.layout
    m, g = layout.points, system.border
    sums = Sums.zero(len(system.pattern.column), layout.events, g)
    point_normal, point_rhs = np.zeros((m, 3, 3)), np.zeros((m, 3))
    squares, joins = 0.0, list[Joins]()
    for group in system.observations.others:
        equations = whiten(group, group.linearize(state))
        squares += float(np.sum(equations.misclosure**2))
        joined = Joins.of(equations)
        if joined is None:
            _add_group(sums, equations, system, point_normal, point_rhs)
        else:
            joins.append(joined)
            joined.add_to(point_normal, point_rhs)
    # Each unknown t is in two halves with the weight 2, whether its observation is used or not.
    own = np.arange(layout.border, g)
    sums.corner[own, own] = 4.0
    couplings = Couplings.of(joins, m)
    sums.diagonal_exposure[:] = np.diagonal(sums.blocks[system.pattern.diagonal], axis1=1, axis2=2)
    sums.diagonal_border[:] = np.diagonal(sums.corner)
    of_images, eliminated = reduce_image_points(
        system, state, damping, sums, point_normal, point_rhs, couplings
    )
    if damping > 0.0:
        diagonal = np.arange(6)
        sums.blocks[system.pattern.diagonal[:, None], diagonal, diagonal] += damping * sums.diagonal_exposure
        sums.corner[np.arange(g), np.arange(g)] += damping * sums.diagonal_border
    return ReducedNormals(
        system.blocking,
        sums.blocks,
        sums.border,
        sums.corner,
        sums.rhs_exposure,
        sums.rhs_border,
        sums.diagonal_exposure,
        sums.diagonal_border,
        point_normal,
        point_rhs,
        couplings,
        squares + of_images,
        eliminated,
    )


def _add_group(
    sums: Sums, equations: Linearization, system: System, point_normal: Floats, point_rhs: Floats
) -> None:
    """Add one group of whitened observation equations, whatever it is."""
    of_exposures, of_border, of_point = gathered(equations, system.layout, system.border)
    if of_point is not None:
        index, jacobian = of_point
        np.add.at(point_normal, index, np.swapaxes(jacobian, 1, 2) @ jacobian)
        np.add.at(point_rhs, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
    for number, (index, jacobian) in enumerate(of_exposures):
        transposed = np.swapaxes(jacobian, 1, 2)
        np.add.at(sums.blocks, system.pattern.diagonal[index], transposed @ jacobian)
        np.add.at(sums.rhs_exposure, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
        np.add.at(sums.border, index, transposed @ of_border)
        for other, of_other in of_exposures[:number]:
            _add_pairs(sums, system.pattern, (index, other), transposed @ of_other)
    sums.corner[:] += np.einsum("nij,nik->jk", of_border, of_border)
    sums.rhs_border[:] += np.einsum("nij,ni->j", of_border, equations.misclosure)


def _add_pairs(sums: Sums, pattern: Covisibility, images: tuple[Ints, Ints], products: Floats) -> None:
    """Add J_aᵀ J_b (n, 6, 6) of rows that touch two exposures to the upper block triangle."""
    one, other = images
    turned = np.swapaxes(products, 1, 2)
    here = np.where((one < other)[:, None, None], products, turned)
    # An observation without neighbours touches its own exposure twice, the second time with zeros.
    here = np.where((one == other)[:, None, None], products + turned, here)
    position = pattern.find(one, other)
    if np.any(position < 0):
        raise InconsistentBlockError("An observation touches two images whose block is not in the pattern.")
    np.add.at(sums.blocks, position, here)


def gathered(
    equations: Linearization, layout: ParameterLayout, border: int
) -> tuple[list[tuple[Ints, Floats]], Floats, tuple[Ints, Floats] | None]:
    """Jacobians by kind: (index, (n, m, 6)) of exposures, (n, m, g) of the border, (index, (n, m, 3))."""
    n, m = equations.misclosure.shape
    of_border = np.zeros((n, m, border))
    of_exposures, of_points = list[tuple[Ints, Floats]](), list[tuple[Ints, Floats]]()
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            of_exposures.append((term.index, term.jacobian))
        elif term.block == OBJECT_POINT:
            of_points.append((term.index, term.jacobian))
        else:
            add_border_columns(of_border, layout.columns[term.block][term.index], term.jacobian)
    return of_exposures, of_border, of_points[0] if of_points else None


def weighted_squares(system: System, state: State) -> float:
    """vᵀPv at a state; NaN if an object point lies behind a camera that sees it."""
    rays = system.observations.image_points

    def work(lane: Lane) -> float:
        first, last = (int(system.point_start[index]) for index in lane)
        whitened = rays.misclosure(state, first, last) * rays.inverse_sigma[first:last]
        whitened[~rays.active[first:last]] = 0.0
        return float(np.sum(whitened**2))

    squares = sum(in_order(work, lanes(system.point_start), system.threads))
    for group in system.observations.others:
        squares += float(np.sum(whiten(group, group.linearize(state)).misclosure ** 2))
    return squares


def substitute_back(
    system: System, state: State, normals: ReducedNormals, of_exposures: Floats, of_border: Floats
) -> Floats:
    """Increments (m, 3) of the object points that belong to (n, 6) and (g,) of the others."""
    increments = np.zeros_like(state.object_point)

    def work(lane: Lane) -> None:
        reduction_kernel.substitute_back(
            *system.rays_of_lane(state, lane),
            system.ray_columns.of_image,
            *normals.couplings.columns(system.layout.border),
            normals.point_factor,
            normals.point_rhs,
            of_exposures,
            of_border,
            increments,
        )

    in_any_order(work, lanes(system.point_start), system.threads)
    return increments
