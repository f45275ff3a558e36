"""How time and memory grow with the block: every phase apart, then the whole adjustment and its tables.

Each size is measured in a process of its own: ``python -m benchmarks.growth PROBLEM`` prints its
phases, total and memory as one line of JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from threadpoolctl import threadpool_limits

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.options import AdjustmentOptions, available_threads
from adjust.quality.cofactor import with_points
from adjust.quality.redundancy import group_residuals
from adjust.result import AdjustmentResult
from adjust.solve.factorization import factorize
from adjust.solve.gauss_newton import Solution
from adjust.solve.normal_equations import reduced_normals, substitute_back
from adjust.solve.system import System
from benchmarks.comparison import simulate_into
from benchmarks.machine import REPOSITORY, machine, peak_memory_mib
from benchmarks.problem import Problem, block_of
from benchmarks.record import Record
from benchmarks.tables import write_tables
from benchmarks.workload import Workload
from flows.runs.freed_memory import keep_freed_memory

_Result = TypeVar("_Result")


def grow(workload: Workload) -> Record:
    """Measure one size."""
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as folder:
        file = Path(folder) / "problem.npz"
        simulate_into(workload, file)
        command = [sys.executable, "-m", "benchmarks.growth", str(file)]
        done = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True, check=True)
    return Record(name=f"growth-{workload.name}", machine=machine(), **json.loads(done.stdout))


def phases(problem: Problem, threads: int) -> dict[str, float]:
    """Seconds of every phase of one iteration at the start values, and of the statistics."""
    seconds: dict[str, float] = {}

    def timed(name: str, work: Callable[[], _Result]) -> _Result:
        begin = time.perf_counter()
        result = work()
        seconds[name] = time.perf_counter() - begin
        return result

    with threadpool_limits(limits=1):
        block, observations = block_of(problem)
        system = timed("symbolic analysis", lambda: System.of(block, observations, threads))
        state = block.approximate_state()
        normals = timed("accumulation", lambda: reduced_normals(system, state))
        factorization = timed("factorisation", lambda: factorize(normals, threads))
        moves = timed("solution", factorization.solve)
        timed("back-substitution", lambda: substitute_back(system, state, normals, *moves))
        reduced = timed("selected inverse", factorization.cofactor)
        solution = Solution(state, normals, factorization, ())
        quality = timed("point covariances", lambda: with_points(system, solution, reduced))
        timed("redundancy numbers", lambda: group_residuals(system, state, quality))
    return seconds


def main(file: str) -> None:
    """Measure the problem in a file and print what :class:`Record` wants to know."""
    keep_freed_memory()  # as every process of aerocal
    problem, threads = Problem.read(Path(file)), available_threads()
    # What is compiled or loaded on the first call belongs to the start, not to the growth.
    phases(problem, threads)
    parts = phases(problem, threads)
    begin, begin_processor = time.perf_counter(), time.process_time()
    block, observations = block_of(problem)
    result = adjust_block(block, observations, AdjustmentOptions(threads=threads))
    total, processor = time.perf_counter() - begin, time.process_time() - begin_processor
    tables_mib = _written(block, result)
    begin, begin_processor = time.perf_counter(), time.process_time()
    _written(block, result)
    parts["tables"] = time.perf_counter() - begin
    total, processor = total + parts["tables"], processor + time.process_time() - begin_processor
    redundancy = sum(group.redundancy_sum for group in result.groups)
    print(
        json.dumps(
            {
                "ours_s": total,
                "ours_min_s": total,
                "ours_max_s": total,
                "processor_s": processor,
                "runs": 1,
                "included": "arrays to adjusted values with all covariances and redundancy numbers, and the "
                "tables of orientations, object points and residuals",
                "images": len(problem.projection_centre),
                "points": len(problem.object_point),
                "image_points": len(problem.image),
                "peak_memory_mib": peak_memory_mib(),
                "tables_mib": tables_mib,
                "phases_s": parts,
                "report": f"{len(result.iterations[0])} iterations, Σr {redundancy:.4f} of "
                f"{result.test.redundancy}",
            }
        )
    )


def _written(block: Block, result: AdjustmentResult) -> float:
    """MiB of the tables, written into a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as folder:
        return write_tables(Path(folder), block, result)


if __name__ == "__main__":
    main(sys.argv[1])
