"""The right-hand sides of the reduced normal equations at another state than that of their matrix.

They take a small part of the time of the normal equations. A step of the old matrix and the new
right-hand sides errs by about as much of itself as the matrix has changed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.parameters import State
from adjust.solve import right_hand_side_kernel
from adjust.solve.joined_points import Couplings, Joins
from adjust.solve.lanes import Lane, in_order, lanes
from adjust.solve.normal_equations import ReducedNormals, gathered
from adjust.solve.system import System
from adjust.solve.whitening import whiten


def with_right_hand_sides(normals: ReducedNormals, system: System, state: State) -> ReducedNormals | None:
    """The undamped matrix of an earlier state, with object points and right-hand sides of this one.

    None where an object point lies behind a camera that sees it or is not determined here.
    """
    m, g = system.layout.points, system.border
    point_normal, point_rhs = np.zeros((m, 3, 3)), np.zeros((m, 3))
    rhs_exposure, rhs_border = np.zeros((system.layout.events, 6)), np.zeros(g)
    squares, joins = 0.0, list[Joins]()
    for group in system.observations.others:
        equations = whiten(group, group.linearize(state))
        squares += float(np.sum(equations.misclosure**2))
        joined = Joins.of(equations)
        if joined is not None:
            # The two halves of a row give nothing to the right-hand side of their unknown.
            joins.append(joined)
            joined.add_to(point_normal, point_rhs)
            continue
        of_exposures, of_border, of_point = gathered(equations, system.layout, g)
        if of_point is not None:
            index, jacobian = of_point
            np.add.at(point_normal, index, np.swapaxes(jacobian, 1, 2) @ jacobian)
            np.add.at(point_rhs, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
        for index, jacobian in of_exposures:
            np.add.at(rhs_exposure, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
        rhs_border += np.einsum("nij,ni->j", of_border, equations.misclosure)
    couplings = Couplings.of(joins, m)
    found = _of_image_points(system, state, point_normal, point_rhs, couplings)
    if found is None:
        return None
    of_images, eliminated, added, added_border = found
    rhs_border[system.touched_columns] += added_border
    return replace(
        normals,
        rhs_exposure=rhs_exposure + added,
        rhs_border=rhs_border,
        point_factor=point_normal,
        point_rhs=point_rhs,
        couplings=couplings,
        weighted_squares=squares + of_images,
        eliminated=eliminated,
    )


def _of_image_points(
    system: System, state: State, point_normal: Floats, point_rhs: Floats, couplings: Couplings
) -> tuple[float, float, Floats, Floats] | None:
    """vᵀPv, Σ b_pᵀ N_pp⁻¹ b_p, and the right-hand sides of exposures (n, 6) and of columns touched (k,)."""
    columns, events = system.ray_columns, system.layout.events

    def work(lane: Lane) -> tuple[tuple[float, float, bool], Floats, Floats]:
        of_exposures, of_border = np.zeros((events, 6)), np.zeros(len(system.touched_columns))
        sums = right_hand_side_kernel.reduce_right_hand_sides(
            *system.rays_of_lane(state, lane),
            columns.compact,
            *couplings.columns(len(columns.border)),
            point_normal,
            point_rhs,
            of_exposures,
            of_border,
        )
        return sums, of_exposures, of_border

    total = eliminated = 0.0
    rhs_exposure, rhs_border = np.zeros((events, 6)), np.zeros(len(system.touched_columns))
    for (squares, reduction, sound), of_exposures, of_border in in_order(
        work, lanes(system.point_start), system.threads
    ):
        if not sound:
            return None
        total += squares
        eliminated += reduction
        rhs_exposure += of_exposures
        rhs_border += of_border
    return total, eliminated, rhs_exposure, rhs_border
