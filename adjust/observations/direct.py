"""Direct observations of unknowns: priors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Bools, Floats, Ints, as_sigmas, require_shape
from adjust.observations.base import Linearization, StochasticModel, Term, require_rows, require_values
from adjust.parameters import Family, State, Unit
from adjust.unknown_names import NamedValues, indices_of

if TYPE_CHECKING:
    from adjust.block import Block


@dataclass(frozen=True, eq=False)
class DirectObservations:
    """Given values of the parameters of one family of system parameters.

    The observation is zero when parameter = given value.

    Attributes
    ----------
    family : the family.
    entity : (n,) index of the camera, flight or strip.
    given : (n, d) given values, SI and radians, or the family's own units.
    stochastic : the d components of the family.
    """

    family: Family
    entity: Ints
    given: Floats
    stochastic: StochasticModel

    def __post_init__(self) -> None:
        require_rows(self, ("entity",), given=(len(self.components),))
        require_values(self, np.isfinite(self.given))

    @classmethod
    def known(cls, block: Block, family: str, entity: ArrayLike, given: ArrayLike, sigma: ArrayLike) -> Self:
        """What is known beforehand of system parameters of a block.

        Parameters
        ----------
        family : name of a family of the block.
        entity : (n,) names, or indices, of its cameras, flights or strips.
        given : (n, d) values, SI and radians, or the family's own units.
        sigma : of the same units, NaN of what is not known; a number, or an array that broadcasts to (n, d).

        Raises
        ------
        InconsistentBlockError : of other shapes or values.
        UnknownNameError : the block has no such family, camera, flight or strip.
        """
        own = NamedValues({one.family.name: one for one in block.system})[family]
        index = indices_of(own.family.entity_kind, entity, own.entities)
        values = np.asarray(given, dtype=np.float64)
        require_shape(f"The array of {family}", values.shape, (len(index), len(own.family.components)))
        return cls(own.family, index, values, StochasticModel.from_sigma(as_sigmas(sigma, values.shape)))

    @property
    def name(self) -> str:
        """Name of the group: prior:FAMILY."""
        return f"prior:{self.family.name}"

    @property
    def components(self) -> tuple[str, ...]:
        """The parameters of the family."""
        return self.family.components

    @property
    def unit(self) -> Unit:
        """Unit of the family."""
        return self.family.unit

    @property
    def event(self) -> Ints:
        """−1 for every observation: it belongs to no event."""
        return np.full(len(self.entity), -1, dtype=np.int64)

    @property
    def point(self) -> Ints:
        """−1 for every observation: it belongs to no object point."""
        return np.full(len(self.entity), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state."""
        computed = state.system[self.family.name][self.entity]
        dimension = computed.shape[1]
        jacobian = np.broadcast_to(np.eye(dimension), (len(self.entity), dimension, dimension))
        return Linearization(self.given - computed, (Term(self.family.name, self.entity, jacobian),))

    def without(self, rejected: Bools) -> Self:
        """The same group with the observations (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))

    def of_free(self, free: Bools) -> Self:
        """The same group without the components of parameters (e, d) that are held."""
        sigma = np.where(free[self.entity], self.stochastic.sigma, np.nan)
        return replace(self, stochastic=StochasticModel.from_sigma(sigma))
