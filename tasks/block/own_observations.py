"""Observations of types that other installed packages add, which import `ObservedBlock` from here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, cast

from adjust.arrays import Floats
from adjust.block import Block
from adjust.observations.base import ObservationGroup
from tasks.errors import InputError, Location
from tasks.settings.adjustment import OBSERVATION_TYPES, OwnObservationsInput


@dataclass(frozen=True, eq=False)
class ObservedBlock:
    """What a type of observations is told about the block.

    Attributes
    ----------
    block : with names, cameras and approximate values in the local frame.
    local_from_map : from easting, northing and height (n, 3) of the project's CRS to the local frame, metres.
    """

    block: Block
    local_from_map: Callable[[Floats], Floats]


#: What an entry point of `aerocal.observations` is: it reads a file and returns the group of its rows, in SI
#: units and radians. It raises :class:`~tasks.errors.InputError` where the file is wrong.
ObservationType: TypeAlias = Callable[
    [Path, ObservedBlock, Mapping[str, bool | int | float | str]], ObservationGroup
]


def own_observations(
    observed: ObservedBlock, inputs: Sequence[OwnObservationsInput], taken: Sequence[str]
) -> tuple[ObservationGroup, ...]:
    """The groups that a project declares of types that other packages add.

    Parameters
    ----------
    taken : names of the groups that there are already.

    Raises
    ------
    InputError
        If a file is wrong, a type returns no observations, or two groups have one name.
    """
    names = list(taken)
    groups = []
    for given in inputs:
        make = cast(ObservationType, OBSERVATION_TYPES[given.type])
        try:
            group = make(given.file, observed, given.options)
        except InputError:
            raise
        except Exception as error:
            error.add_note(f"This happened in the extension {given.type!r} (observations), not in aerocal.")
            raise
        _require_group(given, group, names)
        names.append(group.name)
        groups.append(group)
    return tuple(groups)


def _require_group(given: OwnObservationsInput, group: object, names: Sequence[str]) -> None:
    if not isinstance(group, ObservationGroup):
        raise Location(given.file).error(
            f"The observation type {given.type!r} returned a {type(group).__name__}, not observations.",
            "Report this to the author of the package.",
        )
    if group.name in names:
        raise Location(given.file).error(
            f"The observation type {given.type!r} returned a group named {group.name!r}, which already "
            "exists.",
            "Put the observations of one type into one file.",
        )
