"""Start-up times: the help, the first compilation, and what a run costs beyond its computing."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from benchmarks.machine import REPOSITORY, machine
from benchmarks.record import Record

# A block so small that computing takes milliseconds.
_TINY = 'preset = "dmc2-230"\n[flight]\nlines = 3\nexposures = 6\n[points]\ncount = 400\n'


def start_up(runs: int) -> tuple[Record, ...]:
    """Measure all start-up times."""
    with tempfile.TemporaryDirectory(prefix="aerocal-bench-") as name:
        folder = Path(name)
        specification, project = folder / "tiny.toml", folder / "tiny"
        specification.write_text(_TINY, encoding="utf-8")
        command = [str(Path(sys.executable).with_name("aerocal"))]
        _seconds([*command, "simulate", str(specification), "--out", str(project)])
        adjust = [*command, "adjust", str(project / "project.toml"), "--server", "none"]
        cold = [
            _seconds(
                [*adjust, "--out", str(folder / f"cold{number}")],
                {"AEROCAL_KERNEL_CACHE": str(folder / f"kernels{number}")},
            )
            for number in range(min(runs, 2))
        ]
        kernels = {"AEROCAL_KERNEL_CACHE": str(folder / "kernels0")}
        warm = [
            _seconds([*adjust, "--out", str(folder / f"warm{number}")], kernels) for number in range(runs)
        ]
        shown = [_seconds([*command, "--help"]) for _ in range(runs)]
    return (
        _record("start-help", shown, "aerocal --help"),
        _record("start-first-run", cold, "aerocal adjust of 18 images, all kernels compiled"),
        _record(
            "start-warm-run", warm, "aerocal adjust of 18 images, kernels from the cache, nothing stored"
        ),
    )


def _seconds(command: Sequence[str], environment: Mapping[str, str] | None = None) -> float:
    """Wall clock of a command that must succeed."""
    begin = time.perf_counter()
    done = subprocess.run(
        command,
        cwd=REPOSITORY,
        env={**os.environ, **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    seconds = time.perf_counter() - begin
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with code {done.returncode}:\n{done.stdout}")
    return seconds


def _record(name: str, seconds: list[float], included: str) -> Record:
    return Record(
        name=name,
        ours_s=median(seconds),
        ours_min_s=min(seconds),
        ours_max_s=max(seconds),
        runs=len(seconds),
        included=included,
        machine=machine(),
    )
