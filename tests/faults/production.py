"""PostgreSQL, ``aerocal serve``, a second runner, and a checker of all results, on one machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from tasks.production.records import Records
from tasks.production.run_record import RunRecord
from tests.faults.projects import damage
from tests.postgresql_server import PASSWORD, PostgresqlServer, running_server
from tests.service.served import START_S, Served, environment, groups_of, served, until


class Checker:
    """Reads every manifest and stage record of an inbox again and again while the context lasts."""

    def __init__(self, inbox: Path) -> None:
        self.inbox, self.damaged, self.rounds = inbox, set[str](), 0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Checker:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(0.5):
            for out in self.inbox.glob("*/results"):
                self.damaged.update(damage(out))
            self.rounds += 1


class Production:
    """Everything that runs.

    Attributes
    ----------
    server, postgresql : as their names say.
    runner : the process of the second runner.
    checker : of all results.
    """

    def __init__(self, folder: Path, server: Served, postgresql: PostgresqlServer, checker: Checker) -> None:
        self.folder, self.server, self.postgresql, self.checker = folder, server, postgresql, checker
        self.runner = self.start_runner()

    @property
    def inbox(self) -> Path:
        return self.folder / "inbox"

    @property
    def records(self) -> Records:
        return Records.at(self.postgresql.url(), {"PGPASSWORD": PASSWORD})

    def start_runner(self, *before: str, **variables: str) -> subprocess.Popen[bytes]:
        """Start the second runner, by another program if one is named."""
        command = [*before, sys.executable, "-m", "flows.command", "runner", "--root", str(self.folder)]
        where = {**environment(self.folder), **variables}
        with (self.folder / "printed-runner").open("ab") as stream:
            return subprocess.Popen(command, stdout=stream, stderr=stream, env=where)

    def end_runner(self) -> None:
        """Drain the second runner."""
        self.runner.send_signal(signal.SIGTERM)
        self.runner.wait(300)

    def runs(self) -> dict[str, RunRecord]:
        """The latest run of each project, as far as the database answers."""
        try:
            return {run.project: run for run in reversed(self.records.runs())}
        except Exception:
            return {}

    def one_running(self, names: Sequence[str], seconds: float = 240.0) -> RunRecord:
        """A run of one of the projects that is being computed."""

        def running() -> RunRecord | None:
            runs = self.runs()
            return next(
                (runs[name] for name in names if name in runs and runs[name].state == "Running"), None
            )

        return until(running, seconds)  # type: ignore[return-value]

    def all_ended(self, names: Sequence[str], seconds: float) -> dict[str, RunRecord]:
        """The runs of all the projects once they have ended for good."""

        def ended() -> dict[str, RunRecord] | None:
            runs = self.runs()
            return runs if all(name in runs and runs[name].has_ended for name in names) else None

        return until(ended, seconds)  # type: ignore[return-value]

    def told(self, run: RunRecord, seconds: float = 240.0) -> None:
        """Wait until the server says the same of a run."""

        def same() -> bool:
            try:
                return bool(self.server.run(run.id)["state_name"] == run.state)
            except Exception:
                return False

        until(same, seconds)


@contextmanager
def production(folder: Path) -> Iterator[Production]:
    """A production that is ready."""
    os.environ["PGPASSWORD"] = PASSWORD
    with ExitStack() as stack:
        postgresql = stack.enter_context(running_server())
        database = postgresql.url().replace(f":{PASSWORD}@", "@")
        options = ("--database", database, "--watch", "5")
        server = stack.enter_context(served(folder, *options))
        checker = stack.enter_context(Checker(folder / "inbox"))
        made = Production(folder, server, postgresql, checker)
        try:
            until(lambda: "Ready." in (folder / "printed-runner").read_text(), START_S, made.runner)
            yield made
        finally:
            if made.runner.poll() is None:
                # A run that was meant for a server of another port would try to reach it on and on.
                groups = groups_of(made.runner.pid)
                made.runner.terminate()
                try:
                    made.runner.wait(60)
                except subprocess.TimeoutExpired:
                    made.runner.kill()
                    made.runner.wait()
                    for group in groups:
                        with suppress(ProcessLookupError):
                            os.killpg(group, signal.SIGKILL)


def seconds_since(started: float) -> float:
    return round(time.monotonic() - started, 1)
