"""Measured image points made ideal by the additional parameters of their cameras."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.additional.evaluation import (
    Correction,
    correction_and_derivatives,
    slope_of,
    total_correction,
)


@dataclass(frozen=True, eq=False)
class SelfCalibration:
    """Which additional parameters each image has.

    Attributes
    ----------
    names : of the d components of the family, the union over all entities.
    corrections : of each of the e entities (cameras, or cameras in one flight).
    entity_of_image : (n,) index into them.
    """

    names: tuple[str, ...]
    corrections: tuple[Correction, ...]
    entity_of_image: Ints

    @cached_property
    def components_of_entity(self) -> tuple[Ints, ...]:
        """For each entity the indices (k,) of its parameters among the components of the family."""
        place = {name: index for index, name in enumerate(self.names)}
        return tuple(
            np.array([place[name] for name in item.names], dtype=np.int64) for item in self.corrections
        )

    def evaluate(
        self, image: Ints, reduced: Floats, values: Floats, components: Ints
    ) -> tuple[Floats, Floats]:
        """Δ (r, 2) of the parameter values (e, d), and its derivatives (r, 2, t) by t components, metres.

        Parameters
        ----------
        reduced : (r, 2) metres from the principal point.
        """
        if len(self.corrections) == 1 and np.array_equal(self.components_of_entity[0], components):
            return correction_and_derivatives(self.corrections[0], reduced, values[0, components])
        correction, basis = np.zeros((len(reduced), 2)), np.zeros((len(reduced), 2, len(components)))
        slot = np.full(len(self.names), -1, dtype=np.int64)
        slot[components] = np.arange(len(components))
        for entity, rows in self._rows(image):
            own = self.components_of_entity[entity]
            to = slot[own]
            correction[rows], of_entity = correction_and_derivatives(
                self.corrections[entity], reduced[rows], values[entity, own]
            )
            part = np.zeros((len(of_entity), 2, len(components)))
            part[:, :, to[to >= 0]] = of_entity[:, :, to >= 0]
            basis[rows] = part
        return correction, basis

    def correction(self, image: Ints, reduced: Floats, values: Floats) -> Floats:
        """Δ (r, 2), metres, of the parameter values (e, d) at points (r, 2) from the principal point."""
        result = np.zeros((len(reduced), 2))
        for entity, rows in self._rows(image):
            own = values[entity, self.components_of_entity[entity]]
            result[rows] = total_correction(self.corrections[entity], reduced[rows], own)
        return result

    def slope(self, image: Ints, reduced: Floats, values: Floats) -> Floats:
        """∂Δ/∂(x̄, ȳ) (r, 2, 2); within a tile where Δ jumps at seams."""
        return slope_of(lambda xy: self.correction(image, xy, values), reduced)

    def _rows(self, image: Ints) -> list[tuple[int, Ints | slice]]:
        """Every entity that occurs, and the rows of its image points."""
        if len(self.corrections) == 1:
            return [(0, slice(None))]
        entity = self.entity_of_image[image]
        return [(int(index), np.flatnonzero(entity == index)) for index in np.unique(entity)]
