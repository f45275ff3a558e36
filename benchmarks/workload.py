"""The workloads: simulated blocks of known size, flown by one camera with GNSS positions.

A workload is a preset with some of its settings replaced, so anybody can look at it with
``aerocal simulate``. To add one, add a line to ``WORKLOADS``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.block import Block
from adjust.observations.gnss_position import GnssPositions
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.simulate.block import simulate_block
from adjust.solve.system import Observations
from benchmarks.problem import Problem
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulation_input import block_specification

# Object points of the operational block: 188,000 of 2,448 images; other sizes keep this density.
_POINTS_PER_IMAGE = 188_000 / 2_448


@dataclass(frozen=True)
class Workload:
    """A block to be adjusted.

    Attributes
    ----------
    name : as it is reported.
    lines, exposures : number of flight lines and of exposures in each.
    large : needs many minutes and gigabytes; left to ``make bench-large``.
    """

    name: str
    lines: int
    exposures: int
    large: bool = False

    @property
    def images(self) -> int:
        """Number of images."""
        return self.lines * self.exposures

    @property
    def overrides(self) -> tuple[str, ...]:
        """What is changed of the preset dmc2-230."""
        return (
            f"flight.0.lines={self.lines}",
            f"flight.0.exposures={self.exposures}",
            f"points.count={round(self.images * _POINTS_PER_IMAGE)}",
            "noise.image_um=1.5",
            "noise.gnss_m=0.05",
        )


#: Compared with the peer: the last one is the DMC II 230 operational block.
WORKLOADS = (
    Workload("small", 6, 20),
    Workload("medium", 16, 38),
    Workload("dmc2-230", 36, 68),
)

#: How time and memory grow with the block.
GROWTH = (
    Workload("500", 20, 25),
    Workload("2448", 36, 68),
    Workload("10000", 80, 125),
    Workload("25000", 125, 200, large=True),
    Workload("50000", 200, 250, large=True),
)

#: The whole command: what starting costs, and the operational block.
COMMANDS = (Workload("18", 3, 6), Workload("2448", 36, 68))

#: Trust maps of a million cells.
TRUST_MAPS = (Workload("2448", 36, 68), Workload("50000", 200, 250, large=True))

#: Events of five heads.
RIGS = (Workload("200", 8, 25), Workload("2000", 40, 50), Workload("10000", 100, 100, large=True))

#: Selection of additional parameters with data snooping.
SELECTIONS = (Workload("608", 8, 76), Workload("2448", 36, 68))


def simulated(workload: Workload) -> Problem:
    """Simulate a workload; start values are the GNSS positions, INS attitudes and intersections."""
    block_of_measurements = simulate_block(
        block_specification(load_simulation("dmc2-230", workload.overrides))
    )
    block = block_of_measurements.block()
    observations = block_of_measurements.observations(block, without=("control_points", "ins_attitudes"))
    return _as_arrays(block, observations)


def _as_arrays(block: Block, observations: Observations) -> Problem:
    """The arrays of a block with one camera whose only other observations are GNSS positions."""
    (positions,) = observations.others
    assert isinstance(positions, GnssPositions)
    (interior,) = block.approximate_state().system[INTERIOR_ORIENTATION]
    rays = observations.image_points
    return Problem(
        interior,
        block.projection_centre,
        block.local_from_camera,
        block.object_point,
        rays.image,
        rays.point,
        rays.xy,
        np.array([rays.sigma[0, 0]]),
        positions.observed,
        positions.stochastic.sigma,
        positions.local_from_enu,
    )
