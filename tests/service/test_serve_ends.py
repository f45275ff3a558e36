"""``aerocal serve`` ended, killed and started again: runs are finished, and nothing is left running."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flows.server.state_file import find_server
from tasks.production.outbox import Outbox
from tasks.store.run_lock import run_lock
from tests.flows.conftest import write_block
from tests.ports import free_port
from tests.service.served import alive, recorded_states, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

MANUAL = "aerial-triangulation/manual"


def test_a_request_to_end_finishes_the_run_and_leaves_nothing_running(tmp_path: Path) -> None:
    """Also where the notices of its runs have nobody who takes them."""
    write_block(tmp_path / "root" / "block")
    away = f"json://127.0.0.1:{free_port('127.0.0.1')}"
    with served(tmp_path, first_start=True, AEROCAL_NOTIFY=away) as server:
        missed = server.start(MANUAL, {"project": "block", "settings": {"sigma0_limit": 0.71}})
        assert server.ended(missed)["state_name"] == "GateFailed"
        groups = server.groups()
        waiting = server.start(MANUAL, {"project": "block", "output": "held"})
        with run_lock(server.folder / "root" / "block" / "held"):
            server.in_state(waiting, "RUNNING")
            server.process.send_signal(signal.SIGTERM)
            until(lambda: "a second request stops them now" in server.printed, 20)
            later = server.start(MANUAL, {"project": "block", "output": "later"})
            with pytest.raises(subprocess.TimeoutExpired):
                server.process.wait(6)
        assert server.process.wait(120) == 0
    assert [notice.run for notice in Outbox(server.records).waiting()] == [missed]
    states = recorded_states(server.folder)
    assert states[waiting] == "COMPLETED"
    assert not {"RUNNING", "PENDING", "CANCELLING"} & set(states.values())
    assert later not in states, "a run that had not started waits for the next start"
    assert not [group for group in groups if alive(group)]
    assert find_server(server.folder / "state") is None


def test_a_run_that_was_killed_with_everything_is_finished_after_the_next_start(tmp_path: Path) -> None:
    write_block(tmp_path / "root" / "block")
    with served(tmp_path, "--cron", "30 1 * * *") as first, run_lock(tmp_path / "root" / "block" / "results"):
        run = first.start(MANUAL, {"project": "block"})
        first.in_state(run, "RUNNING")
        assert len(first.api.get("/deployments/name/inbox/nightly")["schedules"]) == 1
        groups = first.groups()
        first.process.kill()
        for group in groups:
            os.killpg(group, signal.SIGKILL)
    assert recorded_states(tmp_path)[run] == "RUNNING"
    project = tmp_path / "root" / "block" / "project.toml"
    command = [sys.executable, "-m", "flows.command", "run", str(project), "--out", str(tmp_path / "hand")]
    alone = subprocess.run(command, env=first.environment, capture_output=True, text=True, check=False)
    assert alone.returncode == 0
    assert "Remark: The server" in alone.stderr
    assert "no longer running" in alone.stderr
    shutil.rmtree(tmp_path / "hand")
    with served(tmp_path) as second:
        # It is seen to have crashed first, and started again a moment later.
        second.in_state(run, "COMPLETED", 150)
        # Not asked for this time.
        assert second.api.get("/deployments/name/inbox/nightly")["schedules"] == []
        second.process.send_signal(signal.SIGINT)
        assert second.process.wait(60) == 0


def test_runner_and_server_end_by_themselves_when_nobody_holds_them(tmp_path: Path) -> None:
    write_block(tmp_path / "root" / "block")
    with served(tmp_path) as server:
        groups = server.groups()
        with run_lock(tmp_path / "root" / "block" / "results"):
            run = server.start(MANUAL, {"project": "block"})
            server.in_state(run, "RUNNING")
            server.process.kill()
            server.process.wait()
        until(lambda: not any(alive(group) for group in groups), 90)
    assert recorded_states(tmp_path)[run] == "COMPLETED"
