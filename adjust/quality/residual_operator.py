"""The residuals that given misclosures would have: R = I − A Q Aᵀ applied to whitened vectors.

R is never formed, and the observations other than image points are linearized once. The vector takes the
place of the misclosures, one right-hand side is accumulated and solved with the factors that are there, and
R z = z − A dx is read off the moved state. Vectors of unit size are taken as a hundredth of a standard
deviation, for which the equations are linear.

Most observations other than image points depend on exposures and system parameters alone, and the rest on few
object points. So with their misclosures z, and none of the image points, no image points but those of these
few object points are looked at, and many z are solved for together. What R z is for the image points is not
known, but as R is idempotent, zᵀ R K z is the sum of (R z)ᵀ (R K z) over all observations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup, StochasticModel
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State, Unit
from adjust.quality.joint_cofactor import MixedParts, mixed_parts
from adjust.solve.gauss_newton import Solution
from adjust.solve.helmert_blocking import HelmertFactor
from adjust.solve.normal_equations import substitute_back
from adjust.solve.right_hand_side import with_right_hand_sides
from adjust.solve.system import Observations, System
from adjust.solve.whitening import add_border_columns, whiten


@dataclass(frozen=True, eq=False)
class _WithMisclosure:
    """A group of observations with other misclosures (n, m), SI and radians, at one state."""

    group: ObservationGroup
    linearized: Linearization
    misclosure: Floats

    @property
    def name(self) -> str:
        return self.group.name

    @property
    def components(self) -> tuple[str, ...]:
        return self.group.components

    @property
    def unit(self) -> Unit:
        return self.group.unit

    @property
    def event(self) -> Ints:
        return self.group.event

    @property
    def point(self) -> Ints:
        return self.group.point

    @property
    def stochastic(self) -> StochasticModel:
        return self.group.stochastic

    def linearize(self, state: State) -> Linearization:  # noqa: ARG002
        return Linearization(self.misclosure, self.linearized.terms)

    def without(self, rejected: Bools) -> Self:
        return replace(self, group=self.group.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        return replace(self, group=self.group.rescaled(factor))


# Part of the standard deviations that stands for a vector of unit size.
_STEP = 0.01


@dataclass(frozen=True, eq=False)
class ResidualOperator:
    """R at the solution of a system.

    Attributes
    ----------
    misclosure : (n, 2) of the image points at the solution.
    linearized : the other groups at the solution.
    """

    system: System
    solution: Solution
    misclosure: Floats
    linearized: tuple[Linearization, ...]

    @classmethod
    def of(cls, system: System, solution: Solution) -> Self:
        """The operator of a system at its solution."""
        state, given = solution.state, system.observations
        linearized = tuple(group.linearize(state) for group in given.others)
        return cls(system, solution, given.image_points.misclosure(state), linearized)

    def residuals(self, whitened: tuple[Floats, ...]) -> tuple[Floats, ...]:
        """R z (n, m) of every group for whitened misclosures z (n, m) of every group."""
        state, given = self.solution.state, self.system.observations
        steps = tuple(_STEP * vector for vector in whitened)
        rays = given.image_points
        offset = rays.sigma * steps[0] - np.nan_to_num(self.misclosure)
        shifted = replace(rays, offset=offset if rays.offset is None else rays.offset + offset)
        others = tuple(
            _WithMisclosure(group, linearized, group.stochastic.unwhitened(vector))
            for group, linearized, vector in zip(given.others, self.linearized, steps[1:], strict=True)
        )
        perturbed = replace(self.system, observations=Observations(shifted, others))
        factorization = self.solution.factorization
        normals = with_right_hand_sides(factorization.normals, perturbed, state)
        assert normals is not None, "the solution determines every object point"
        exposures, border = replace(factorization, normals=normals).solve()
        points = substitute_back(perturbed, state, normals, exposures, border)
        moved = self.system.layout.update(state, exposures, border, points)
        change = (self.misclosure - rays.misclosure(moved)) * rays.inverse_sigma
        results = [np.where(rays.active[:, None], whitened[0] - change / _STEP, 0.0)]
        for group, old, vector in zip(given.others, self.linearized, whitened[1:], strict=True):
            difference = old.misclosure - group.linearize(moved).misclosure
            change = np.where(group.stochastic.present, difference, 0.0)
            results.append(vector - group.stochastic.whitened(change) / _STEP)
        return tuple(results)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Whitened rows of one group by the unknowns they touch: (n, m, g) of the border, the others indexed."""

    of_border: Floats
    of_exposures: tuple[tuple[Ints, Floats], ...]
    of_points: tuple[tuple[Ints, Floats], ...]

    @classmethod
    def of(cls, equations: Linearization, system: System, place: Ints) -> Self:
        """Of whitened equations; place (m,) of each object point, the last one for those not used."""
        of_border = np.zeros((*equations.misclosure.shape, system.border))
        of_exposures, of_points = list[tuple[Ints, Floats]](), list[tuple[Ints, Floats]]()
        for term in equations.terms:
            if term.block == EXTERIOR_ORIENTATION:
                of_exposures.append((term.index, term.jacobian))
            elif term.block == OBJECT_POINT:
                of_points.append((place[term.index], term.jacobian))
            else:
                add_border_columns(of_border, system.layout.columns[term.block][term.index], term.jacobian)
        return cls(of_border, tuple(of_exposures), tuple(of_points))


