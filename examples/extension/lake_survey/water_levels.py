"""Heights of object points on a shore line: the level of the lake, as a gauge states it.

The residual is zero when the height of the point in the local frame is the level of the lake.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import OBJECT_POINT, State, Unit
from tasks.block.own_observations import ObservedBlock
from tasks.errors import InputError


@dataclass(frozen=True, eq=False)
class WaterLevels:
    """Levels of object points.

    Attributes
    ----------
    point : (n,) indices of object points.
    level : (n,) heights in the local frame, metres.
    stochastic : their weights.
    """

    point: Ints
    level: Floats
    stochastic: StochasticModel
    name: ClassVar[str] = "water_levels"
    components: ClassVar[tuple[str, ...]] = ("height",)
    unit: ClassVar[Unit] = "m"

    @property
    def event(self) -> Ints:
        """They belong to no event."""
        return np.full(len(self.point), -1, dtype=np.int64)

    def linearize(self, state: State) -> Linearization:
        """Observed − computed height, and its derivative by the point."""
        misclosure = self.level - state.object_point[self.point, 2]
        up = np.broadcast_to(np.array([[0.0, 0.0, 1.0]]), (len(self.point), 1, 3))
        return Linearization(misclosure[:, None], (Term(OBJECT_POINT, self.point, up),))

    def without(self, rejected: Bools) -> Self:
        """The same group with the observations (n,) that are rejected taken out."""
        return replace(self, stochastic=self.stochastic.without(rejected))

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, 1)."""
        return replace(self, stochastic=self.stochastic.rescaled(factor))


def water_levels(
    file: Path, observed: ObservedBlock, options: Mapping[str, bool | int | float | str]
) -> WaterLevels:
    """Read a table ``point,level`` in metres; the option ``sigma_m`` is the standard deviation.

    For a small lake in a project with local coordinates: its level is a plane of the local frame.
    """
    sigma = options.get("sigma_m")
    if not isinstance(sigma, int | float) or sigma <= 0.0:
        raise InputError(
            "Water levels need a standard deviation.", "Give options = { sigma_m = 0.01 }.", file=file
        )
    number = {name: j for j, name in enumerate(observed.block.points)}
    points, levels = [], []
    with file.open(newline="", encoding="utf-8") as rows:
        for line, row in enumerate(csv.DictReader(rows), start=2):
            if row.get("point") not in number:
                raise InputError(
                    "There is no such object point.", "Correct its name.", file, line, row.get("point")
                )
            try:
                levels.append(float(row["level"]))
            except (KeyError, TypeError, ValueError):
                raise InputError("The level is not a number.", "Write point,level.", file, line) from None
            points.append(number[row["point"]])
    level = observed.local_from_map(np.column_stack([np.zeros((len(levels), 2)), levels]))[:, 2]
    model = StochasticModel.from_sigma(np.full((len(points), 1), float(sigma)))
    return WaterLevels(np.array(points, dtype=np.int64), level, model)
