"""Killed engines, runners, servers and commands: every run ends, nothing is done twice or left open."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from flows.server.api import AUTOMATION
from tasks.production.run_record import RunRecord
from tasks.store.run_lock import run_lock
from tests.flows.conftest import write_block
from tests.service.served import Served, further_runner, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(900)]

MANUAL = "aerial-triangulation/manual"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("interrupted")
    write_block(folder / "root" / "block")
    with served(folder, "--limit", "2") as running:
        yield running


def recorded(server: Served, run: str) -> RunRecord:
    found = server.records.run(run)
    assert found is not None
    return found


def computed_once(results: Path) -> bool:
    return len(list((results / ".store" / "bundle_adjustment").iterdir())) == 1


def begun(server: Served, output: str) -> str:
    """A run that has noted its beginning and waits for the lock of its output folder."""
    (run,) = all_begun(server, output)
    return run


def all_begun(server: Served, *outputs: str) -> list[str]:
    """Such runs, all started at once."""
    runs = {server.start(MANUAL, {"project": "block", "output": output}) for output in outputs}
    until(lambda: runs <= {one.id for one in server.records.runs() if one.state == "Running"}, 120)
    return list(runs)


def test_a_killed_engine_is_followed_by_another_that_takes_up_its_run(server: Served) -> None:
    results = server.folder / "root" / "block" / "engine"
    with run_lock(results):
        run = begun(server, "engine")
        os.kill(recorded(server, run).process or 0, signal.SIGKILL)
        until(lambda: recorded(server, run).attempts == 2, 60)
    until(lambda: recorded(server, run).state == "Completed", 120)
    until(lambda: server.run(run)["state_name"] == "Completed", 30)
    assert computed_once(results)


def test_a_killed_fork_server_is_followed_by_another_that_takes_up_its_runs(server: Served) -> None:
    results = server.folder / "root" / "block" / "fork"
    runner = psutil.Process(server.group_of("flows.serving.deployments"))
    with run_lock(results):
        run = begun(server, "fork")
        engine = recorded(server, run).process or 0
        (loaded,) = (one for one in runner.children() if "flows.serving.preload" in " ".join(one.cmdline()))
        loaded.kill()
        until(lambda: not Path(f"/proc/{engine}").exists(), 30)
        until(lambda: recorded(server, run).attempts == 2, 60)
    until(lambda: recorded(server, run).state == "Completed", 120)
    until(lambda: server.run(run)["state_name"] == "Completed", 30)
    assert computed_once(results)


def test_a_killed_runner_is_started_again_and_its_runs_are_taken_up(server: Served) -> None:
    results = server.folder / "root" / "block" / "runner"
    group = server.group_of("flows.serving.deployments")
    with run_lock(results):
        run = begun(server, "runner")
        engine = recorded(server, run).process or 0
        os.kill(group, signal.SIGKILL)
        until(lambda: not Path(f"/proc/{engine}").exists(), 30)
        until(lambda: recorded(server, run).attempts == 2, 60)
    assert "The runner has stopped unexpectedly; it is restarted in 1 s." in server.printed
    until(lambda: recorded(server, run).state == "Completed", 180)
    until(lambda: server.run(run)["state_name"] == "Completed", 30)
    assert computed_once(results)


def test_a_run_that_finishes_while_the_server_is_away_is_not_begun_again(server: Served) -> None:
    results = server.folder / "root" / "block" / "server"
    with run_lock(results):
        run = begun(server, "server")
        os.kill(server.group_of("flows.server.prefect_server"), signal.SIGKILL)
        until(lambda: "The server has stopped unexpectedly" in server.printed, 10)
    until(lambda: recorded(server, run).state == "Completed", 120)
    until(lambda: _state(server, run) == "Completed", 200)
    assert recorded(server, run).attempts == 1
    assert computed_once(results)


def _state(server: Served, run: str) -> Any:
    try:
        return server.run(run)["state_name"]
    except Exception:
        return None


def test_a_killed_command_does_not_stay_running(server: Served) -> None:
    block = server.folder / "root" / "block" / "project.toml"
    out = server.folder / "hand"
    command = [sys.executable, "-m", "flows.command", "run", str(block), "--out", str(out)]
    with run_lock(out):
        hand = subprocess.Popen(command, env=server.environment, stderr=subprocess.DEVNULL)
        until(lambda: any(run.directory == str(out) for run in server.records.runs()), 60, hand)
        hand.kill()
        hand.wait()
        (run,) = (run for run in server.records.runs() if run.directory == str(out))
        until(lambda: _state(server, run.id) == "Crashed", 30)
    until(lambda: recorded(server, run.id).has_ended, 30)
    assert recorded(server, run.id).state == "Crashed"


def test_two_runners_share_the_runs_and_begin_none_twice(server: Served) -> None:
    # One more than a runner carries out at a time, and none ends before all have begun.
    names = [f"shared-{number}" for number in range(3)]
    results = [server.folder / "root" / "block" / name for name in names]
    with further_runner(server, "--limit", "2") as second:
        with contextlib.ExitStack() as locks:
            for folder in results:
                locks.enter_context(run_lock(folder))
            runs = all_begun(server, *names)
        assert {server.ended(run)["state_name"] for run in runs} == {"Completed"}
        assert {server.run(run)["run_count"] for run in runs} == {1}
        second.send_signal(signal.SIGTERM)
        assert second.wait(60) == 0
    assert all(computed_once(folder) for folder in results)
    log = server.folder / "state" / "logs" / "runner-2.log"
    assert log.read_text().count("Beginning flow run") in {1, 2}


def test_a_further_runner_leaves_deliveries_of_an_inbox_that_it_does_not_have(server: Served) -> None:
    delivery = server.folder / "inbox" / "block-9"
    own = server.group_of("flows.serving.deployments")
    log = server.folder / "state" / "logs" / "runner-2.log"
    # Runners of other tests have written into it.
    before = log.stat().st_size if log.exists() else 0
    # Of two runners nobody knows which one asks first.
    os.killpg(own, signal.SIGSTOP)
    try:
        with further_runner(server):
            write_block(delivery)
            (delivery / "DELIVERED").touch()
            until(lambda: f"a run of {delivery / 'project.toml'} is left" in log.read_text(), 120)
            assert b"Beginning flow run" not in log.read_bytes()[before:]
            (run,) = server.runs(flow_runs={"tags": {"all_": ["delivery"]}})
            assert run["state_type"] == "SCHEDULED"
    finally:
        os.killpg(own, signal.SIGCONT)
    assert server.ended(run["id"])["state_name"] == "Completed"


def test_a_relative_path_is_that_of_the_server_for_a_further_runner(server: Served) -> None:
    write_block(server.folder / "inbox" / "block")
    own = server.group_of("flows.serving.deployments")
    os.killpg(own, signal.SIGSTOP)
    try:
        with further_runner(server, root="inbox"):
            run = server.start(MANUAL, {"project": "block", "output": "relative"})
            log = server.folder / "state" / "logs" / "runner-2.log"
            until(lambda: "a run of block is left to other runners" in log.read_text(), 60)
    finally:
        os.killpg(own, signal.SIGCONT)
    assert server.ended(run)["state_name"] == "Completed"
    root = server.folder / "root"
    assert recorded(server, run).project_file == str(root / "block" / "project.toml")


def test_the_automation_for_silent_runs_is_there_once(server: Served) -> None:
    found = server.api.post("/automations/filter", {"automations": {"name": {"any_": [AUTOMATION]}}})
    assert [one["actions"][0]["state"] for one in found] == ["CRASHED"]
