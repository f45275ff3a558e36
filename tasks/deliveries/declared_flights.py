"""Declarations on delivered flights: parts of one flight, and cameras that were remounted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pyarrow.compute as pc

from tasks.errors import Location
from tasks.formats.records import ExposureRecords
from tasks.nearest_name import did_you_mean
from tasks.settings.inputs import DeliveredFlight


def with_declared_flights(
    records: ExposureRecords, declared: Mapping[str, DeliveredFlight]
) -> ExposureRecords:
    """The exposures with their declared flights and cameras; strips of a part are prefixed with its name.

    Raises
    ------
    InputError
        If no exposure is of a flight that is declared.
    """
    camera, strip, flight = records.camera, records.strip, records.flight
    for name, own in declared.items():
        mine = pc.fill_null(pc.equal(records.flight, name), False)
        if not pc.any(mine).as_py():
            names = sorted(pc.unique(records.flight.drop_null()).to_pylist())
            known = f"Its flights are: {', '.join(names)}." if names else "It names no flights."
            raise Location(records.file, entity=name).error(
                f"inputs.exposures.flights declares the flight '{name}', but the file contains no "
                "exposure of it.",
                f"{known} {did_you_mean(name, names)}".strip(),
            )
        if own.camera is not None:
            camera = pc.if_else(mine, own.camera, camera)
        if own.part_of is not None:
            strip = pc.if_else(mine, pc.binary_join_element_wise(name, strip, " "), strip)
            flight = pc.if_else(mine, own.part_of, flight)
    return replace(records, camera=camera, strip=strip, flight=flight)
