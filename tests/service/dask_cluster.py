"""A real Dask cluster for the tests: a scheduler and worker processes on loopback, nothing left behind."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.service.served import until

REPOSITORY = Path(__file__).resolve().parents[2]
START_S = 60.0
_LOOPBACK = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")


@dataclass
class DaskCluster:
    """A scheduler and its workers.

    Attributes
    ----------
    folder : holds what they print, and the workers' own files.
    address : of the scheduler.
    """

    folder: Path
    scheduler: subprocess.Popen[bytes]
    address: str
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def add_worker(self, *options: str, environment: Mapping[str, str] | None = None) -> int:
        """Start a worker and wait until the scheduler knows it; its process id."""
        place = ("--local-directory", str(self.folder), "--no-nanny", "--death-timeout", "60")
        number = len(self.workers)
        threads = () if "--nthreads" in options else ("--nthreads", "1")
        arguments = ("worker", self.address, *_LOOPBACK, *place, *threads, *options)
        worker = _dask(self.folder / f"worker{number}.log", *arguments, environment=environment)
        self.workers.append(worker)
        log = self.folder / f"worker{number}.log"
        until(lambda: "Registered to:" in log.read_text(), START_S, worker)
        return worker.pid

    def kill_worker(self, pid: int) -> None:
        """Kill a worker at once, as a full memory would."""
        (worker,) = (worker for worker in self.workers if worker.pid == pid)
        worker.kill()
        worker.wait()


def _dask(log: Path, *arguments: str, environment: Mapping[str, str] | None) -> subprocess.Popen[bytes]:
    paths = {"PYTHONPATH": str(REPOSITORY)}
    with log.open("wb") as printed:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            stdout=printed,
            stderr=printed,
            cwd=log.parent,
            env={**os.environ, **paths, **(environment or {})},
            start_new_session=True,
        )


@contextmanager
def dask_cluster(
    folder: Path, workers: int = 2, environment: Mapping[str, str] | None = None
) -> Iterator[DaskCluster]:
    """A cluster that is ready; killed with everything it started afterwards.

    `environment` holds further variables of the scheduler.
    """
    folder.mkdir(parents=True, exist_ok=True)
    told = folder / "scheduler.json"
    # The time-out is for tests that are killed themselves.
    place = ("--port", "0", "--scheduler-file", str(told), "--idle-timeout", "600s")
    arguments = ("scheduler", *_LOOPBACK, *place)
    scheduler = _dask(folder / "scheduler.log", *arguments, environment=environment)
    cluster = DaskCluster(folder, scheduler, "")
    try:
        until(told.is_file, START_S, scheduler)
        cluster.address = json.loads(told.read_text())["address"]
        for _ in range(workers):
            cluster.add_worker()
        yield cluster
    finally:
        for process in (*cluster.workers, scheduler):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
