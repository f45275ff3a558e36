"""Distances between object points: scale bars, tapes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Bools, Floats, Ints, as_sigmas, require_shape
from adjust.observations.base import Linearization, StochasticModel, Term, require_rows, require_values
from adjust.parameters import OBJECT_POINT, State, Unit
from adjust.unknown_names import indices_of

if TYPE_CHECKING:
    from adjust.block import Block


@dataclass(frozen=True, eq=False)
class Distances:
    """Measured straight distances between two object points each.

    The observation is zero when |X_other − X_point| = d.

    Attributes
    ----------
    point, other_point : (n,) indices of the two object points.
    given : (n,) distance d, metres.
    stochastic : one component.
    """

    point: Ints
    other_point: Ints
    given: Floats
    stochastic: StochasticModel

    name: ClassVar[str] = "distances"
    components: ClassVar[tuple[str, ...]] = ("distance",)
    unit: ClassVar[Unit] = "m"

    def __post_init__(self) -> None:
        require_rows(self, ("point", "other_point"), given=())
        require_values(self, np.isfinite(self.given)[:, None])

    @classmethod
    def measured(
        cls, block: Block, point: ArrayLike, other_point: ArrayLike, given: ArrayLike, sigma: ArrayLike
    ) -> Self:
        """Distances between object points of a block.

        Parameters
        ----------
        point, other_point : (n,) names, or indices, of object points of the block.
        given : (n,) metres.
        sigma : metres; a number, or (n,).

        Raises
        ------
        InconsistentBlockError : of other shapes or values.
        UnknownNameError : the block has no such object point.
        """
        one, other = (indices_of("object point", end, block.points) for end in (point, other_point))
        require_shape("The array of other ends", other.shape, one.shape)
        distance = np.asarray(given, dtype=np.float64)
        require_shape("The array of distances", distance.shape, one.shape)
        weights = StochasticModel.from_sigma(as_sigmas(sigma, one.shape)[:, None])
        return cls(one, other, distance, weights)

    @property
    def event(self) -> Ints:
        """−1 for every distance: it belongs to no event."""
        return np.full(len(self.point), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state; where both points coincide the direction is any."""
        between = state.object_point[self.other_point] - state.object_point[self.point]
        length = np.linalg.norm(between, axis=1)
        apart = length > 0.0
        direction = np.where(
            apart[:, None], between / np.where(apart, length, 1.0)[:, None], np.array([1.0, 0.0, 0.0])
        )[:, None, :]
        return Linearization(
            (self.given - length)[:, None],
            (Term(OBJECT_POINT, self.point, -direction), Term(OBJECT_POINT, self.other_point, direction)),
        )

    def without(self, rejected: Bools) -> Self:
        """The same group with the distances (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))
