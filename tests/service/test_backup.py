"""Backup and restore as the page on operations has them: nothing is lost, nothing is processed twice."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY
from tests.faults.projects import deliver
from tests.flows.conftest import write_block
from tests.service.served import Served, served, until

pytestmark = [pytest.mark.service, pytest.mark.timeout(900)]


def commands_of_the_page() -> list[str]:
    """The lines of the page that back up the state folder."""
    page = (REPOSITORY / "docs" / "operations.md").read_text(encoding="utf-8")
    found = re.findall(r"^(?:sqlite3|cp) .*/var/lib/aerocal.*$", page, re.MULTILINE)
    assert [line.split()[0] for line in found] == ["sqlite3", "cp"]
    return found


def back_up(state: Path, backup: Path, command: str) -> None:
    here = command.replace("/var/lib/aerocal", str(state)).replace("/backup", str(backup))
    subprocess.run(here, shell=True, check=True)


def delivered(server: Served, number: int) -> list[dict[str, object]]:
    """The runs of deliveries, once so many have ended."""

    def ended() -> list[dict[str, object]]:
        runs = server.runs(flow_runs={"tags": {"all_": ["delivery"]}})
        done = [run for run in runs if run["state_name"] == "Completed"]
        return done if len(done) == number else []

    return until(ended, 240, server.process)


def test_a_restored_server_knows_its_runs_and_processes_nothing_twice(tmp_path: Path) -> None:
    state, backup = tmp_path / "state", tmp_path / "backup"
    backup.mkdir()
    write_block(tmp_path / "made" / "first")
    write_block(tmp_path / "made" / "second")
    records, prefect = commands_of_the_page()
    with served(tmp_path) as server:
        deliver(tmp_path / "made" / "first", tmp_path / "inbox")
        (run,) = delivered(server, 1)
        back_up(state, backup, records)  # while it runs
        server.process.send_signal(signal.SIGTERM)
        server.process.wait(120)
    back_up(state, backup, prefect)
    before = (tmp_path / "inbox" / "first" / "results" / "manifest.json").read_bytes()

    # Another machine with the same paths: nothing but the backup of the state.
    state.rename(tmp_path / "lost")
    state.mkdir(mode=0o700)
    shutil.copyfile(backup / "records.sqlite", state / "records.sqlite")
    shutil.copytree(backup / "prefect", state / "prefect")
    with served(tmp_path) as server:
        deliver(tmp_path / "made" / "second", tmp_path / "inbox")
        runs = delivered(server, 2)
        assert str(run["id"]) in {str(one["id"]) for one in runs}
        recorded = server.records.run(str(run["id"]))
        assert recorded is not None
        assert recorded.state == "Completed"
        time.sleep(5)  # several looks into the inbox
        assert len(server.records.runs()) == 2
    assert (tmp_path / "inbox" / "first" / "results" / "manifest.json").read_bytes() == before
