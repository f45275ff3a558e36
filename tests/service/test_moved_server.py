"""A further runner whose server comes back under another port."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path

import psutil
import pytest

from tasks.store.run_lock import run_lock
from tests.flows.conftest import write_block
from tests.service.served import Served, further_runner, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(900)]


def begun_on_a_further_runner(server: Served, output: str) -> str:
    """A run that the runner of the server has left to another one, and that has noted its beginning."""
    os.killpg(server.group_of("flows.serving.deployments"), signal.SIGSTOP)
    run = server.start("aerial-triangulation/manual", {"project": "block", "output": output})
    until(lambda: any(one.id == run and one.state == "Running" for one in server.records.runs()), 120)
    return run


def test_it_follows_the_server_and_its_run_is_done_once_and_ends(tmp_path: Path) -> None:
    results = write_block(tmp_path / "root" / "block").parent / "first"
    # So that it gives up a request after 6 s, and what it tells altogether after 16 s.
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
        assert time.monotonic() - noted < 16 + 30, "it tells the former server longer than stated"
        (record,) = server.records.runs()
        assert (record.state, record.attempts) == ("Completed", 1)
        assert len(list((results / ".store" / "bundle_adjustment").iterdir())) == 1
        said = tmp_path / "printed-runner"
        until(lambda: f"Working for {server.api.url};" in said.read_text(), 60, runner)
        run = begun_on_a_further_runner(server, "second")
        assert server.ended(run)["state_name"] == "Completed"
        runner.terminate()
        assert runner.wait(60) == 0
