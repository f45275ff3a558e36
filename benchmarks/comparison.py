"""Ours next to the peer: the same block, the same start, alternating runs, the same final cost."""

from __future__ import annotations

import tempfile
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from statistics import median

import numpy as np

from adjust.adjustment import adjust_block
from benchmarks.child import Child, Run
from benchmarks.contender import CONTENDERS, ESTIMATE, PEER, PEER_COVARIANCES, STATISTICS
from benchmarks.machine import machine
from benchmarks.problem import Problem, Solution, block_of, cost
from benchmarks.record import Record
from benchmarks.workload import Workload, simulated

_THREADS = 2
_ALL = "ours: also marginal covariances of all exposures and points and all redundancy numbers; peer: "
#: What is compared, by the end of a record's name.
_PAIRS = {
    "": (
        ESTIMATE,
        PEER,
        "ours: arrays to adjusted values; peer: its problem from its own structures, solved",
    ),
    "-statistics": (STATISTICS, PEER, f"{_ALL}adjustment only"),
    "-covariances": (STATISTICS, PEER_COVARIANCES, f"{_ALL}also covariances of all orientations"),
}


class DisagreementError(Exception):
    """The two sides have not found the same minimum, so their times cannot be compared."""


@dataclass(frozen=True)
class Agreement:
    """How well two solutions agree.

    Attributes
    ----------
    cost : (peer − ours) / ours of vᵀPv, both computed by the same function.
    position_sigma : largest difference of a coordinate of a projection centre, in its own σ.
    """

    cost: float
    position_sigma: float

    def require(self) -> None:
        """Insist on costs equal to 1e-6 and positions equal within 0.1 σ.

        Raises
        ------
        DisagreementError : if they are not.
        """
        if not (abs(self.cost) <= 1e-6 and self.position_sigma <= 0.1):
            raise DisagreementError(
                f"The costs differ by {self.cost:.2g} (at most 1e-6), the positions by up to "
                f"{self.position_sigma:.2g} σ (at most 0.1)."
            )


def compare(workload: Workload, runs: int) -> tuple[Record, ...]:
    """Time all contenders on a workload; records without statistics, with ours, and with both sides'.

    Every contender runs once untimed, then they take turns.

    Raises
    ------
    DisagreementError : if the solutions differ.
    """
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as folder, ExitStack() as stack:
        file = Path(folder) / "problem.npz"
        simulate_into(workload, file)
        children = {name: stack.enter_context(Child(name, file, _THREADS)) for name in CONTENDERS}
        done: dict[str, list[Run]] = {name: [] for name in CONTENDERS}
        for number in range(runs + 1):
            for name, child in children.items():
                run = child.run()
                if number > 0:
                    done[name].append(run)
        problem = Problem.read(file)
        solutions = {name: child.solution(Path(folder) / f"{name}.npz") for name, child in children.items()}
        preparation_s = children[PEER].preparation_s
    records = []
    for suffix, (ours, peer, included) in _PAIRS.items():
        agreement = agreement_of(problem, solutions[ours], solutions[peer])
        agreement.require()
        of_both = done[ours], done[peer]
        records.append(
            _record(f"{workload.name}{suffix}", included, problem, of_both, agreement, preparation_s)
        )
    return tuple(records)


def simulate_into(workload: Workload, file: Path) -> None:
    """Simulate in another process, so that its memory is given back."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        pool.submit(_write, workload, file).result()


def _write(workload: Workload, file: Path) -> None:
    simulated(workload).write(file)


def agreement_of(problem: Problem, ours: Solution, peers: Solution) -> Agreement:
    """Compare two solutions, with the standard deviations of our adjustment."""
    mine = cost(problem, ours)
    result = adjust_block(*block_of(problem))
    variance = np.diagonal(result.cofactor.reduced.of_exposures, axis1=1, axis2=2)[:, :3]
    apart = np.abs(peers.projection_centre - ours.projection_centre) / np.sqrt(variance)
    return Agreement((cost(problem, peers) - mine) / mine, float(apart.max()))


def _record(
    name: str,
    included: str,
    problem: Problem,
    done: tuple[list[Run], list[Run]],
    agreement: Agreement,
    peer_preparation_s: float,
) -> Record:
    """One line of the results."""
    mine, theirs = ([run.seconds for run in runs] for runs in done)
    (*_, our_last), (*_, peer_last) = done
    return Record(
        name=name,
        ours_s=median(mine),
        ours_min_s=min(mine),
        ours_max_s=max(mine),
        peer_s=median(theirs),
        peer_min_s=min(theirs),
        peer_max_s=max(theirs),
        ratio=median(theirs) / median(mine),
        runs=len(mine),
        images=len(problem.projection_centre),
        points=len(problem.object_point),
        image_points=len(problem.image),
        peak_memory_mib=our_last.peak_memory_mib,
        peer_peak_memory_mib=peer_last.peak_memory_mib,
        cost_difference=agreement.cost,
        position_difference_sigma=agreement.position_sigma,
        included=included,
        peer=f"pycolmap {version('pycolmap')}, {_THREADS} threads, sparse Schur complement, "
        f"function tolerance 1e-8; filling its structures ({peer_preparation_s:.1f} s) not counted",
        report=our_last.report,
        peer_report=peer_last.report,
        machine=machine(),
    )
