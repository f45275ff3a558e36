"""Object storage that is gone, slow, refuses, or is not trusted; the server is real."""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest, carry_out
from tasks.files.installation import InstallationError
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.fetch import fetch_results
from tasks.object_storage.workspace import ObjectWorkspace
from tasks.settings.project import Project
from tests.service.object_server import (
    BUCKET,
    ObjectServer,
    on_put,
    own_certificate,
    running_object_server,
)
from tests.service.stages_on_storage import (
    run,
    value_of,
)

pytestmark = [pytest.mark.service, pytest.mark.usefixtures("server")]


def test_an_outage_with_a_closed_port_is_outlasted_and_told(
    server: ObjectServer,
    address: ObjectAddress,
    project: Project,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO, "aerocal")
    timers: list[threading.Timer] = []
    close = on_put("/notes.json", lambda: timers.append(server.gate.closed_for(2.5)))
    server.gate.afterwards = lambda method, path: threading.Thread(target=close, args=(method, path)).start()
    run(tmp_path / "one", address, project)
    timers[0].join()
    assert any("does not answer (could not connect" in message for message in caplog.messages)
    assert any("answers again" in message for message in caplog.messages)
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 1.0


def test_an_outage_with_a_server_that_is_stopped_is_outlasted(
    server: ObjectServer,
    address: ObjectAddress,
    project: Project,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO, "aerocal")
    run(tmp_path / "one", address, project)
    with server.stopped():
        later = threading.Thread(target=run, args=(tmp_path / "one", address, project, 2.0))
        later.start()
        time.sleep(2.0)
        assert later.is_alive()
    later.join()
    assert any("does not answer (timeout was reached" in message for message in caplog.messages)
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 2.0


@pytest.mark.parametrize("status", [500, 503])
def test_server_errors_are_outlasted(
    server: ObjectServer, address: ObjectAddress, project: Project, tmp_path: Path, status: int
) -> None:
    failing = {"PUT", "GET", "HEAD"}

    def first_fails(method: str, _path: str) -> int | None:
        if method in failing:
            failing.remove(method)
            return status
        return None

    server.gate.rule = first_fails
    run(tmp_path / "one", address, project)
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 1.0
    assert not failing


def test_an_answer_that_takes_longer_than_the_timeout_is_asked_for_again(
    server: ObjectServer,
    address: ObjectAddress,
    project: Project,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    slow = [3.0]

    def wait(method: str, path: str) -> None:
        if method == "GET" and "stage.json" in path and slow:
            time.sleep(slow.pop())

    run(tmp_path / "one", address, project)
    server.gate.afterwards = wait
    assert run(tmp_path / "two", address, project) == []
    assert any("timeout was reached" in message for message in caplog.messages)


def test_an_outage_beyond_the_limit_ends_the_run_and_the_next_one_goes_on(
    server: ObjectServer,
    address: ObjectAddress,
    project: Project,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run(tmp_path / "one", address, project)
    monkeypatch.setenv("AEROCAL_S3_PATIENCE", "1.5")
    server.gate.rule = lambda method, path: (
        503 if method == "PUT" and path.endswith("residuals.parquet") else None
    )
    with pytest.raises(
        InstallationError, match=r"has not answered for 2 s \(slow down|HTTP status 503\)"
    ) as ended:
        run(tmp_path / "one", address, project, 2.0)
    assert "Run again" in ended.value.remedy
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == value_of(tmp_path / "one") == 1.0
    server.gate.reset()
    assert run(tmp_path / "one", address, project, 2.0) == ["make_notes"]
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 2.0


def test_a_storage_that_has_lost_everything_gets_it_all_again(
    address: ObjectAddress,
    project: Project,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run(tmp_path / "one", address, project)
    with running_object_server(tmp_path) as other:
        other.make_bucket(BUCKET)
        monkeypatch.setenv("AWS_ENDPOINT_URL", other.gate.url)
        assert run(tmp_path / "one", address, project) == []
        fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 1.0


def test_without_bucket_credentials_or_server_nothing_begins(
    address: ObjectAddress, project: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AEROCAL_S3_PATIENCE", "0")
    with pytest.raises(InstallationError, match="no bucket 'no-such-bucket'"):
        run(tmp_path / "one", ObjectAddress("no-such-bucket", "block"), project)
    with monkeypatch.context() as changed:
        changed.setenv("AWS_SECRET_ACCESS_KEY", "")
        with pytest.raises(InstallationError, match="no credentials"):
            run(tmp_path / "one", address, project)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    with pytest.raises(InstallationError, match="could not connect"):
        run(tmp_path / "one", address, project)
    assert not (tmp_path / "one").exists()


def test_a_server_with_a_certificate_of_its_own_is_trusted_only_when_told(
    address: ObjectAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    certificate = own_certificate(tmp_path)
    with running_object_server(tmp_path, certificate) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"https://127.0.0.1:{server.port}")
        server.make_bucket(BUCKET)
        storage = ObjectWorkspace.at(address).storage
        with pytest.raises(InstallationError, match="its certificate is not trusted") as refused:
            storage.require_access()
        assert "AWS_CA_BUNDLE" in refused.value.remedy
        monkeypatch.setenv("AWS_CA_BUNDLE", str(certificate))
        storage.put("x", b"content")
        assert storage.read("x", 100) == b"content"


def test_wrong_input_stays_wrong_input_where_it_cannot_be_told(
    server: ObjectServer, address: ObjectAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AEROCAL_S3_PATIENCE", "0")
    server.gate.rule = lambda _method, _path: 503
    (tmp_path / "project.toml").write_text("version = 2\n")
    request = RunRequest.of(tmp_path / "project.toml", str(address), (), None)
    outcome = carry_out(lambda _project, _store: None, request)  # type: ignore
    assert outcome.summary.status == "input_error"
