"""Errors of GNSS and INS as alternatives of the model.

Drifts in single strips, about their mid times; and what positions may have in common: time offsets of
flights, a scale of the heights.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import FAMILIES, GNSS_DRIFT, INS_DRIFT, TIME_OFFSET
from adjust.quality.model_alternatives import ObservationAlternative
from adjust.solve.system import Observations
from tasks.block.given_orientations import GivenOrientations
from tasks.block.strip_motion import strip_motion
from tasks.evaluation.alternative import Alternative, along_axis, scaled
from tasks.quantities import reported_unit

# With fewer observations a drift of a strip is a single error of one of them.
_LEAST = 4


def drift_alternatives(
    block: Block, given: GivenOrientations, observations: Observations
) -> Iterator[Alternative]:
    """A drift of positions and attitudes of each strip, along each axis, unless such drifts are estimated."""
    for group in observations.others:
        if isinstance(group, GnssPositions):
            along_local_axes = np.swapaxes(group.local_from_enu, 1, 2)
            yield from _drifts(block, given, group, GNSS_DRIFT, along_local_axes)
        elif isinstance(group, InsAttitudes):
            about_body_axes = np.broadcast_to(np.eye(3), group.observed.shape)
            yield from _drifts(block, given, group, INS_DRIFT, about_body_axes)


def _drifts(
    block: Block, given: GivenOrientations, group: GnssPositions | InsAttitudes, name: str, axes: Floats
) -> Iterator[Alternative]:
    """Drifts of a family; axes (n, 3, 3), the change of each observation by a unit of each component."""
    free = any(item.family.name == name and item.free.any() for item in block.system)
    if free or group.motion is None:
        return
    family = FAMILIES[name]
    for number, strip in enumerate(given.strips):
        rows = np.flatnonzero(group.motion.strip == number)
        time = group.motion.since_middle[rows]
        if strip and len(np.unique(time)) >= _LEAST:
            for axis, component in enumerate(family.components):
                change = partial(_in_rows, len(group.event), rows, axes[rows, :, axis] * time[:, None])
                model = ObservationAlternative(group.name, change)
                yield Alternative(component, "", "strip", strip, *reported_unit(family, axis), model)


def _in_rows(count: int, rows: Ints, values: Floats, part: slice) -> Floats:
    """Changes (n, 3) that are zero but for some of the rows: those of all strips would be too large."""
    change = np.zeros((count, values.shape[1]))
    change[rows] = values
    return change[part]


def position_alternatives(
    block: Block, given: GivenOrientations, observations: Observations
) -> Iterator[Alternative]:
    """Time offsets of flights and the scale of heights, where GNSS positions show them."""
    gnss = next((item for item in observations.others if isinstance(item, GnssPositions)), None)
    if gnss is None:
        return
    of_times = next((item for item in block.system if item.family.name == TIME_OFFSET), None)
    image = block.image_of_event[gnss.event]
    velocity = np.einsum("nji,nj->ni", gnss.local_from_enu, strip_motion(given).velocity[image])
    for number, flight in enumerate(given.flights):
        moving = np.where((gnss.flight == number)[:, None], velocity, 0.0)
        if moving.any() and (of_times is None or not of_times.free[number].any()):
            change = ObservationAlternative(gnss.name, moving, _turned_meanwhile(observations, number))
            yield Alternative("time_offset", flight, "all", "", "s", 1.0, change)
    height = block.frame.height(block.projection_centre)[gnss.event]
    if np.ptp(height) > 0.5 * np.abs(np.median(height)):
        yield scaled("gnss_height_scale", gnss.name, along_axis(2, height - height.mean()))


def _turned_meanwhile(observations: Observations, flight: int) -> ObservationAlternative | None:
    """The effect of a flight's time offset on attitudes with known rates."""
    ins = next((item for item in observations.others if isinstance(item, InsAttitudes)), None)
    if ins is None or ins.turning is None:
        return None
    turned = np.where((ins.turning.flight == flight)[:, None], ins.turning.rate, 0.0)
    return ObservationAlternative(ins.name, turned)
