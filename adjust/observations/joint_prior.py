"""Parameters of several families, observed together, as known from an earlier calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import ParameterPlace, State, Unit


@dataclass(frozen=True, eq=False)
class JointPrior:
    """Given values of m system parameters as one observation with their full covariance matrix.

    The observation is zero when every parameter = its given value.

    Attributes
    ----------
    source : what the values belong to, such as the name of a camera.
    components, units : names of the parameters, and the unit of each in the adjustment.
    places : where they are in the families.
    given : (1, m) given values, SI and radians, or the family's own units.
    stochastic : one observation of m components.
    """

    source: str
    components: tuple[str, ...]
    units: tuple[str, ...]
    places: tuple[ParameterPlace, ...]
    given: Floats
    stochastic: StochasticModel

    #: Its components have units of their own.
    unit: ClassVar[Unit] = "1"

    @property
    def name(self) -> str:
        """Name of the group: prior:calibration:SOURCE."""
        return f"prior:calibration:{self.source}"

    @property
    def event(self) -> Ints:
        """−1: it belongs to no event."""
        return np.full(1, -1, dtype=np.int64)

    @property
    def point(self) -> Ints:
        """−1: it belongs to no object point."""
        return np.full(1, -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state."""
        computed = np.array([state.system[family][entity, part] for family, entity, part in self.places])
        terms = []
        for family, entity in dict.fromkeys((place.family, place.entity) for place in self.places):
            jacobian = np.zeros((1, len(self.places), state.system[family].shape[1]))
            for row, place in enumerate(self.places):
                if place[:2] == (family, entity):
                    jacobian[0, row, place.component] = 1.0
            terms.append(Term(family, np.array([entity], dtype=np.int64), jacobian))
        return Linearization(self.given - computed, tuple(terms))

    def without(self, rejected: Bools) -> Self:
        """The same group without its observation where (1,) says so."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def without_family(self, family: str) -> Self:
        """The prior of the parameters of the other families only."""
        kept = [k for k, place in enumerate(self.places) if place.family != family]
        root = self.stochastic.unwhitener[:, kept]
        model = StochasticModel.from_covariance(
            root @ np.swapaxes(root, 1, 2), self.stochastic.present[:, kept]
        )
        names, units = (tuple(texts[k] for k in kept) for texts in (self.components, self.units))
        places = tuple(self.places[k] for k in kept)
        return replace(
            self, components=names, units=units, places=places, given=self.given[:, kept], stochastic=model
        )

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (1, m)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))
