"""The trust map of a million cells, next to the adjustment of the same block with all of its statistics.

Each size is measured in a process of its own: ``python -m benchmarks.trust_map PROBLEM`` prints processor
seconds and memory as one line of JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.options import AdjustmentOptions, available_threads
from adjust.trust_map.accuracy import NewMeasurement, cell_accuracy, joint_solution
from adjust.trust_map.block_errors import block_errors
from adjust.trust_map.cells import GroundCells, sight_of
from benchmarks.comparison import simulate_into
from benchmarks.machine import REPOSITORY, machine, peak_memory_mib
from benchmarks.problem import Problem, block_of
from benchmarks.record import TRUST_MAP, Record
from benchmarks.workload import Workload
from flows.runs.freed_memory import keep_freed_memory

_CELLS, _SOLVED_FOR = 1_000_000, 300
_SIGMA_M = 1.5e-6
_Result = TypeVar("_Result")


def trust_map(workload: Workload) -> Record:
    """Measure one size."""
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as folder:
        file = Path(folder) / "problem.npz"
        simulate_into(workload, file)
        command = [sys.executable, "-m", "benchmarks.trust_map", str(file)]
        done = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True, check=True)
    return Record(name=f"{TRUST_MAP}{workload.name}", machine=machine(), **json.loads(done.stdout))


def cells_over(points: Floats, count: int) -> GroundCells:
    """About so many square cells at the mean height of points (n, 3), row after row."""
    low, high = points.min(axis=0), points.max(axis=0)
    side = float(np.sqrt(np.prod((high - low)[:2]) / count))
    x, y = (np.arange(low[k] + side / 2, high[k], side) for k in (0, 1))
    place = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), points[:, 2].mean())], axis=-1)
    number = np.arange(place.size // 3)
    neighbour = np.where(number % len(x) < len(x) - 1, number + 1, -1)
    axes = np.broadcast_to(np.eye(3), (len(number), 3, 3)).copy()
    return GroundCells(place.reshape(-1, 3), axes, neighbour)


def main(file: str) -> None:
    """Measure the problem in a file and print what :class:`Record` wants to know."""
    keep_freed_memory()  # as every process of aerocal
    block, observations = block_of(Problem.read(Path(file)))
    options = AdjustmentOptions(new_points=True, threads=available_threads())
    # As `aerocal run` adjusts without settings: gross errors are searched.
    rejecting = replace(options, critical_value=4.13)
    seconds: dict[str, float] = {}

    def timed(name: str, work: Callable[[], _Result]) -> _Result:
        begun = time.process_time()
        result = work()
        seconds[name] = time.process_time() - begun
        return result

    def measured(cells: int) -> None:
        """Twice in all: what is compiled or loaded on the first call is no part of the time."""
        timed("with rejection", lambda: adjust_block(block, observations, rejecting))
        result = timed("adjustment", lambda: adjust_block(block, observations, options))
        ground = cells_over(result.state.object_point[result.active_point], cells)
        sight = timed("images of cells", lambda: sight_of(block, result.state, ground.x_in_local))
        seen = np.flatnonzero(sight.rays >= 2)
        chosen = seen[:: -(-len(seen) // _SOLVED_FOR)]
        solution = timed("joint solution", lambda: joint_solution(result, sight))
        new = NewMeasurement(_SIGMA_M, 1.0)
        timed("accuracy", lambda: cell_accuracy(solution, ground, sight, new))
        timed("errors in the block", lambda: block_errors(solution, result, ground, sight, chosen))

    measured(1_000)
    measured(_CELLS)
    adjustment, longer = seconds.pop("adjustment"), seconds.pop("with rejection")
    whole = sum(seconds.values())
    by_default = f"{whole / longer:.2f} times an adjustment with rejection, {longer:.2f} s"
    print(by_default, file=sys.stderr)
    print(
        json.dumps(
            {
                "ours_s": whole,
                "ours_min_s": whole,
                "ours_max_s": whole,
                "runs": 1,
                "peer_s": adjustment,
                "ratio": whole / adjustment,
                "phases_processor_s": seconds,
                "included": "processor seconds of 1 million cells; peer: our adjustment with its statistics",
                "report": by_default,
                "images": len(block.images),
                "image_points": len(observations.image_points.image),
                "peak_memory_mib": peak_memory_mib(),
            }
        )
    )


if __name__ == "__main__":
    main(sys.argv[1])
