"""``aerocal run --out s3://…`` as its users meet it, faults included."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.fetch import fetch_results
from tasks.object_storage.workspace import ObjectWorkspace
from tests.command_line import aerocal
from tests.flows.conftest import write_block
from tests.service.object_server import CREDENTIALS, ObjectServer, on_put, running_object_server
from tests.service.served import until

pytestmark = [pytest.mark.service, pytest.mark.usefixtures("server")]

#: Another result from the same deliveries: only the adjustment and what follows it is computed again.
OTHER = ("--set", "adjustment.free=[]")


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_block(tmp_path_factory.mktemp("block"))


@pytest.fixture(scope="module")
def in_folders(block: Path) -> dict[tuple[str, ...], Path]:
    """Results of both runs in plain folders."""
    folders = {(): block.parent / "plain", OTHER: block.parent / "other"}
    for options, folder in folders.items():
        done = aerocal("run", block, "--out", folder, *options)
        assert done.returncode == 0, done.stderr
    return folders


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "flows.command", *map(str, arguments)]


def errors(done: subprocess.CompletedProcess[str]) -> list[str]:
    assert "Traceback" not in done.stderr, done.stderr
    return [line for line in done.stderr.splitlines() if line.startswith("Error: ")]


def reused(folder: Path) -> list[bool]:
    return [stage["reused"] for stage in json.loads((folder / "manifest.json").read_text())["stages"]]


def published(folder: Path) -> dict[str, bytes]:
    """All tables and pages."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".parquet", ".html")}


def fetched(address: ObjectAddress, folder: Path) -> dict[str, bytes]:
    fetch_results(address, folder)
    return published(folder)


def test_what_became_of_deliveries_is_published_with_the_results(
    block: Path, address: ObjectAddress, tmp_path: Path
) -> None:
    deliver = 'deliver=[{format="eo-csv"}]'
    done = aerocal("run", block, "--out", str(address), "--set", deliver)
    assert done.returncode == 0, done.stderr
    assert "object storage contains tables and pages" in done.stdout
    found = ObjectWorkspace.at(address).manifest()
    assert found is not None
    assert [(one.format, one.written) for one in found.summary.deliveries] == [("eo-csv", True)]
    brought = fetched(address, tmp_path / "one")
    assert "exterior_orientations.parquet" in brought
    summary = json.loads((tmp_path / "one" / "summary.json").read_text())
    assert summary["gates"][-1]["name"] == "delivery_export/eo-csv"


def test_results_are_those_of_a_folder_and_another_machine_computes_nothing(
    block: Path, in_folders: dict[tuple[str, ...], Path], address: ObjectAddress, tmp_path: Path
) -> None:
    done = aerocal("run", block, "--out", str(address))
    assert done.returncode == 0, done.stderr
    assert f"aerocal fetch {address}" in done.stdout
    brought = aerocal("fetch", str(address), "--to", tmp_path / "one")
    assert brought.returncode == 0, brought.stderr
    assert published(tmp_path / "one") == published(in_folders[()])
    assert not any(reused(tmp_path / "one"))
    written = done.stdout + done.stderr + (tmp_path / "one" / "manifest.json").read_text()
    assert not [secret for secret in CREDENTIALS.values() if secret in written]
    other = aerocal("run", block, "--out", str(address), AEROCAL_WORKSPACES=str(tmp_path / "two"))
    assert other.returncode == 0, other.stderr
    assert fetched(address, tmp_path / "two-fetched") == published(in_folders[()])
    assert all(reused(tmp_path / "two-fetched"))


def killed_at_put(server: ObjectServer, ends: str, arguments: list[str], *, arrives: bool) -> None:
    """Run, and kill at the PUT of an object: before it arrives, or before the run knows it has."""
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def kill() -> None:
        process.kill()
        process.wait()

    at_end = on_put(ends, kill)
    if arrives:
        server.gate.afterwards = at_end
    else:

        def refuse(method: str, path: str) -> int | None:
            at_end(method, path)
            return 503 if process.poll() is not None else None

        server.gate.rule = refuse
    assert process.wait(timeout=120) == -signal.SIGKILL
    server.gate.reset()


def test_a_run_killed_at_any_put_leaves_whole_results_and_the_next_one_goes_on(
    server: ObjectServer,
    block: Path,
    in_folders: dict[tuple[str, ...], Path],
    address: ObjectAddress,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before, after = published(in_folders[()]), published(in_folders[OTHER])
    assert aerocal("run", block, "--out", str(address)).returncode == 0
    run = command("run", block, "--out", str(address), *OTHER)
    for machine, ends, arrives in (
        ("workspaces", "/residuals.parquet", False),
        ("another", "/stage.json", False),
        ("another", "/summary.json", True),
    ):
        monkeypatch.setenv("AEROCAL_WORKSPACES", str(tmp_path / machine))
        killed_at_put(server, ends, run, arrives=arrives)
        assert fetched(address, tmp_path / "reader") == before, ends
    killed_at_put(server, "/manifest.json", run, arrives=True)
    assert fetched(address, tmp_path / "reader") == after
    assert aerocal(*run[3:]).returncode == 0
    assert fetched(address, tmp_path / "reader") == after
    assert all(reused(tmp_path / "reader"))


def test_an_outage_beyond_the_limit_is_exit_code_1_and_the_next_run_outlasts_a_shorter_one(
    server: ObjectServer,
    block: Path,
    in_folders: dict[tuple[str, ...], Path],
    address: ObjectAddress,
    tmp_path: Path,
) -> None:
    server.gate.rule = lambda method, path: 503 if method == "PUT" and "bundle_adjustment" in path else None
    ended = aerocal("run", block, "--out", str(address), AEROCAL_S3_PATIENCE="1")
    assert ended.returncode == 1
    assert len(errors(ended)) == 1
    assert "has not answered for" in errors(ended)[0]
    assert "Run again" in errors(ended)[0]
    assert ObjectWorkspace.at(address).manifest() is None
    server.gate.reset()
    told = tmp_path / "told"
    with told.open("wb") as stderr:
        again = subprocess.Popen(command("run", block, "--out", str(address)), stdout=stderr, stderr=stderr)
    with server.stopped():
        until(lambda: f"{address} does not answer (timeout was reached)" in told.read_text(), 60.0, again)
    assert again.wait(timeout=120) == 0, told.read_text()
    assert f"{address} answers again" in told.read_text()
    assert fetched(address, tmp_path / "reader") == published(in_folders[()])
    assert reused(tmp_path / "reader") == [True, True, True, True, True, False, False]


def test_wrong_credentials_are_exit_code_1_and_nothing_is_computed(
    block: Path, address: ObjectAddress, tmp_path: Path
) -> None:
    # From its second request on this server knows nobody.
    with running_object_server(tmp_path, INITIAL_NO_AUTH_ACTION_COUNT="1") as strict:
        strict.make_bucket(address.bucket)
        refused = aerocal("run", block, "--out", str(address), AWS_ENDPOINT_URL=strict.gate.url)
    assert refused.returncode == 1
    assert len(errors(refused)) == 1
    assert "access is denied" in errors(refused)[0]
    assert not [secret for secret in CREDENTIALS.values() if secret in refused.stdout + refused.stderr]
    kept = [path.name for path in (tmp_path / "workspaces").rglob("*") if path.is_file()]
    assert kept == ["lock"]
