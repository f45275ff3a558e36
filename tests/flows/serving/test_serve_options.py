"""What ``aerocal serve`` refuses before it starts anything."""

from __future__ import annotations

import inspect
import os
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import asyncpg
import pytest
from sqlalchemy.engine import make_url

from flows.server.door import door_of
from flows.server.server_process import CLIENT_PASSWORD, SERVER_PASSWORD, ServerAddress, server_environment
from flows.server.settings import Settings, settings_of, settings_of_runner
from flows.server.state_file import (
    RunningServer,
    kept_password,
    password_of,
    the_only_server,
    write_state,
)
from flows.serving.further_runner import work_for
from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tests.ports import free_port

LOCAL = ServerAddress("127.0.0.1", 4200)
DOOR = door_of("aerocal:secret", ["127.0.0.1"], [])


def options(folder: Path, **changed: Any) -> Settings:
    given: dict[str, Any] = {
        "host": "127.0.0.1",
        "port": 4200,
        "public_url": None,
        "public_overview_url": None,
        "overview_port": None,
        "database": None,
        "root": [folder],
        "inbox": folder,
        "story": "aerial-triangulation",
        "watch": 20.0,
        "cron": "30 1 * * *",
        "notify_on": "gate,failure,recalibration",
        "timezone": "Europe/Berlin",
        "registry": None,
        "recalibration_cron": None,
        "keep_days": None,
        "history_days": 365,
        "results": None,
        "limit": 1,
        "state": folder / "state",
    }
    return settings_of(given | changed)


def test_the_runner_gets_what_was_given(tmp_path: Path) -> None:
    given = options(tmp_path, limit=3, public_url="https://x.example", results=None)
    assert (given.limit, given.inbox, given.cron) == (3, tmp_path, "30 1 * * *")
    assert settings_of_runner(given.variables()) == given
    assert given.variables()["AEROCAL_ROOTS"] == f'["{tmp_path}"]'


def test_the_inbox_is_a_root_and_links_are_resolved(tmp_path: Path) -> None:
    for name in ("inbox", "root"):
        (tmp_path / name).mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "inbox")
    given = options(tmp_path, root=[tmp_path / "root"], inbox=tmp_path / "link")
    assert given.inbox == tmp_path / "inbox"
    assert given.roots.folders == (tmp_path / "root", tmp_path / "inbox")


@pytest.mark.parametrize(
    ("changed", "remedy"),
    [
        ({"inbox": None}, "--inbox"),
        ({"inbox": Path("/no/such/folder")}, "--inbox"),
        ({"root": [Path("/no/such/folder")]}, "--root"),
        ({"cron": "nightly"}, "30 1"),
        ({"cron": "61 1 * * *"}, "30 1"),
        ({"cron": "0 1 * * FOO"}, "30 1"),
        ({"only_on_schedule": True, "cron": None}, "--cron"),
        ({"timezone": "Europe/Berlinn"}, "IANA"),
        ({"timezone": "../../etc/passwd"}, "IANA"),
        ({"story": "aerial-triangulaton"}, "aerial-triangulation"),
        ({"recalibration_cron": "0 6 * * 1"}, "--registry"),
        ({"notify_on": "gates"}, "gate"),
        ({"registry": "/no/such/registry.sqlite"}, "--root"),
        ({"registry": "mysql://h/d"}, "postgresql"),
    ],
)
def test_wrong_options_name_their_remedy(tmp_path: Path, changed: dict[str, Any], remedy: str) -> None:
    with pytest.raises(InputError) as refused:
        options(tmp_path, **changed)
    assert remedy in refused.value.remedy


def test_a_registry_under_the_folders_is_looked_at_on_mondays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("AEROCAL_REGISTRY", raising=False)
    assert options(tmp_path).registry is None
    assert options(tmp_path).recalibration_cron is None
    file = str(tmp_path / "registry.sqlite")
    assert options(tmp_path, registry=file).registry == file
    assert options(tmp_path, registry=file).recalibration_cron == "0 6 * * 1"
    given = options(tmp_path, registry=file, recalibration_cron="0 7 * * *")
    assert settings_of_runner(given.variables()).recalibration_cron == "0 7 * * *"
    with pytest.raises(InputError, match="not a schedule"):
        options(tmp_path, registry=file, recalibration_cron="weekly")
    monkeypatch.setenv("AEROCAL_REGISTRY", file)
    assert options(tmp_path).registry == file
    server = "postgresql://me@host/calibrations"
    assert options(tmp_path, registry=server).registry == server


