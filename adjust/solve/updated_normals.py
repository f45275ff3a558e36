"""Normal equations after a few observations have been rejected, or have come back.

Only object points that have lost or gained an observation give anything else than before. With the
derivatives of the same state, the new normal equations are the old ones less what these points gave, plus
what they give now. That takes the time of these points, not of the block.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Bools
from adjust.parameters import State
from adjust.solve.covisibility import point_starts
from adjust.solve.normal_equations import ReducedNormals, reduced_normals
from adjust.solve.system import Observations, System


def updated_normals(before: System, normals: ReducedNormals, system: System, state: State) -> ReducedNormals:
    """Undamped normal equations of a system at the state for which those of the system before are known.

    Parameters
    ----------
    before : the same block with other observations taking part.
    normals : its normal equations at that state, undamped.

    Raises
    ------
    DatumDefectError, InconsistentBlockError : as of ``reduced_normals``.
    """
    if system.blocking is not before.blocking or len(system.joined[0]):
        return reduced_normals(system, state)
    points = changed_points(before.observations, system.observations, len(system.active_point))
    one, other = _of_changed_groups(before, system, points)
    was = reduced_normals(of_points(one, points), state)
    now = reduced_normals(of_points(other, points), state)

    return replace(
        normals,
        blocks=normals.blocks - was.blocks + now.blocks,
        border=normals.border - was.border + now.border,
        corner=normals.corner - was.corner + now.corner,
        rhs_exposure=normals.rhs_exposure - was.rhs_exposure + now.rhs_exposure,
        rhs_border=normals.rhs_border - was.rhs_border + now.rhs_border,
        diagonal_exposure=normals.diagonal_exposure - was.diagonal_exposure + now.diagonal_exposure,
        diagonal_border=normals.diagonal_border - was.diagonal_border + now.diagonal_border,
        point_factor=np.where(points[:, None, None], now.point_factor, normals.point_factor),
        point_rhs=np.where(points[:, None], now.point_rhs, normals.point_rhs),
        weighted_squares=normals.weighted_squares - was.weighted_squares + now.weighted_squares,
        eliminated=normals.eliminated - was.eliminated + now.eliminated,
    )


def _of_changed_groups(before: System, now: System, points: Bools) -> tuple[System, System]:
    """Both without the groups, image points apart, that give the same: nothing of theirs has changed.

    What belongs to one of the changed object points (m,) is needed for its own normal equations.
    """
    touched = np.append(points, False)  # the last one stands for what belongs to no object point (−1)
    kept = [
        bool(touched[one.point].any()) or not np.array_equal(one.stochastic.present, other.stochastic.present)
        for one, other in zip(before.observations.others, now.observations.others, strict=True)
    ]
    return _with_groups(before, kept), _with_groups(now, kept)


def _with_groups(system: System, kept: list[bool]) -> System:
    others = zip(system.observations.others, kept, strict=True)
    left = tuple(group for group, is_kept in others if is_kept)
    return replace(system, observations=replace(system.observations, others=left))


def changed_points(before: Observations, now: Observations, points: int) -> Bools:
    """Object points (points,) of which other observations are used."""
    changed = np.zeros(points + 1, dtype=bool)  # the last one stands for what belongs to no object point (−1)
    changed[now.image_points.point[before.image_points.active != now.image_points.active]] = True
    for one, other in zip(before.others, now.others, strict=True):
        changed[one.point[(one.stochastic.present != other.stochastic.present).any(axis=1)]] = True
    return changed[:-1]


def of_points(system: System, points: Bools) -> System:
    """The same unknowns with the image points of some object points (m,) alone."""
    rays = system.observations.image_points
    few = rays.only(np.flatnonzero(points[rays.point]))
    return replace(
        system,
        observations=replace(system.observations, image_points=few),
        point_start=point_starts(few.point, len(points)),
        active_point=system.active_point & points,
    )
