"""A server that comes back under another port, or not at all."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from tasks.store.run_lock import run_lock
from tests.conftest import Start
from tests.flows.conftest import write_block
from tests.service.served import Served, further_runner, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(900)]


def begun_on_a_further_runner(server: Served, output: str) -> str:
    """A run that the runner of the server has left to another one, and that has noted its beginning."""
    os.killpg(server.group_of("flows.serving.deployments"), signal.SIGSTOP)
    run = server.start("aerial-triangulation/manual", {"project": "block", "output": output})
    until(lambda: any(one.id == run and one.state == "Running" for one in server.records.runs()), 120)
    return run


def test_a_further_runner_follows_it_and_its_run_is_done_once_and_ends(tmp_path: Path) -> None:
    results = write_block(tmp_path / "root" / "block").parent / "first"
    # So that a run gives up after 4.5 s what it tells.
    patience = {"PREFECT_CLIENT_MAX_RETRIES": "2"}
    with contextlib.ExitStack() as at_end, contextlib.ExitStack() as before:
        server = before.enter_context(served(tmp_path))
        runner = at_end.enter_context(further_runner(server, **patience))
        with run_lock(results):
            run = begun_on_a_further_runner(server, "first")
            before.close()
            server = at_end.enter_context(served(tmp_path))
        process = next(one.process for one in server.records.runs() if one.id == run)
        assert process is not None
        assert server.ended(run)["state_name"] == "Completed"
        noted = time.monotonic()
        until(lambda: not psutil.pid_exists(process), 60)
        assert time.monotonic() - noted < 30, "it tells the former server longer than stated"
        (record,) = server.records.runs()
        assert (record.state, record.attempts) == ("Completed", 1)
        assert len(list((results / ".store" / "bundle_adjustment").iterdir())) == 1
        said = tmp_path / "printed-runner"
        until(lambda: f"Working for {server.api.url};" in said.read_text(), 60, runner)
        run = begun_on_a_further_runner(server, "second")
        assert server.ended(run)["state_name"] == "Completed"
        runner.terminate()
        assert runner.wait(60) == 0


def test_a_command_shows_its_result_without_it(tmp_path: Path, start: Start) -> None:
    block, out = write_block(tmp_path / "root" / "block"), tmp_path / "hand"
    with run_lock(out), served(tmp_path) as server:
        # So that it gives up a request after 2 s.
        variables = {**server.environment, "PREFECT_CLIENT_MAX_RETRIES": "1"}
        command = [sys.executable, "-m", "flows.command", "run", block, "--out", out]
        hand = start(*command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        until(lambda: server.records.runs(directory=str(out)), 120)
    shown, said = hand.communicate(timeout=90)
    assert hand.returncode == 0
    assert "report.html" in "".join(shown.split())  # lines may be broken within a path
    assert "Traceback" not in said
    told = f"the server {server.api.url} does not answer; how this run ended was not reported to it"
    assert said.count(told) == 1
    assert {run.state for run in server.records.runs()} == {"Completed"}