@dataclass(frozen=True, eq=False)
class ResidualOperatorOfOthers:
    """R at the solution of a system, for all groups but the image points.

    Attributes
    ----------
    factor : of the reduced normal equations.
    rows : of every group.
    own : (k + 1, 3, 3) N_pp⁻¹ of the object points that the groups touch; zeros for those not used.
    mixed : their mixed parts with exposures and border.
    """

    factor: HelmertFactor
    rows: tuple[_Rows, ...]
    own: Floats
    mixed: MixedParts
    events: int

    @classmethod
    def of(cls, system: System, solution: Solution) -> Self:
        """The operator of a system at its solution."""
        state, others = solution.linearization, system.observations.others
        linearized = [whiten(group, group.linearize(state)) for group in others]
        touched = np.zeros(system.layout.points, dtype=bool)
        for equations in linearized:
            for term in equations.terms:
                if term.block == OBJECT_POINT:
                    touched[term.index] = True
        points = np.flatnonzero(touched & system.active_point)
        place = np.full(system.layout.points, len(points))
        place[points] = np.arange(len(points))
        half = np.linalg.inv(solution.normals.point_factor[points])
        own = np.concatenate([np.swapaxes(half, 1, 2) @ half, np.zeros((1, 3, 3))])
        rows = tuple(_Rows.of(equations, system, place) for equations in linearized)
        mixed = mixed_parts(system, solution, points)
        return cls(solution.factorization.factor, rows, own, mixed, system.layout.events)

    def residuals(self, whitened: tuple[Floats, ...]) -> tuple[Floats, ...]:
        """R z (n, m, d) of every group for d vectors z of whitened misclosures (n, m, d) of every group."""
        exposures, border, points = self._solved(*self._right_hand_sides(whitened))
        found = []
        for rows, vectors in zip(self.rows, whitened, strict=True):
            left = vectors - np.tensordot(rows.of_border, border, axes=1)
            for index, jacobian in rows.of_exposures:
                left -= jacobian @ exposures[index]
            for index, jacobian in rows.of_points:
                left -= jacobian @ points[index]
            found.append(left)
        return tuple(found)

    def _right_hand_sides(self, whitened: tuple[Floats, ...]) -> tuple[Floats, Floats, Floats]:
        """Aᵀ z: (events, 6, d) of exposures, (g, d) of the border, (k + 1, 3, d) of object points."""
        count, g = whitened[0].shape[2], self.mixed.of_border.shape[1]
        exposures, border = np.zeros((self.events, 6, count)), np.zeros((g, count))
        points = np.zeros((len(self.own), 3, count))
        for rows, vectors in zip(self.rows, whitened, strict=True):
            border += np.tensordot(rows.of_border, vectors, axes=([0, 1], [0, 1]))
            for sums, terms in ((exposures, rows.of_exposures), (points, rows.of_points)):
                for index, jacobian in terms:
                    np.add.at(sums, index, np.swapaxes(jacobian, 1, 2) @ vectors)
        return exposures, border, points

    def _solved(self, exposures: Floats, border: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Q Aᵀ z of right-hand sides, which are used up, in the same shapes."""
        mixed, of_border = self.mixed, self.mixed.of_border
        eliminated = self.own @ points
        np.subtract.at(exposures, mixed.event, mixed.of_rays @ eliminated[mixed.point])
        border -= np.tensordot(of_border, eliminated[:-1], axes=([0, 2], [0, 1]))
        exposures, border = self.factor.solve(exposures, border)
        points[:-1] -= np.tensordot(of_border, border, axes=([1], [0]))
        np.subtract.at(points, mixed.point, np.swapaxes(mixed.of_rays, 1, 2) @ exposures[mixed.event])
        return exposures, border, self.own @ points
