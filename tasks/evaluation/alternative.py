"""One alternative of the model of a block, and changes of observations that several of them are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from adjust.arrays import Floats
from adjust.quality.alternative_products import ModelAlternative
from adjust.quality.model_alternatives import ObservationAlternative

Scope: TypeAlias = Literal["all", "flight", "height", "direction", "strip"]

_PER_MILLION = 1e-6


@dataclass(frozen=True, eq=False)
class Alternative:
    """One thing the model may lack.

    Attributes
    ----------
    quantity : what differs: a parameter's name, or one of this page.
    entity : the camera, flight, image or control point it belongs to; empty for the whole block.
    scope, part : in which exposures: of which flight, height, direction or strip; all of them.
    unit, factor : of its size in the tables, and the factor from SI and radians.
    model : what is tested.
    critical : |t| above which it is significant, where that does not depend on the other alternatives.
    least, most : sizes below and beyond which it is no such mistake, in its unit.
    """

    quantity: str
    entity: str
    scope: Scope
    part: str
    unit: str
    factor: float
    model: ModelAlternative
    critical: float | None = None
    least: float = 0.0
    most: float = np.inf

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Unique among the alternatives of a block."""
        return self.quantity, self.entity, self.scope, self.part


def along_axis(axis: int, values: Floats) -> Floats:
    """Changes (n, 3) along one axis."""
    change = np.zeros((len(values), 3))
    change[:, axis] = values
    return change


def scaled(quantity: str, group: str, arm: Floats) -> Alternative:
    """A scale, in millionths."""
    return Alternative(
        quantity, "", "all", "", "1e-6", 1.0 / _PER_MILLION, ObservationAlternative(group, arm)
    )
