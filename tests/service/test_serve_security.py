"""``aerocal serve`` where others reach it: nobody gets in without the password, and nobody learns it."""

from __future__ import annotations

import base64
import json
import os
import sqlite3
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from flows.server.door import basic
from flows.server.server_process import CLIENT_PASSWORD, SERVER_PASSWORD
from tasks.files.installation import InstallationError
from tests.flows.conftest import write_block
from tests.ports import free_port
from tests.service.served import Served, environment, served
from tests.service.stored_block import store_stages, write_stored_block

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

SECRET = "kept-to-themselves-7391"
WORDS = f"clerk:{SECRET}"
WRONG = (None, "", "clerk:", "clerk:wrong", f"{WORDS}x", SECRET)
#: What says nothing but that a server is there.
OPEN = {"/api/health", "/api/ready"}
MANUAL = "aerial-triangulation/manual"
#: Names that no folder of results has: not seen as they are, hidden, or ours.
OUTPUTS = ("a\nb", "results\n", "\x1b[2J", "a\u202eb", "a\u2066b", ".git", ".store", "..", " ", "")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("guarded")
    write_stored_block(folder / "root" / "block", "results")
    write_block(folder / "outside")
    for name in ("with", "without"):
        store_stages(folder / name)
    with served(folder, "--host", "0.0.0.0", **{SERVER_PASSWORD: WORDS}) as running:
        yield running


@pytest.fixture(scope="module")
def run_by_form(server: Served) -> str:
    """A run that has ended."""
    run = server.start(MANUAL, {"project": "block"})
    server.ended(run)
    return run


