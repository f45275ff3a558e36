"""A sweep by one process, by two, and by a Dask cluster of two workers: seconds, and the same bytes."""

from __future__ import annotations

import hashlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.machine import REPOSITORY, machine
from benchmarks.record import Record

_PRESET = "uce-testfield"
_CHOSEN = (
    'sweep.blocks={both=["low", "high"]}',
    'sweep.control={"84/0"="all", "28/56"={count=28}, "5/79"={count=5}}',
    'sweep.parameters=["none", "bluh:1-12", "bluh:42-73", "bluh:1-12+42-73", "bluh:42-73+81-88"]',
)
SCENARIOS = 15
#: As many scenarios as workers, which load and compile everything.
_WARMING = (
    'sweep.blocks={both=["low", "high"]}',
    'sweep.control={"84/0"="all", "5/79"={count=5}}',
    'sweep.parameters=["bluh:1-12"]',
)
WORKERS = 2


@dataclass(frozen=True)
class _Run:
    """One run: seconds of the clock, of all processors together, and the digest of sweep.parquet."""

    clock_s: float
    processor_s: float
    digest: str


def sweep(runs: int) -> tuple[Record, ...]:
    """Measure the three ways in turns, after a small untimed run.

    Raises
    ------
    RuntimeError
        If a command fails, or two ways write other bytes.
    """
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as name, _cluster(WORKERS) as (address, busy_s):
        folder = Path(name)
        _command(["simulate", _PRESET, "--out", str(folder / "field")])
        project = folder / "field" / "project.toml"
        _run(project, folder / "warm", ("--dask", address), _WARMING)
        ways: dict[str, Callable[[Path], _Run]] = {
            "sweep-1-process": lambda out: _run(project, out, ("--set", "sweep.workers=1")),
            f"sweep-{WORKERS}-processes": lambda out: _run(
                project, out, ("--set", f"sweep.workers={WORKERS}")
            ),
            f"sweep-dask-{WORKERS}-workers": lambda out: _run(
                project, out, ("--dask", address), elsewhere_s=busy_s
            ),
        }
        measured: dict[str, list[_Run]] = {way: [] for way in ways}
        for turn in range(runs):
            for way, carry_out in ways.items():
                measured[way].append(carry_out(folder / f"{way}-{turn}"))
    if len({run.digest for runs_of_way in measured.values() for run in runs_of_way}) != 1:
        raise RuntimeError("sweep.parquet is not the same for all of them")
    return tuple(_record(way, timed) for way, timed in measured.items())


def _run(
    project: Path,
    out: Path,
    options: Sequence[str],
    chosen: Sequence[str] = _CHOSEN,
    *,
    elsewhere_s: Callable[[], float] = lambda: 0.0,
) -> _Run:
    """One sweep into an empty folder; `elsewhere_s`: processor seconds of other processes than its own."""
    begin, processor_s = time.perf_counter(), _children_s() + elsewhere_s()
    settings = [word for choice in chosen for word in ("--set", choice)]
    _command(["sweep", str(project), "--out", str(out), "--server", "none", *settings, *options])
    clock_s = time.perf_counter() - begin
    digest = hashlib.sha256((out / "sweep.parquet").read_bytes()).hexdigest()
    return _Run(clock_s, _children_s() + elsewhere_s() - processor_s, digest)


def _command(arguments: Sequence[str]) -> None:
    """Run a command that must succeed, each process of it on one thread."""
    done = subprocess.run(
        [sys.executable, "-m", "flows.command", *arguments],
        cwd=REPOSITORY,
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(f"aerocal {' '.join(arguments)} ended with {done.returncode}:\n{done.stdout}")


def _environment() -> Mapping[str, str]:
    kept = {name: value for name, value in os.environ.items() if name != "AEROCAL_DASK"}
    return {**kept, "AEROCAL_THREADS": "1", "PYTHONPATH": str(REPOSITORY)}


def _children_s() -> float:
    """Processor seconds of all commands that have ended, their own worker processes included."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


@contextmanager
def _cluster(workers: int) -> Iterator[tuple[str, Callable[[], float]]]:
    """Address of a cluster on this machine, and the processor seconds its workers have used so far."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield cluster.scheduler_address, lambda: sum(client.run(time.process_time).values())


def _record(way: str, runs: Sequence[_Run]) -> Record:
    seconds = [run.clock_s for run in runs]
    return Record(
        name=way,
        ours_s=median(seconds),
        ours_min_s=min(seconds),
        ours_max_s=max(seconds),
        runs=len(runs),
        included=f"aerocal sweep of {SCENARIOS} scenarios of {_PRESET}, whole command, nothing stored; "
        "the cluster was running",
        machine=machine(),
        images=228,
        processor_s=median(run.processor_s for run in runs),
    )
