"""Coordinates that are delivered in feet, in metres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tasks.coordinates.crs import MapFrame
from tasks.formats.records import ControlRecords, ExposureRecords
from tasks.settings.inputs import ControlInput, ExposuresInput, LengthUnit

#: Length of each unit, metres.
METRES_PER_UNIT: Mapping[LengthUnit, float] = {"m": 1.0, "ft": 0.3048, "us-ft": 1200.0 / 3937.0}


def length_factors(source: ExposuresInput | ControlInput, frame: MapFrame) -> tuple[float, float]:
    """Metres per unit of x and y (1 if they are longitude and latitude), and of z."""
    plan = METRES_PER_UNIT[source.length_unit]
    height = METRES_PER_UNIT[source.height_unit or source.length_unit]
    return (plan if frame.is_local or frame.is_projected else 1.0), height


def exposures_in_metres(records: ExposureRecords, source: ExposuresInput, frame: MapFrame) -> ExposureRecords:
    """The same exposures with positions and their standard deviations in metres."""
    plan, height = length_factors(source, frame)
    if plan == height == 1.0:
        return records
    scale = np.array([plan, plan, height])
    return replace(records, position=records.position * scale, sigma_position=records.sigma_position * scale)


def control_in_metres(records: ControlRecords, source: ControlInput, frame: MapFrame) -> ControlRecords:
    """The same points with positions and their standard deviations in metres."""
    plan, height = length_factors(source, frame)
    if plan == height == 1.0:
        return records
    scale = np.array([plan, plan, height])
    return replace(records, position=records.position * scale, sigma=records.sigma * scale)