def asked(address: str, method: str = "GET", password: str | None = None) -> int:
    """The status a call is answered with."""
    request = urllib.request.Request(address, None if method == "GET" else b"{}", method=method)
    request.add_header("Content-Type", "application/json")
    if password is not None:
        request.add_header("Authorization", basic(password))
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def test_without_password_it_does_not_start(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "flows.command", "serve", "--host", "0.0.0.0", "--root", str(tmp_path)]
    ports = ["--port", str(free_port("127.0.0.1")), "--overview-port", str(free_port("127.0.0.1"))]
    variables = environment(tmp_path)
    done = subprocess.run(
        [*command, *ports], env=variables, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert f"Set {SERVER_PASSWORD}=user:password" in done.stderr


def test_every_call_of_the_api_is_refused_without_the_right_password(server: Served) -> None:
    base = f"http://127.0.0.1:{server.port}"
    described = urllib.request.Request(f"{base}/openapi.json", headers={"Authorization": basic(WORDS)})
    with urllib.request.urlopen(described, timeout=60) as answer:
        paths = json.load(answer)["paths"]
    calls = [
        (method.upper(), path if path.startswith("/api") else f"/api{path}")
        for path, methods in paths.items()
        for method in methods
    ]
    assert len(calls) > 150
    let_in = {
        path for method, path in calls if asked(base + path.replace("{", "").replace("}", ""), method) != 401
    }
    assert let_in == OPEN


@pytest.mark.parametrize("password", WRONG)
def test_a_wrong_password_starts_no_run_and_read_nothing(server: Served, password: str | None) -> None:
    deployment = server.api.get(f"/deployments/name/{MANUAL}")["id"]
    before = len(server.runs())
    base = f"http://127.0.0.1:{server.port}/api"
    assert asked(f"{base}/deployments/{deployment}/create_flow_run", "POST", password) == 401
    assert asked(f"{base}/flow_runs/filter", "POST", password) == 401
    assert asked(f"{base}/admin/settings", "GET", password) == 401
    assert asked(f"http://127.0.0.1:{server.overview}/", "GET", password) == 401
    assert len(server.runs()) == before


def answered(server: Served, path: str, first: dict[str, object], protocols: list[Subprotocol]) -> str | None:
    """What a websocket answers to a first message; None if it is closed, or not opened."""
    try:
        with connect(f"ws://127.0.0.1:{server.port}/api{path}", subprotocols=protocols or None) as socket:
            socket.send(json.dumps(first))
            return str(socket.recv(timeout=20))
    except (ConnectionClosed, InvalidStatus):
        return None


WEBSOCKETS = (
    "/events/in",
    "/events/out",
    "/logs/out",
    "/task_runs/subscriptions/scheduled",
    "/work_pools/x/workers/connect",
)


@pytest.mark.parametrize("path", WEBSOCKETS)
def test_no_websocket_answers_without_the_right_password(server: Served, path: str) -> None:
    prefect = [Subprotocol("prefect")]
    for password in WRONG:
        assert answered(server, path, {"type": "auth", "token": password}, prefect) is None, password
    for first in ({"type": "event", "event": {}}, {"type": "subscribe", "keys": ["x"]}):
        assert answered(server, path, first, prefect) is None
        assert answered(server, path, first, []) is None
    assert answered(server, path, {"type": "auth", "token": WORDS}, []) is None


def test_the_right_password_opens_a_websocket(server: Served) -> None:
    said = answered(server, "/events/out", {"type": "auth", "token": WORDS}, [Subprotocol("prefect")])
    assert said is not None
    assert json.loads(said) == {"type": "auth_success"}


def test_with_the_right_password_a_run_by_form_is_carried_out(server: Served, run_by_form: str) -> None:
    assert server.run(run_by_form)["state_name"] == "Completed"
    assert (server.folder / "root" / "block" / "results" / "report.html").is_file()


def test_a_run_by_form_is_confined_to_the_folders(server: Served) -> None:
    outside = server.folder / "outside"
    for parameters in (
        {"project": "block", "output": "../x"},
        {"project": "block", "settings": {"inputs.exposures.file": "/etc/passwd"}},
        {"project": "block", "data": str(outside)},
        *({"project": "block", "output": name} for name in OUTPUTS),
    ):
        with pytest.raises(InstallationError, match=r"refused.*\((409|422)\)"):
            server.start(MANUAL, parameters)
    runs = [
        server.start(MANUAL, parameters, enforce_parameter_schema=False)
        for parameters in (
            {"project": str(outside)},
            {"project": "block", "data": str(outside), "output": "x"},
            {"project": "block", "output": ".git"},
        )
    ]
    # A parameter that a story does not have is refused even if the form was told not to look.
    assert [server.ended(run)["state_name"] for run in runs] == ["InputError"] * 3
    assert not (server.folder / "root" / "block" / "x").exists()
    assert not (outside / "results").exists()


def run_by_hand(server: Served, folder: str, **variables: str) -> subprocess.CompletedProcess[str]:
    block = server.folder / "root" / "block" / "project.toml"
    command = [sys.executable, "-m", "flows.command", "run", str(block), "--out", str(server.folder / folder)]
    return subprocess.run(
        command, env=server.environment | variables, capture_output=True, text=True, check=False, timeout=280
    )


def test_a_run_by_hand_is_reported_with_the_password_only(server: Served) -> None:
    def reported() -> int:
        return len(server.runs(flow_runs={"name": {"any_": ["block/project.toml"]}}))

    done = run_by_hand(server, "with", **{CLIENT_PASSWORD: WORDS})
    assert done.returncode == 0, done.stderr
    assert reported() == 1
    # A server that nobody asked for is passed over; the run itself is done.
    done = run_by_hand(server, "without")
    assert done.returncode == 0, done.stderr
    wrong = {CLIENT_PASSWORD: "clerk:wrong", "PREFECT_API_URL": server.api.url}
    asked_for = run_by_hand(server, "wrong", **wrong)
    assert asked_for.returncode == 1, asked_for.stdout + asked_for.stderr
    for told in (done.stderr, asked_for.stderr):
        assert f"set {CLIENT_PASSWORD}=user:password" in told
        assert "Traceback" not in told
    assert reported() == 1


@pytest.mark.usefixtures("run_by_form")
def test_the_password_is_nowhere_to_be_read(server: Served) -> None:
    """After the calls, right and wrong, and the runs above."""
    coded = base64.b64encode(WORDS.encode())
    for file in [path for path in server.folder.rglob("*") if path.is_file()]:
        content = file.read_bytes()
        assert SECRET.encode() not in content, file
        assert coded not in content, file
    ours = server.groups() | {os.getpgid(server.process.pid)}
    seen = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(process.name)) not in ours:
                continue
            line = (process / "cmdline").read_bytes()
        except OSError:
            continue
        seen += 1
        assert SECRET.encode() not in line
    assert seen >= 4
    assert SECRET not in json.dumps(server.api.get("/admin/settings"))
    logs = server.api.post("/logs/filter", {"limit": 200})
    assert logs
    assert SECRET not in json.dumps(logs)


@pytest.mark.usefixtures("run_by_form")
def test_what_it_keeps_is_for_its_user_only_and_holds_no_pickles(server: Served) -> None:
    state = server.folder / "state"
    assert state.stat().st_mode & 0o077 == 0
    assert not (state / "prefect" / "storage").exists()
    with closing(sqlite3.connect(f"file:{state / 'prefect' / 'prefect.db'}?mode=ro", uri=True)) as database:
        kept = database.execute("SELECT data FROM flow_run_state UNION ALL SELECT data FROM task_run_state")
        texts = [text for (text,) in kept if text not in (None, "null")]
    for text in texts:
        assert "pickle" not in text.lower()
        # A reference to a result would name where it is stored.
        assert json.loads(text).get("storage_key") is None if text.startswith("{") else True
