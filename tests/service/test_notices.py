"""A failed gate under a real ``aerocal serve`` is told to a webhook, and stands in the dashboard."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import pytest

from flows.server.door import basic
from tests.flows.conftest import write_block
from tests.ports import free_port
from tests.service.served import Served, served, until
from tests.tasks.production.receivers import WebReceiver, web_receiver

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

MANUAL = "aerial-triangulation/manual"


@pytest.fixture(scope="module")
def receiver() -> Iterator[WebReceiver]:
    with web_receiver(answers=[500]) as web:
        yield web


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, receiver: WebReceiver) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("notices")
    write_block(folder / "root" / "block")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_NOTIFY", receiver.address)
        with served(folder) as running:
            yield running


def artifacts(server: Served, run: str) -> dict[str, Any]:
    asked = {"artifacts": {"flow_run_id": {"any_": [run]}}}
    found = server.api.post("/artifacts/filter", asked)
    return {one["key"].partition("triangulation-")[2]: one for one in found}


def test_a_failed_gate_is_told_and_shown(server: Served, receiver: WebReceiver) -> None:
    run = server.start(MANUAL, {"project": "block", "settings": {"sigma0_limit": 0.71}})
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


def test_the_server_ends_with_a_receiver_that_is_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_block(tmp_path / "root" / "block")
    monkeypatch.setenv("AEROCAL_NOTIFY", f"json://127.0.0.1:{free_port('127.0.0.1')}")
    with served(tmp_path) as server:
        run = server.start(MANUAL, {"project": "block", "settings": {"sigma0_limit": 0.71}})
        assert server.ended(run)["state_name"] == "GateFailed"
        server.process.send_signal(signal.SIGTERM)
        assert server.process.wait(90) == 0
