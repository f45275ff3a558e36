"""Errors that GNSS positions may have in common: time offsets of flights, a scale of the heights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from adjust.block import Block
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import TIME_OFFSET
from adjust.quality.model_alternatives import ObservationAlternative
from adjust.solve.system import Observations
from tasks.block.given_orientations import GivenOrientations
from tasks.block.strip_motion import strip_motion
from tasks.evaluation.alternative import Alternative, along_axis, scaled


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
