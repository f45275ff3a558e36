"""A penta camera: time per image point as a rig, beside the same pictures as cameras that stand alone.

Each size is measured in a process of its own: ``python -m benchmarks.rigs LINES EXPOSURES`` prints processor
seconds and memory as one line of JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.observations.base import StochasticModel
from adjust.observations.gnss_position import GnssPositions
from adjust.options import AdjustmentOptions, available_threads
from adjust.rig import OF_HEADS
from adjust.simulate.block import simulate_block
from adjust.solve.system import Observations
from benchmarks.machine import REPOSITORY, machine, peak_memory_mib
from benchmarks.record import RIG, Record
from benchmarks.workload import Workload
from flows.runs.freed_memory import keep_freed_memory
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulation_input import block_specification

# Object points of the preset: 1,200 of 60 exposures.
_POINTS_PER_EVENT = 20
# As single cameras larger blocks need more memory than most machines have.
_MOST_ALONE = 1_000


def rigs(workload: Workload) -> Record:
    """Measure one size; its images are events of five pictures."""
    sizes = [str(workload.lines), str(workload.exposures)]
    command = [sys.executable, "-m", "benchmarks.rigs", *sizes]
    done = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True, check=True)
    return Record(name=f"{RIG}{workload.name}", machine=machine(), **json.loads(done.stdout))


def flown(lines: int, exposures: int) -> tuple[Block, Observations]:
    """The preset penta with so many lines; everything of the mounting held."""
    changes = (
        f"flight.lines={lines}",
        f"flight.exposures={exposures}",
        f"points.count={lines * exposures * _POINTS_PER_EVENT}",
    )
    simulated = simulate_block(block_specification(load_simulation("penta", changes)))
    block = simulated.block()
    return block, simulated.observations(block, without=("control_points", "ins_attitudes"))


def alone(block: Block, observations: Observations) -> tuple[Block, Observations]:
    """The same pictures as those of cameras without heads, each with a GNSS position of its own."""
    assert block.rig is not None
    pictures = block.approximate_state().pictures
    single = replace(
        block,
        rig=None,
        system=tuple(item for item in block.system if item.family.name not in OF_HEADS),
        projection_centre=pictures.projection_centre,
        local_from_camera=pictures.local_from_camera,
    )
    (positions,) = observations.others
    assert isinstance(positions, GnssPositions)
    event = block.rig.event_of_image
    each = GnssPositions(
        np.arange(len(event)),
        block.camera_of_image,
        block.flight_of_image,
        positions.observed[event],
        positions.local_from_enu[event],
        block.rig.body_from_camera[block.camera_of_image],
        StochasticModel.from_sigma(np.sqrt(len(block.cameras)) * positions.stochastic.sigma[event]),
    )
    rays = replace(observations.image_points, event_of_image=None)
    return single, Observations(rays, (each,))


def main(lines: int, exposures: int) -> None:
    """Measure and print what :class:`Record` wants to know."""
    keep_freed_memory()  # as every process of aerocal
    options = AdjustmentOptions(critical_value=None, threads=available_threads())

    def seconds(block: Block, observations: Observations) -> float:
        begun = time.process_time()
        adjust_block(block, observations, options)
        return time.process_time() - begun

    small = flown(3, 4)
    for one in (small, alone(*small)):  # what is compiled is no part of the time
        seconds(*one)
    block, observations = flown(lines, exposures)
    ours = seconds(block, observations)
    memory = peak_memory_mib()
    peer = seconds(*alone(block, observations)) if lines * exposures <= _MOST_ALONE else None
    print(
        json.dumps(
            {
                "ours_s": ours,
                "ours_min_s": ours,
                "ours_max_s": ours,
                "runs": 1,
                "peer_s": peer,
                "ratio": None if peer is None else ours / peer,
                "included": "processor seconds of the adjustment; peer: the same pictures as single cameras",
                "images": len(block.images),
                "points": len(block.points),
                "image_points": len(observations.image_points.image),
                "peak_memory_mib": memory,
            }
        )
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
