"""What undetected gross errors in the observations of a block do to new points.

A point X̂ = F z + … of orientations and system parameters z moves with an error ∇ of an observation by

    ∇X = F Q Aᵀ P e_i ∇,

with ∇ the smallest error that its test finds. One solution of the normal equations for each coordinate of
a point, y = Q Fᵀ (the adjoint), gives this for all observations at once. Object points follow their
exposures: y_p = −N_p⁻¹ Cᵀ y.

The effects of positions, attitudes, control points and observed parameters change slowly over the ground,
so that some hundred points are enough. Those of the image points of the block are local, see
`adjust.trust_map.ray_errors`. Not counted are distances, and what is uncontrolled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.base import JoinsPoints, Linearization, ObservationGroup
from adjust.one_thread import one_thread
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT
from adjust.quality.joint_cofactor import MixedParts, mixed_parts
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.gauss_newton import Solution
from adjust.solve.whitening import add_border_columns
from adjust.trust_map.accuracy import JointSolution, new_rays
from adjust.trust_map.cells import GroundCells, Sight
from adjust.trust_map.ray_errors import BlockRays, images_around

# Numbers of the right-hand sides that are solved for together: some twenty megabytes; and least points.
_NUMBERS_AT_ONCE = 2_500_000
_LEAST_TOGETHER = 8


@dataclass(frozen=True, eq=False)
class BlockErrors:
    """Largest effects of an undetected error in the block on k points, along the axes of the cells, metres.

    Attributes
    ----------
    of_orientation : (k, 3) in a position, an attitude, a control point or an observed parameter.
    of_rays : (k, 3) in an image point around the cell.
    """

    of_orientation: Floats
    of_rays: Floats


@dataclass(frozen=True, eq=False)
class _Group:
    """A group of observations at the solution.

    Attributes
    ----------
    group : those that were used.
    equations : not whitened.
    detectable : (n, m) smallest errors that are found; zero where nothing is counted.
    """

    group: ObservationGroup
    equations: Linearization
    detectable: Floats


@dataclass(frozen=True, eq=False)
class _Adjoint:
    """Solutions y for d coordinates: (n, 6, d), (g, d), and (m, 3, d) of surveyed points."""

    of_exposures: Floats
    of_border: Floats
    of_points: Floats


def block_errors(
    solution: JointSolution, result: AdjustmentResult, cells: GroundCells, sight: Sight, chosen: Ints
) -> BlockErrors:
    """Effects on points in some cells (k,), which at least two images see."""
    system = solution.system
    solved = Solution(
        result.solution.linearization, solution.factorization.normals, solution.factorization, ()
    )
    groups = _groups(solution, result)
    touched = [term.index for item in groups for term in item.equations.terms if term.block == OBJECT_POINT]
    points = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *touched]))
    points = points[(points >= 0) & system.active_point[np.maximum(points, 0)]]
    of_orientation, of_rays = np.zeros((len(chosen), 3)), np.zeros((len(chosen), 3))
    # Cells whose images are eliminated together come together: their right-hand sides reach the same fronts.
    events = sight.only(chosen).of_events(system.observations.image_points.event_of_image)
    order = _by_elimination(solution, events)
    chosen = chosen[order]
    with one_thread():
        mixed = mixed_parts(system, solved, points)
        around = images_around(events.only(order), solution.pattern)
        rays = BlockRays.seen_from(around.image, solution, result.groups[0])
        together = max(_NUMBERS_AT_ONCE // (18 * system.layout.events), _LEAST_TOGETHER)
        for first in range(0, len(chosen), together):
            part = chosen[first : first + together]
            adjoint = _adjoint(solution, cells, sight, part, points, mixed)
            own = order[first : first + together]
            for item in groups:
                effect = np.abs(_effects(solution, item, adjoint)).max(axis=(0, 1), initial=0.0)
                of_orientation[own] = np.maximum(of_orientation[own], effect.reshape(-1, 3))
            of_rays[own] = rays.largest_effects(
                around.only(np.arange(first, first + len(part))), adjoint.of_exposures, adjoint.of_border
            )
    return BlockErrors(of_orientation, of_rays)


def _by_elimination(solution: JointSolution, sight: Sight) -> Ints:
    """The cells in the order in which the first of their images (of a rig: events) is eliminated."""
    rank = solution.factorization.factor.analysis.rank
    return np.argsort(np.minimum.reduceat(rank[sight.image], sight.start[:-1]), kind="stable")


def _groups(solution: JointSolution, result: AdjustmentResult) -> list[_Group]:
    groups = []
    for group, tested in zip(solution.system.observations.others, result.groups[1:], strict=True):
        if isinstance(group, JoinsPoints):
            continue
        counted = tested.status == ObservationStatus.USED
        equations = group.linearize(solution.state)
        groups.append(_Group(group, equations, np.where(counted, np.nan_to_num(tested.detectable), 0.0)))
    return groups


def _adjoint(
    solution: JointSolution, cells: GroundCells, sight: Sight, part: Ints, points: Ints, mixed: MixedParts
) -> _Adjoint:
    """Y = Q Fᵀ for the coordinates of some cells (d,)."""
    system, d = solution.system, len(part)
    seen = sight.only(part)
    cell, image = np.repeat(np.arange(d), seen.rays), seen.image
    state = replace(solution.state, object_point=cells.x_in_local[part])
    equations = new_rays(system.observations.image_points, state, image, cell, 1.0).linearize(state)
    of = {term.block: term for term in equations.terms}
    of_point = of.pop(OBJECT_POINT).jacobian @ cells.local_from_axes[part][cell]
    normal = np.zeros((d, 3, 3))
    np.add.at(normal, cell, np.swapaxes(of_point, 1, 2) @ of_point)
    gain = np.linalg.inv(normal)[cell] @ np.swapaxes(of_point, 1, 2)
    of_exposures = np.zeros((system.layout.events, 6, d, 3))
    of_pose = of.pop(EXTERIOR_ORIENTATION)
    np.add.at(of_exposures.swapaxes(1, 2), (of_pose.index, cell), -np.swapaxes(gain @ of_pose.jacobian, 1, 2))
    of_border = np.zeros((d, 3, system.border))
    for term in of.values():
        own = np.zeros((len(image), 3, system.border))
        add_border_columns(own, system.layout.columns[term.block][term.index], -gain @ term.jacobian)
        np.add.at(of_border, cell, own)
    x, border = solution.factorization.factor.solve(
        of_exposures.reshape(-1, 6, 3 * d), of_border.reshape(3 * d, -1).T
    )
    pulled = np.swapaxes(mixed.of_border, 1, 2) @ border
    np.add.at(pulled, mixed.point, np.swapaxes(mixed.of_rays, 1, 2) @ x[mixed.event])
    half = np.linalg.inv(solution.factorization.normals.point_factor[points])
    of_points = np.zeros((system.layout.points, 3, 3 * d))
    of_points[points] = -(np.swapaxes(half, 1, 2) @ half) @ pulled
    return _Adjoint(x, border, of_points)


def _effects(solution: JointSolution, item: _Group, adjoint: _Adjoint) -> Floats:
    """Effects (n, m, d) of the smallest errors that are found in every component of every observation."""
    columns, model = solution.system.layout.columns, item.group.stochastic
    n, m = item.equations.misclosure.shape
    rows = np.zeros((n, m, adjoint.of_border.shape[1]))
    # Without correlation over time the weights are those of each observation, and part of the derivatives.
    alone = model.neighbours is None
    weight = np.swapaxes(model.whitener, 1, 2) @ model.whitener if alone else np.eye(m)[None]
    for term in item.equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            rows += (weight @ term.jacobian) @ adjoint.of_exposures[term.index]
        elif term.block == OBJECT_POINT:
            rows += (weight @ term.jacobian) @ adjoint.of_points[term.index]
        elif (columns[term.block] >= 0).any():
            of_border = np.zeros((n, m, len(adjoint.of_border)))
            add_border_columns(of_border, columns[term.block][term.index], weight @ term.jacobian)
            rows += of_border @ adjoint.of_border
    if not alone:
        rows = np.stack([model.weighted(rows[:, :, k]) for k in range(rows.shape[2])], axis=2)
    return np.asarray(rows * item.detectable[:, :, None])
