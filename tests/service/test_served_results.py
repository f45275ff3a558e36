"""What ``aerocal serve`` does with results: notices to receivers, links in the dashboard, object storage."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import pytest

from flows.server.door import basic
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.fetch import fetch_results
from tests.flows.conftest import write_block
from tests.service.object_server import BUCKET, ObjectServer
from tests.service.served import Served, served, until
from tests.tasks.production.receivers import WebReceiver, web_receiver

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

MANUAL = "aerial-triangulation/manual"
STORAGE = ObjectAddress(BUCKET, "served")


@pytest.fixture(scope="module")
def receiver() -> Iterator[WebReceiver]:
    with web_receiver(answers=[500]) as web:
        yield web


@pytest.fixture(scope="module")
def server(
    tmp_path_factory: pytest.TempPathFactory, receiver: WebReceiver, object_server: ObjectServer
) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("results")
    write_block(folder / "root" / "block")
    object_server.gate.reset()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in object_server.environment().items():
            patch.setenv(name, value)
        with served(folder, "--results", str(STORAGE), AEROCAL_NOTIFY=receiver.address) as running:
            yield running


def artifacts(server: Served, run: str) -> dict[str, Any]:
    asked = {"artifacts": {"flow_run_id": {"any_": [run]}}}
    found = server.api.post("/artifacts/filter", asked)
    return {one["key"].partition("triangulation-")[2]: one for one in found}


def test_a_further_runner_that_would_store_no_results_is_refused(server: Served) -> None:
    command = [sys.executable, "-m", "flows.command", "runner", "--root", str(server.folder / "root")]
    done = subprocess.run(
        command, env=server.environment, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2
    assert f"stores results at {STORAGE}, and this runner at no address." in done.stderr
    assert "--results" in done.stderr


def test_a_failed_gate_is_told_and_shown(server: Served, receiver: WebReceiver) -> None:
    settings = {"sigma0_limit": 0.71}
    run = server.start(MANUAL, {"project": "block", "settings": settings, "output": "strict"})
    assert server.ended(run)["state_name"] == "GateFailed"
    until(lambda: receiver.accepted, 60)
    notice = receiver.accepted[0]["notice"]
    assert (notice["run"], notice["kind"], notice["project"]) == (run, "gate", "block")
    assert len(receiver.asked) == 2, "the first answer was 500"
    made = artifacts(server, run)

    def known(address: str) -> Request:
        return Request(address, headers={"Authorization": basic(server.password)})

    assert set(made) == {"verdict"}
    assert made["verdict"]["data"].startswith("**GateFailed: ")
    assert notice["links"]["report"] in made["verdict"]["data"]
    with urlopen(known(notice["links"]["report"])) as answer:
        assert answer.status == 200


def test_the_addresses_are_nowhere_but_in_the_process_that_sends(server: Served) -> None:
    token = b"secret-token"
    for child in server.groups():
        for process in Path("/proc").glob("[0-9]*"):
            try:
                if os.getpgid(int(process.name)) == child:
                    assert token not in (process / "environ").read_bytes()
            except (ProcessLookupError, FileNotFoundError):
                continue
    files = [file for file in (server.folder / "state").rglob("*") if file.is_file()]
    assert not [file for file in files if token in file.read_bytes()]
    assert token.decode() not in server.printed


def tables(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_results_of_the_server_are_beside_the_project_and_on_object_storage(
    server: Served, tmp_path: Path
) -> None:
    """Those of runs by hand, while it runs, are where they are told to be."""
    block = server.folder / "root" / "block"
    run = server.ended(server.start(MANUAL, {"project": "block"}))
    assert run["state_name"] == "Completed", run["state"]["message"]
    fetch_results(STORAGE.below("root", "block", "results"), tmp_path / "deployed")
    assert tables(tmp_path / "deployed") == tables(block / "results")
    by_hand = STORAGE.below("by-hand")
    command = [sys.executable, "-m", "flows.command", "run", str(block / "project.toml")]
    done = subprocess.run(
        [*command, "--out", str(by_hand)],
        env={**server.environment, "AEROCAL_WORKSPACES": str(tmp_path / "workspaces")},
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert done.returncode == 0, done.stderr
    seen = server.runs(flow_runs={"name": {"any_": ["block/project.toml"]}})
    assert [one["state"]["message"] for one in seen] == [f"Results are in {by_hand}."]
    fetch_results(by_hand, tmp_path / "hand")
    assert tables(tmp_path / "hand") == tables(tmp_path / "deployed")