def test_the_server_forgets_runs_after_the_days_it_was_told(tmp_path: Path) -> None:
    given = options(tmp_path, history_days=100, keep_days=30)
    assert (given.history_days, given.keep_days) == (100, 30)
    assert settings_of_runner(given.variables()).keep_days == 30
    made = server_environment(LOCAL, None, DOOR, {}, history_days=given.history_days)
    assert made["PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD"] == "8640000"
    assert made["PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED"] == "events,flow_runs"


def test_a_link_does_not_lead_to_a_registry_outside(tmp_path: Path) -> None:
    for name in ("root", "elsewhere"):
        (tmp_path / name).mkdir()
    (tmp_path / "root" / "r.sqlite").symlink_to(tmp_path / "elsewhere" / "r.sqlite")
    with pytest.raises(InputError, match="outside the folders"):
        options(tmp_path / "root", registry=str(tmp_path / "root" / "r.sqlite"))


def test_a_password_has_no_place_in_the_address_of_the_database(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="PGPASSWORD") as refused:
        options(tmp_path, database="postgresql://clerk:hushed@127.0.0.1/prefect")
    assert "hushed" not in str(refused.value)
    assert options(tmp_path, database="postgresql://clerk@127.0.0.1/prefect").records.endswith("/prefect")


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "::", "example.org"])
def test_a_server_that_others_reach_is_told_what_they_must_say(host: str, tmp_path: Path) -> None:
    address = ServerAddress(host, 4200)
    for environment in ({}, {CLIENT_PASSWORD: "user:password"}):
        with pytest.raises(InstallationError, match=SERVER_PASSWORD):
            password_of(address, tmp_path, environment)
    assert password_of(address, tmp_path, {SERVER_PASSWORD: "user:password"}) == "user:password"
    made = server_environment(address, None, DOOR, {})
    assert (made["PREFECT_SERVER_API_HOST"], made[SERVER_PASSWORD]) == (host, DOOR.password)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("host", ["127.0.0.1", "127.3.2.1", "::1", "localhost"])
def test_on_loopback_a_secret_is_made_once_for_this_user_only(host: str, tmp_path: Path) -> None:
    address = ServerAddress(host, 4200)
    password = password_of(address, tmp_path, {})
    assert len(password) > 40
    assert password_of(address, tmp_path, {}) == password == kept_password(tmp_path)
    (file,) = tmp_path.iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    assert password_of(address, tmp_path, {SERVER_PASSWORD: "user:password"}) == "user:password"
    assert password not in file.parent.name
    made = server_environment(address, None, DOOR, {"PREFECT_API_URL": "http://elsewhere/api"})
    assert "PREFECT_API_URL" not in made
    assert made["PREFECT_SERVER_CORS_ALLOWED_ORIGINS"] == ServerAddress(host, 4200).base


def test_a_secret_that_others_can_read_is_none(tmp_path: Path) -> None:
    password_of(LOCAL, tmp_path, {})
    (tmp_path / "secret").chmod(0o640)
    with pytest.raises(InstallationError, match="can be read or was written by others"):
        password_of(LOCAL, tmp_path, {})
    (tmp_path / "secret").unlink()
    (tmp_path / "secret").symlink_to("/etc/hostname")
    with pytest.raises(InstallationError, match="Remove it"):
        password_of(LOCAL, tmp_path, {})


def test_browsers_are_told_an_address_they_can_open(tmp_path: Path) -> None:
    given = options(tmp_path, host="0.0.0.0", public_url="https://aerocal.example.org/").address
    made = server_environment(given, None, DOOR, {})
    assert made["PREFECT_SERVER_UI_API_URL"] == "/api"
    assert made["PREFECT_SERVER_CORS_ALLOWED_ORIGINS"] == "https://aerocal.example.org"
    assert given.api == "http://0.0.0.0:4200/api"
    page = options(tmp_path, host="0.0.0.0", public_overview_url="https://production.example.org/").overview
    assert (page.dashboard, page.host) == ("https://production.example.org", "0.0.0.0")
    assert ServerAddress("0.0.0.0", 4200).dashboard == f"http://{socket.gethostname()}:4200"
    paths = ("https://example.org/aerocal", "https://example.org/aerocal/")
    for text in ("aerocal.example.org", "ftp://example.org", "https://", "javascript:alert(1)", *paths):
        with pytest.raises(InputError, match="--public-url"):
            options(tmp_path, public_url=text)
        with pytest.raises(InputError, match="--public-overview-url"):
            options(tmp_path, public_overview_url=text)


