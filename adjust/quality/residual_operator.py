"""The residuals that given misclosures would have: R = I − A Q Aᵀ applied to whitened vectors.

R is never formed, and the observations other than image points are linearized once. The vector takes the
place of the misclosures, one right-hand side is accumulated and solved with the factors that are there, and
R z = z − A dx is read off the moved state. Vectors of unit size are taken as a hundredth of a standard
deviation, for which the equations are linear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup, StochasticModel
from adjust.parameters import State, Unit
from adjust.solve.gauss_newton import Solution
from adjust.solve.normal_equations import substitute_back
from adjust.solve.right_hand_side import with_right_hand_sides
from adjust.solve.system import Observations, System


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
