"""Parts of the observations that share a standard deviation, or a correlation time, to be estimated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from adjust.arrays import Ints
from adjust.errors import InconsistentBlockError
from adjust.observations.base import CorrelatedOverTime
from adjust.observations.image_point import ImagePoints
from adjust.solve.system import Observations

_PARTS: Mapping[str, tuple[tuple[str, tuple[int, ...]], ...]] = {
    "image_points": (("", (0, 1)),),
    "control_points": (("plan", (0, 1)), ("height", (2,))),
    "gnss_positions": (("plan", (0, 1)), ("height", (2,))),
    "ins_attitudes": (("roll and pitch", (0, 1)), ("yaw", (2,))),
}


@dataclass(frozen=True, eq=False)
class Division:
    """The observations of a group by where they come from: files, cameras, flights.

    Attributes
    ----------
    group : name of the group.
    names : of the parts.
    of_observation : (n,) index of the part of each observation of the group.
    """

    group: str
    names: tuple[str, ...]
    of_observation: Ints


@dataclass(frozen=True)
class Part:
    """The components of observations of a group that share one variance component.

    Attributes
    ----------
    group : index of the group in ``Observations.groups``.
    name : name of the group, and what the part is called where a group has several.
    components : indices of its components.
    rows : (k,) its observations, ascending; None: all of the group. What is never used, such as check
        distances, belongs to no part and keeps its stated standard deviation.
    is_correlation : it stands for the correlation time of the group instead; its factor multiplies that.
    """

    group: int
    name: str
    components: tuple[int, ...]
    is_correlation: bool = False
    rows: Ints | None = field(default=None, compare=False)

    @property
    def place(self) -> tuple[Any, Any]:
        """Index of the part in arrays (n, m) of its group."""
        columns = np.array(self.components)
        return (slice(None), columns) if self.rows is None else (self.rows[:, None], columns[None, :])


def parts_of(observations: Observations, divisions: tuple[Division, ...] = ()) -> tuple[Part, ...]:
    """All parts: those of image points, control, GNSS, INS, and one for each family of priors.

    Raises
    ------
    InconsistentBlockError : if a division is not one of the observations of its group.
    """
    divided = {division.group: division for division in divisions}
    parts = []
    for index, group in enumerate(observations.groups):
        whole = (("", tuple(range(len(group.components)))),)
        used = None if isinstance(group, ImagePoints) else group.stochastic.taking_part
        of_all = None if used is None or used.all() else np.flatnonzero(used)
        division = divided.get(group.name)
        if division is not None and len(division.of_observation) != len(group.event):
            raise InconsistentBlockError(
                f"The division of {group.name} has {len(division.of_observation)} observations, but "
                f"there are {len(group.event)}."
            )
        for word, components in _PARTS.get(group.name, whole):
            name = f"{group.name} {word}".strip()
            if division is None:
                parts.append(Part(index, name, components, rows=of_all))
                continue
            for number, of in enumerate(division.names):
                rows = np.flatnonzero(division.of_observation == number)
                parts.append(Part(index, f"{name} of {of}", components, rows=rows))
    return tuple(parts)


def correlations_of(observations: Observations) -> tuple[Part, ...]:
    """A part for the correlation time of every group whose errors are correlated over time."""
    return tuple(
        Part(index, group.name, tuple(range(len(group.components))), is_correlation=True)
        for index, group in enumerate(observations.groups)
        if group.stochastic.over_time is not None and isinstance(group, CorrelatedOverTime)
    )