def test_the_dashboard_is_told_where_the_server_is() -> None:
    assert server_environment(LOCAL, None, DOOR, {})["PREFECT_SERVER_UI_API_URL"] == "/api"
    assert ServerAddress("::1", 1).api == "http://[::1]:1/api"


def test_the_database_is_postgresql_or_ours() -> None:
    for given in ("postgresql://me@host/db", "postgres://me@host/db", "postgresql+asyncpg://me@host/db"):
        made = server_environment(LOCAL, given, DOOR, {})
        assert made["PREFECT_SERVER_DATABASE_CONNECTION_URL"] == "postgresql+asyncpg://me@host/db"
    with pytest.raises(InstallationError) as refused:
        server_environment(LOCAL, "mysql://me:hushed@host/db", DOOR, {})
    assert "hushed" not in str(refused.value)


@pytest.mark.parametrize(
    ("mode", "ssl", "tls"),
    [("disable", "disable", None), ("require", "require", None), ("verify-full", None, "true")],
)
def test_the_connection_of_the_server_is_encrypted_as_the_address_says(
    mode: str, ssl: str | None, tls: str | None
) -> None:
    made = server_environment(LOCAL, f"postgresql://me@host/db?sslmode={mode}", DOOR, {})
    url = make_url(made["PREFECT_SERVER_DATABASE_CONNECTION_URL"])
    _, given = url.get_dialect()().create_connect_args(url)
    assert set(given) <= set(inspect.signature(asyncpg.connect).parameters)
    assert given.get("ssl") == ssl
    assert made.get("PREFECT_SERVER_DATABASE_SQLALCHEMY_CONNECT_ARGS_TLS_ENABLED") == tls


def test_a_port_that_is_taken_is_one_line_and_nothing_is_left(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        command = [sys.executable, "-m", "flows.command", "serve", "--port", port, "--root", str(tmp_path)]
        environment = {**os.environ, "AEROCAL_STATE": str(tmp_path / "state")}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "--port" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "state").exists()


def test_a_path_for_temporary_files_that_is_too_long_for_a_socket_is_refused_with_the_remedy(
    tmp_path: Path,
) -> None:
    """Every run would crash: the process that forks it could not be reached."""
    folder = tmp_path / "root"
    folder.mkdir()
    long = tmp_path / ("x" * 75)
    long.mkdir()
    command = [sys.executable, "-m", "flows.command", "serve", "--root", str(folder)]
    command += ["--port", str(free_port("127.0.0.1")), "--overview-port", str(free_port("127.0.0.1"))]
    variables = {**os.environ, "TMPDIR": str(long), "AEROCAL_STATE": str(tmp_path / "state")}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=variables, timeout=60)
    assert done.returncode == 1
    assert "Set TMPDIR to a folder with a shorter path." in " ".join(done.stderr.split())
    assert not (tmp_path / "state").exists()


@pytest.mark.parametrize("records", ["{state}/records.sqlite", "postgresql://me@here/aerocal"])
def test_a_further_runner_has_the_records_of_its_server(tmp_path: Path, records: str) -> None:
    state = tmp_path / "state"
    given = options(tmp_path, state=state)
    with the_only_server(state):
        server = RunningServer(LOCAL.api, os.getpid(), records.format(state=state))
        write_state(state, server)
        assert work_for(None, given)[1].database == server.records
        for database in ("postgresql://me@elsewhere/aerocal", str(tmp_path / "other.sqlite")):
            settings = replace(given, database=database)
            if "://" in records and "://" in database:
                # It may be the same under another name.
                assert work_for(None, settings)[1].database == database
                continue
            with pytest.raises(InputError, match=f"has its records in {server.records}, not in {database}"):
                work_for(None, settings)
