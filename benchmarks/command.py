"""The whole command, text files to report: seconds of the clock and of the processors, by stage.

Each size is simulated once. Then ``aerocal run`` is carried out as a user would: with no compiled kernels
(``cold``, the smallest block only), with kernels and an empty store (``warm``), with one critical value
changed (``changed``), and with nothing changed (``reused``).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.command_child import readings
from benchmarks.machine import REPOSITORY, machine
from benchmarks.record import COMMAND, Record
from benchmarks.workload import COMMANDS, Workload

_SERVER = ("--server", "none")
_REJECTION = ("--set", "adjustment.rejection={critical_value=4.13}")
_CHANGED = ("--set", "adjustment.rejection={critical_value=4.5}")
_START, _END = "start and imports", "end"
_INCLUDED = {
    "cold": "no compiled kernels, nothing stored",
    "warm": "kernels from the cache, nothing stored",
    "changed": "everything stored but for another critical value",
    "reused": "everything stored",
}


@dataclass(frozen=True)
class _Run:
    """One run: seconds of the clock and of all processors in all, and both by phase."""

    clock_s: float
    processor_s: float
    phases_s: Mapping[str, float]
    phases_processor_s: Mapping[str, float]


def command(workload: Workload, runs: int) -> tuple[Record, ...]:
    """Measure one size; a record for each way to run it.

    Raises
    ------
    RuntimeError
        If a command fails.
    """
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as name:
        folder = Path(name)
        project = _simulated(workload, folder)
        kernels = {} if workload != COMMANDS[0] else {"AEROCAL_KERNEL_CACHE": str(folder / "kernels")}
        first = _run(folder, project, "first", _REJECTION, kernels)
        measured: dict[str, list[_Run]] = {"cold": [first]} if kernels else {}
        for turn in range(runs):
            out = f"out{turn}"
            for way, options in (("warm", _REJECTION), ("changed", _CHANGED), ("reused", _CHANGED)):
                measured.setdefault(way, []).append(_run(folder, project, out, options, kernels))
    return tuple(_record(workload, way, done) for way, done in measured.items())


def _simulated(workload: Workload, folder: Path) -> Path:
    """The project file of a simulated flight."""
    changes = [part for override in workload.overrides for part in ("--set", override)]
    _carry_out([*_aerocal(), "simulate", "dmc2-230", *changes, "--out", str(folder / "flight")])
    return folder / "flight" / "project.toml"


def _aerocal() -> list[str]:
    return [str(Path(sys.executable).with_name("aerocal"))]


def _run(folder: Path, project: Path, out: str, options: Sequence[str], more: Mapping[str, str]) -> _Run:
    file = folder / "readings.jsonl"
    file.unlink(missing_ok=True)
    child = [sys.executable, "-m", "benchmarks.command_child", str(file)]
    begin = time.perf_counter()
    processor = _carry_out(
        [*child, "run", str(project), "--out", str(folder / out), *_SERVER, *options], more
    )
    clock = time.perf_counter() - begin
    read = readings(file)
    phases = {_START: read[0].begin_s - begin}
    phases_processor = {_START: read[0].begin_processor_s}
    for item in read:
        phases[item.stage] = item.end_s - item.begin_s
        phases_processor[item.stage] = item.end_processor_s - item.begin_processor_s
    # What lies between the stages is little; it belongs to no stage.
    phases[_END] = clock - sum(phases.values())
    phases_processor[_END] = processor - sum(phases_processor.values())
    return _Run(clock, processor, phases, phases_processor)


def _carry_out(command: Sequence[str], more: Mapping[str, str] | None = None) -> float:
    """Processor seconds of a command that must succeed."""
    environment = {**os.environ, **(more or {})}
    # A user's Python keeps what it has compiled, whatever the machine's default is.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(command, cwd=REPOSITORY, env=environment, stdout=said, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            said.seek(0)
            raise RuntimeError(f"{' '.join(command)} ended with code {process.returncode}:\n{said.read()}")
    return used.ru_utime + used.ru_stime


def _record(workload: Workload, way: str, done: list[_Run]) -> Record:
    clock = [run.clock_s for run in done]
    return Record(
        name=f"{COMMAND}{workload.name}-{way}",
        ours_s=median(clock),
        ours_min_s=min(clock),
        ours_max_s=max(clock),
        runs=len(done),
        images=workload.images,
        processor_s=median(run.processor_s for run in done),
        phases_s={name: median(run.phases_s[name] for run in done) for name in done[0].phases_s},
        phases_processor_s={
            name: median(run.phases_processor_s[name] for run in done) for name in done[0].phases_s
        },
        included=f"aerocal run, text files to report; {_INCLUDED[way]}",
        machine=machine(),
    )
