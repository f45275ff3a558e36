"""Which runs live, by what the records and this machine know of them."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from flows.server import watch
from flows.server.api import Api
from flows.server.inbox import Scheduled
from flows.server.roots import Roots
from flows.server.settings import Settings
from flows.server.watch import begin_again, died_here, lives_here, reconcile
from tasks.files.machine import machine
from tasks.production.records import Records
from tasks.production.run_record import RunRecord
from tests.conftest import Start


@pytest.fixture
def of_a_runner(start: Start) -> tuple[RunRecord, subprocess.Popen[str]]:
    """A run and the process that carries it out, as a runner starts it."""
    started = RunRecord.of("one", Path("/data/block-7/project.toml"), "aerial-triangulation", "Running")
    process = start(
        sys.executable, "-c", "print(flush=True); input()", env={**os.environ, "PREFECT__FLOW_RUN_ID": "one"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    # While a program is loaded, the system does not know its variables.
    assert process.stdout is not None
    process.stdout.readline()
    return replace(started, begun=datetime.now(UTC), host=machine(), process=process.pid), process


@pytest.mark.parametrize("hours", [0, -2, 3])
def test_a_run_lives_as_long_as_its_process_though_the_clock_was_set(
    of_a_runner: tuple[RunRecord, subprocess.Popen[str]], hours: int
) -> None:
    run, process = of_a_runner
    assert run.begun is not None
    run = replace(run, begun=run.begun + timedelta(hours=hours))
    assert lives_here(run)
    assert not died_here(run)
    assert not lives_here(replace(run, host="another"))
    process.kill()
    process.wait()
    assert died_here(run)
    assert not died_here(replace(run, host="another"))


def test_a_younger_process_with_its_number_is_not_that_of_a_run(
    of_a_runner: tuple[RunRecord, subprocess.Popen[str]],
) -> None:
    run, _process = of_a_runner
    assert run.begun is not None
    assert died_here(replace(run, id="another", begun=run.begun - timedelta(hours=2)))


class OneRun(Api):
    """A server that knows one run of a deployment, in a state of the given type and name."""

    state = ("CANCELLED", "Cancelled")

    def call(self, method: str, path: str, body: Any) -> Any:
        if (method, path) != ("POST", "/flow_runs/filter"):
            return {"name": "aerial-triangulation"}
        kind, name = self.state
        types = body["flow_runs"].get("state", {"type": {"any_": [kind]}})["type"]["any_"]
        state = {"type": kind, "name": name, "timestamp": datetime.now(UTC).isoformat()}
        run = {"id": "one", "state": state, "deployment_id": "d", "flow_id": "f"}
        return [{**run, "parameters": {"project": "/data/block-7/project.toml"}}] if kind in types else []


def test_a_run_that_is_cancelled_before_it_notes_its_beginning_is_on_record(tmp_path: Path) -> None:
    records = Records.at(str(tmp_path / "records.db"))
    reconcile(OneRun("http://127.0.0.1:9/api"), records)
    found = records.run("one")
    assert found is not None
    assert (found.state, found.project) == ("Cancelled", "block-7")


def test_a_run_that_is_cancelled_while_it_waits_to_be_restarted_is_given_up(tmp_path: Path) -> None:
    records = Records.at(str(tmp_path / "records.db"))
    project = Path("/data/block-7/project.toml")
    records.begin(RunRecord.of("one", project, "aerial-triangulation", "Running"))
    records.end("one", "Crashed", "It was killed.", may_pass=True)
    assert records.due(datetime.now(UTC) + timedelta(seconds=1))
    assert begin_again(OneRun("http://127.0.0.1:9/api"), records) == ()
    assert not records.due(datetime.now(UTC) + timedelta(seconds=1))
    found = records.run("one")
    assert found is not None
    assert found.message == "It was killed. It is not restarted automatically."


def test_a_large_delivery_that_is_read_does_not_hold_up_the_watch_over_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, read, over = threading.Semaphore(0), threading.Event(), threading.Event()

    def reconciled(*_: object) -> tuple[RunRecord, ...]:
        looks.release()
        return ()

    def hashed(*_: object, **__: object) -> Scheduled:
        read.set()
        over.wait(20)
        return Scheduled((), (), (), ())

    monkeypatch.setattr(watch, "watch_heartbeats", lambda *_: None)
    monkeypatch.setattr(watch, "reconcile", reconciled)
    monkeypatch.setattr(watch, "begin_again", lambda *_: ())
    monkeypatch.setattr(watch, "schedule_deliveries", hashed)
    settings = Settings(Roots((tmp_path,)), tmp_path, inbox=tmp_path, watch_s=0.01)
    records = Records.at(str(tmp_path / "records.sqlite"))
    with watch.Watch(settings, Api("http://127.0.0.1:1/api"), records, print).watching():
        assert read.wait(10)
        assert all(looks.acquire(timeout=5) for _ in range(5))
        over.set()
