"""Joint cofactors of some unknowns of any kind, which the selected inverse does not hold.

With N_j the normal matrix of point j, C_j its mixed part with exposures and system parameters, and S the
reduced system,

    Q_ij = δ_ij N_j⁻¹ + N_i⁻¹ C_iᵀ S⁻¹ C_j N_j⁻¹.

and with an unknown of the reduced system, whose unit vector is e,

    Q_ie = −N_i⁻¹ C_iᵀ S⁻¹ e.

Each unknown takes one solution with the factors that are there, so this is for some hundred of them, not for
all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System
from adjust.solve.whitening import add_border_columns, whiten

# Object points, and other unknowns, that are solved for together: much faster than one by one.
_POINTS_TOGETHER, _TOGETHER = 32, 96


def _none() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Chosen:
    """Some unknowns by their indices; all different.

    Attributes
    ----------
    events : (i,) exposures, six unknowns each.
    columns : (b,) of the border.
    points : (k,) active object points, three unknowns each.
    """

    events: Ints = field(default_factory=_none)
    columns: Ints = field(default_factory=_none)
    points: Ints = field(default_factory=_none)

    @property
    def count(self) -> int:
        """Number of unknowns, u = 6 i + b + 3 k, in this order."""
        return 6 * len(self.events) + len(self.columns) + 3 * len(self.points)


@dataclass(frozen=True, eq=False)
class MixedParts:
    """C of k points: (r, 6, 3) of every ray with its event and point (0 … k − 1), (k, g, 3) of the border.

    Attributes
    ----------
    of_rays, event, point : with the exposures, ray by ray.
    of_border : with the system parameters and joins.
    """

    of_rays: Floats
    event: Ints
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
    k = len(points)
    return joint_cofactors_of(system, solution, Chosen(points=points)).reshape(k, 3, k, 3)


def joint_cofactors_of(system: System, solution: Solution, chosen: Chosen) -> Floats:
    """Cofactor matrix (u, u) of unknowns in the order of exposures, border and object points; SI and radians.

    Exposures have their centre in local axes and the small rotation in the camera frame.
    """
    half = np.linalg.inv(solution.normals.point_factor[chosen.points])
    own = np.swapaxes(half, 1, 2) @ half
    mixed = mixed_parts(system, solution, chosen.points)
    joint = np.empty((chosen.count, chosen.count))
    first = 0
    for of_exposures, of_border in _loads(system, chosen, mixed, own):
        x, border = solution.factorization.factor.solve(of_exposures, of_border)
        d = border.shape[1]
        projected = np.swapaxes(mixed.of_border, 1, 2) @ border
        np.add.at(projected, mixed.point, np.swapaxes(mixed.of_rays, 1, 2) @ x[mixed.event])
        parts = (x[chosen.events], border[chosen.columns], -own @ projected)
        joint[:, first : first + d] = np.concatenate([part.reshape(-1, d) for part in parts])
        first += d
    k = len(chosen.points)
    at = chosen.count - 3 * k + 3 * np.arange(k)[:, None] + np.arange(3)
    joint[at[:, :, None], at[:, None, :]] += own
    return joint


def _loads(system: System, chosen: Chosen, mixed: MixedParts, own: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Right-hand sides (n, 6, d) and (g, d) of the reduced system for the chosen unknowns, some at a time."""
    n, g = system.layout.events, system.border
    i = len(chosen.events)
    row = np.concatenate([(6 * chosen.events[:, None] + np.arange(6)).ravel(), 6 * n + chosen.columns])
    for first in range(0, 6 * i + len(chosen.columns), _TOGETHER):
        part = row[first : first + _TOGETHER]
        unit = np.zeros((6 * n + g, len(part)))
        unit[part, np.arange(len(part))] = 1.0
        yield unit[: 6 * n].reshape(n, 6, -1), unit[6 * n :]
    for first in range(0, len(chosen.points), _POINTS_TOGETHER):
        these = np.arange(first, min(first + _POINTS_TOGETHER, len(chosen.points)))
        d = len(these)
        rays = np.flatnonzero((mixed.point >= first) & (mixed.point < first + d))
        place = mixed.point[rays]
        # The axis of the image and that of the point side by side, as one index wants them.
        loads = np.zeros((n, d, 6, 3))
        np.add.at(loads, (mixed.event[rays], place - first), mixed.of_rays[rays] @ own[place])
        of_border = np.moveaxis(mixed.of_border[these] @ own[these], 0, 1)
        yield -np.swapaxes(loads, 1, 2).reshape(n, 6, 3 * d), -of_border.reshape(-1, 3 * d)


def mixed_parts(system: System, solution: Solution, points: Ints) -> MixedParts:
    """Mixed parts of the normal equations, from the rays of these points alone."""
    rays, g = system.observations.image_points, system.border
    place = np.full(system.layout.points, -1, dtype=np.int64)
    place[points] = np.arange(len(points))
    part = rays.only(np.flatnonzero((place[rays.point] >= 0) & rays.active))
    equations = whiten(part, part.linearize(solution.linearization))
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
    return MixedParts(np.swapaxes(of_exposure, 1, 2) @ of_point, part.event, point, border)
