"""``aerocal serve`` ended, restored, killed and started again: runs are finished, none of them twice.

Three starts over the same folders, one after the other: the first ends when asked to, the second begins with
nothing but the backup of its state that the page on operations describes and is killed, the third finishes.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from flows.server.state_file import find_server
from tasks.production.outbox import Outbox
from tasks.production.run_record import RunRecord
from tasks.store.run_lock import run_lock
from tests.conftest import REPOSITORY
from tests.flows.conftest import write_block
from tests.ports import free_port
from tests.service.served import Served, alive, recorded_states, served, until
from tests.service.stored_block import store_stages, write_stored_block

pytestmark = [pytest.mark.service, pytest.mark.timeout(900)]

MANUAL = "aerial-triangulation/manual"


@dataclass
class Start:
    """What one start has left.

    Attributes
    ----------
    folder : holds root/, inbox/, state/.
    runs : ids by what the test calls them.
    left : process groups of server and runner that were still there when it had ended.
    code : exit code.
    states : the state of every run that is not scheduled, on the server, at the end.
    records : the runs as recorded; of the restored server before it was killed.
    files : inode and time of every published file of the first delivery.
    manifest : of the first delivery; of the restored server before it was delivered again.
    schedules : of the inbox.
    notices : runs whose notices wait.
    found : whether commands take it for a running server.
    printed : by a command afterwards.
    """

    folder: Path
    runs: dict[str, str]
    left: list[int]
    code: int
    states: dict[str, str]
    records: dict[str, RunRecord]
    files: dict[str, tuple[int, int]]
    manifest: str
    schedules: list[object] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)
    found: bool = False
    printed: str = ""


def deliver(folder: Path, name: str) -> None:
    """Deliver the block under a name, whether or not it was before."""
    shutil.copytree(folder / "made", folder / "inbox" / name, dirs_exist_ok=True)
    (folder / "inbox" / name / "DELIVERED").touch()


def delivered(server: Served, number: int) -> list[str]:
    """The runs of deliveries from the first to the last, once so many have ended."""

    def ended() -> list[RunRecord]:
        runs = server.runs(flow_runs={"tags": {"all_": ["delivery"]}})
        assert len(runs) <= number
        found = [server.records.run(run["id"]) for run in runs if run["state_name"] == "Completed"]
        return [run for run in found if run is not None] if len(found) == number else []

    return [run.id for run in sorted(until(ended, 240, server.process), key=lambda run: run.scheduled)]


def published(folder: Path) -> dict[str, tuple[int, int]]:
    """Inode and time of every published file of the first delivery."""
    artifacts = json.loads(manifest(folder))["artifacts"]
    files = [folder / "inbox" / "first" / "results" / entry["file"] for entry in artifacts.values()]
    return {file.name: (file.stat().st_ino, file.stat().st_mtime_ns) for file in files}


def manifest(folder: Path) -> str:
    return (folder / "inbox" / "first" / "results" / "manifest.json").read_text()


def commands_of_the_page(folder: Path) -> tuple[list[str], list[str]]:
    """The lines of the page that back up the state folder, and those that restore it, for ours."""
    page = (REPOSITORY / "docs" / "operations.md").read_text(encoding="utf-8")
    found = re.findall(r"^(?:sqlite3|install -d|rm -f|cp) .*/var/lib/aerocal.*$", page, re.MULTILINE)
    ours = [
        line.replace("/var/lib/aerocal", f"{folder}/state").replace("/backup", f"{folder}/backup")
        for line in found
    ]
    assert [line.split()[0] for line in ours] == ["sqlite3", "sqlite3", "install", "rm", "cp", "cp"]
    return ours[:2], ours[2:]


def carry_out(commands: list[str]) -> None:
    for command in commands:
        subprocess.run(command, shell=True, check=True)


def restore(folder: Path) -> None:
    """Another machine with the same paths: the backup of the state, and what an earlier server has left."""
    (folder / "state").rename(folder / "lost")
    (folder / "state" / "prefect").mkdir(parents=True)
    (folder / "state").chmod(0o700)
    shutil.copyfile(folder / "prefect.db-wal", folder / "state" / "prefect" / "prefect.db-wal")
    carry_out(commands_of_the_page(folder)[1])


def by_id(server: Served) -> dict[str, RunRecord]:
    return {run.id: run for run in server.records.runs()}


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> Start:
    """A first start that was asked to end while one run was waiting for a lock and another for its turn."""
    folder = tmp_path_factory.mktemp("ends")
    write_block(folder / "made")
    write_stored_block(folder / "root" / "block", "results", "held", "later")
    (folder / "backup").mkdir()
    back_up, _ = commands_of_the_page(folder)
    # Its notices have nobody who takes them.
    away = f"json://127.0.0.1:{free_port('127.0.0.1')}"
    with served(folder, first_start=True, AEROCAL_NOTIFY=away) as server:
        deliver(folder, "first")
        (first,) = delivered(server, 1)
        missed = server.start(MANUAL, {"project": "block", "settings": {"sigma0_limit": 0.71}})
        assert server.ended(missed)["state_name"] == "GateFailed"
        carry_out(back_up[:1])  # while it runs
        groups = server.groups()
        held = server.start(MANUAL, {"project": "block", "output": "held"})
        with run_lock(folder / "root" / "block" / "held"):
            server.in_state(held, "RUNNING")
            server.process.send_signal(signal.SIGTERM)
            until(lambda: "a second request stops them now" in server.printed, 20)
            later = server.start(MANUAL, {"project": "block", "output": "later"})
            with pytest.raises(subprocess.TimeoutExpired):
                server.process.wait(6)
        code = server.process.wait(120)
    left = [group for group in groups if alive(group)]
    # sqlite3 clears away what the server has left.
    shutil.copyfile(folder / "state" / "prefect" / "prefect.db-wal", folder / "prefect.db-wal")
    carry_out(back_up[1:])
    runs = {"first": first, "missed": missed, "held": held, "later": later}
    notices = [notice.run for notice in Outbox(server.records).waiting()]
    return Start(
        folder, runs, left, code, recorded_states(folder), by_id(server), published(folder),
        manifest(folder), notices=notices, found=find_server(folder / "state") is not None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def restored(ended: Start) -> Start:
    """A second start from the backup, killed with a run begun and a delivery that nobody had taken."""
    folder = ended.folder
    restore(folder)
    with served(folder, "--cron", "30 1 * * *", "--watch", "1") as server:
        deliver(folder, "second")
        first, second = delivered(server, 2)
        server.ended(ended.runs["later"])
        time.sleep(5)  # several looks into the inbox
        records, files, before = by_id(server), published(folder), manifest(folder)
        schedules = server.api.get("/deployments/name/inbox/nightly")["schedules"]
        deliver(folder, "first")
        again = delivered(server, 3)[-1]
        with run_lock(folder / "root" / "block" / "results"):
            begun = server.start(MANUAL, {"project": "block"})
            server.in_state(begun, "RUNNING")
            # Nobody takes the delivery: the runner stays halted until it is killed, too.
            os.kill(server.group_of("flows.serving.deployments"), signal.SIGSTOP)
            deliver(folder, "first")
            until(lambda: len(server.runs(flow_runs={"tags": {"all_": ["delivery"]}})) == 4, 60)
            groups = server.groups()
            server.process.kill()
            for group in groups:
                os.killpg(group, signal.SIGKILL)
    states = recorded_states(folder)
    store_stages(folder / "hand")
    project = folder / "root" / "block" / "project.toml"
    command = [sys.executable, "-m", "flows.command", "run", str(project), "--out", str(folder / "hand")]
    alone = subprocess.run(command, env=server.environment, capture_output=True, text=True, check=False)
    assert alone.returncode == 0
    runs = {**ended.runs, "first": first, "second": second, "again": again, "begun": begun}
    left = [group for group in groups if alive(group)]
    code = server.process.wait()
    return Start(folder, runs, left, code, states, records, files, before, schedules, printed=alone.stderr)


@pytest.fixture(scope="module")
def finished(restored: Start) -> Start:
    """A third start that finished what the killed one has left, and was interrupted when it had."""
    folder = restored.folder
    with served(folder, "--limit", "2") as server:
        # It is seen to have crashed first, and started again a moment later.
        server.in_state(restored.runs["begun"], "COMPLETED", 150)
        runs = {**restored.runs, "third": delivered(server, 4)[-1]}
        schedules = server.api.get("/deployments/name/inbox/nightly")["schedules"]
        groups = server.groups()
        server.process.send_signal(signal.SIGINT)
        code = server.process.wait(60)
    left = [group for group in groups if alive(group)]
    files, last = published(folder), manifest(folder)
    return Start(folder, runs, left, code, recorded_states(folder), by_id(server), files, last, schedules)


def test_a_request_to_end_finishes_the_run_and_leaves_nothing_running(ended: Start) -> None:
    """Also where the notices of its runs have nobody who takes them."""
    assert ended.code == 0
    assert ended.notices == [ended.runs["missed"]]
    assert ended.states[ended.runs["held"]] == "COMPLETED"
    assert not {"RUNNING", "PENDING", "CANCELLING"} & set(ended.states.values())
    assert ended.runs["later"] not in ended.states, "a run that had not started waits for the next start"
    assert ended.left == []
    assert not ended.found


def test_a_restored_server_knows_its_runs_and_processes_nothing_twice(ended: Start, restored: Start) -> None:
    runs = restored.runs
    assert runs["first"] == ended.runs["first"]
    assert {runs[name] for name in ("first", "missed", "later", "second")} == set(restored.records)
    assert [restored.records[runs[name]].state for name in ("first", "later", "second")] == ["Completed"] * 3
    assert {run.attempts for run in restored.records.values()} == {1}
    assert (restored.files, restored.manifest) == (ended.files, ended.manifest)


def test_a_run_that_was_killed_with_everything_is_finished_after_the_next_start(
    restored: Start, finished: Start
) -> None:
    assert restored.states[restored.runs["begun"]] == "RUNNING"
    assert "Remark: The server" in restored.printed
    assert "no longer running" in restored.printed
    assert finished.states[restored.runs["begun"]] == "COMPLETED"
    assert (finished.code, finished.left) == (0, [])


def test_a_schedule_that_the_next_start_does_not_name_is_gone(restored: Start, finished: Start) -> None:
    assert len(restored.schedules) == 1
    assert finished.schedules == []


def test_one_delivery_delivered_three_times_with_redeploys_between_is_computed_once(
    ended: Start, finished: Start
) -> None:
    runs = [finished.records[finished.runs[name]] for name in ("first", "again", "third")]
    assert [{stage.reused for stage in run.stages} for run in runs] == [{False}, {True}, {True}]
    assert [run.project for run in finished.records.values()].count("first") == 3
    assert finished.files == ended.files
    store = finished.folder / "inbox" / "first" / "results" / ".store"
    assert len(list((store / "bundle_adjustment").iterdir())) == 1


def test_runner_and_server_end_by_themselves_when_nobody_holds_them(tmp_path: Path) -> None:
    write_stored_block(tmp_path / "root" / "block", "results")
    with served(tmp_path) as server:
        groups = server.groups()
        with run_lock(tmp_path / "root" / "block" / "results"):
            run = server.start(MANUAL, {"project": "block"})
            server.in_state(run, "RUNNING")
            server.process.kill()
            server.process.wait()
        until(lambda: not any(alive(group) for group in groups), 90)
    assert recorded_states(tmp_path)[run] == "COMPLETED"
