"""What stands in deploy/, carried out: Prefect's worker, the commands of compose, the installed package."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from flows.server.api import Api
from flows.server.door import door_of
from flows.server.server_process import CLIENT_PASSWORD, SERVER_PASSWORD, ServerAddress, server_environment
from tasks.production.records import Records
from tests.deploy.deploy_files import DEPLOY, REPOSITORY, compose, prefect_deployments
from tests.ports import free_port
from tests.postgresql_server import PASSWORD, PostgresqlServer, program
from tests.service.served import environment, started_once, until
from tests.service.stored_block import write_stored_block

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

PATH = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
EVENT = "aerocal.delivery.complete"


@contextmanager
def running(command: list[str], log: Path, **options: Any) -> Iterator[subprocess.Popen[bytes]]:
    """A process and its group, killed afterwards."""
    with log.open("wb") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=stream, start_new_session=True, **options)
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_an_initialised_server_and_a_worker_of_prefect_run_a_delivery_that_an_event_announces(
    tmp_path: Path,
) -> None:
    write_stored_block(tmp_path / "root" / "block", "results")
    # The test of compose starts on an empty database.
    shutil.copytree(started_once(), tmp_path / "home")
    address = ServerAddress("127.0.0.1", free_port("127.0.0.1"))
    base = {**environment(tmp_path), "PATH": PATH, "PREFECT_HOME": str(tmp_path / "home")}
    base["PYTHONPATH"] = str(REPOSITORY)
    door = door_of("ann:words", [address.host], [])
    server = [sys.executable, "-m", "flows.server.prefect_server"]
    ours = {**base, "PREFECT_API_URL": address.api, CLIENT_PASSWORD: door.password}
    confined = {"AEROCAL_ROOTS": f'["{tmp_path / "root"}"]', "AEROCAL_RECORDS": str(tmp_path / "r.sqlite")}
    worker = ["prefect", "worker", "start", "--pool", "aerocal"]
    with running(server, tmp_path / "server.log", env=server_environment(address, None, door, base)):
        for _ in range(2):
            done = subprocess.run(
                [DEPLOY / "init.sh"], env=ours, capture_output=True, text=True, check=False, timeout=300
            )
            assert done.returncode == 0, done.stdout + done.stderr
        api = Api(address.api, door.password)
        names = {one["name"] for one in api.post("/deployments/filter", {})}
        assert names == {"manual", "on-delivery", "nightly", "recalibration-due", "clean-up"}
        assert len(api.post("/deployments/filter", {})) == len(prefect_deployments())
        with running(worker, tmp_path / "worker.log", env={**ours, **confined}, cwd=tmp_path):
            until(lambda: "started!" in (tmp_path / "worker.log").read_text(), 120)
            _announce(api, "block")
            (run,) = until(lambda: Records.at(str(tmp_path / "r.sqlite")).runs(), 120)
            ended = until(lambda: Records.at(str(tmp_path / "r.sqlite")).runs(states=("Completed",)), 120)
    assert (ended[0].id, ended[0].project, ended[0].story) == (run.id, "block", "aerial-triangulation")
    assert (tmp_path / "root" / "block" / "results" / "report.html").is_file()


def _announce(api: Api, project: str) -> None:
    event = {
        "id": str(uuid.uuid4()),
        "occurred": datetime.now(UTC).isoformat(),
        "event": EVENT,
        "resource": {"prefect.resource.id": f"aerocal.delivery.{project}"},
        "payload": {"project": project},
    }
    api.post("/events", [event])


def test_the_commands_of_compose_start_a_server_that_is_well_and_keeps_its_records_in_postgresql(
    tmp_path: Path, postgresql: PostgresqlServer
) -> None:
    services = compose()["services"]
    postgresql.emptied()
    ready = services["postgres"]["healthcheck"]["test"][1:]
    ready = [program("pg_isready"), *ready[1:], "--host", "127.0.0.1", "--port", str(postgresql.port)]
    assert subprocess.run(ready, capture_output=True, check=False).returncode == 0
    port = free_port("127.0.0.1")
    replaced = {
        "--port=4200": f"--port={port}",
        "postgresql://aerocal@postgres/aerocal": f"postgresql://tester@127.0.0.1:{postgresql.port}/postgres",
        "/data": str(tmp_path / "data"),
    }
    for name in ("projects", "inbox"):
        (tmp_path / "data" / name).mkdir(parents=True)
    write_stored_block(tmp_path / "data" / "projects" / "block", "results")
    command = [_with(argument, replaced) for argument in services["server"]["command"]]
    assert command[0] == "serve"
    secrets = {SERVER_PASSWORD: "ann:words", "PREFECT_API_AUTH_STRING": "ann:words", "PGPASSWORD": PASSWORD}
    variables = {**environment(tmp_path), **secrets, "PATH": PATH, "PYTHONPATH": str(REPOSITORY)}
    # The port after a free one need not be free.
    command.append(f"--overview-port={free_port('127.0.0.1')}")
    program_of_ours = [sys.executable, "-m", "flows.command", *command]
    with running(program_of_ours, tmp_path / "printed", env=variables, cwd=tmp_path) as process:
        until(lambda: "Ready." in (tmp_path / "printed").read_text(), 240, process)
        api = Api(ServerAddress("127.0.0.1", port).api, "ann:words")
        assert api.is_well()
        manual = api.get("/deployments/name/aerial-triangulation/manual")["id"]
        run = api.post(f"/deployments/{manual}/create_flow_run", {"parameters": {"project": "block"}})["id"]
        until(lambda: api.get(f"/flow_runs/{run}")["state_name"] == "Completed", 150, process)
        check = services["server"]["healthcheck"]["test"][1:]
        check = [sys.executable, *(_with(part, {":4200/": f":{port}/"}) for part in check[1:])]
        assert subprocess.run(check, check=False).returncode == 0
        others = [f"--port={free_port('127.0.0.1')}", f"--overview-port={free_port('127.0.0.1')}"]
        again = [*program_of_ours, *others, "--state", str(tmp_path / "another")]
        refused = subprocess.run(
            again, env=variables, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert refused.returncode == 1
        assert "Another server uses the database" in refused.stderr
        replaced["http://server:4200"] = f"http://127.0.0.1:{port}"
        command = [_with(argument, replaced) for argument in services["runner"]["command"]]
        assert command[0] == "runner"
        second = [sys.executable, "-m", "flows.command", *command, "--state", str(tmp_path / "runner_state")]
        with running(second, tmp_path / "printed-runner", env=variables, cwd=tmp_path) as runner:
            until(lambda: "Ready." in (tmp_path / "printed-runner").read_text(), 240, runner)
            runner.send_signal(signal.SIGTERM)
            assert runner.wait(120) == 0
        process.send_signal(signal.SIGTERM)
        assert process.wait(120) == 0
    assert not (tmp_path / "state" / "prefect" / "prefect.db").exists()
    for name in ("printed", "printed-runner"):
        assert PASSWORD not in (tmp_path / name).read_text()


def _with(text: str, replaced: Mapping[str, str]) -> str:
    for old, new in replaced.items():
        text = text.replace(old, new)
    return text


def test_systemd_understands_the_unit(tmp_path: Path) -> None:
    unit = tmp_path / "aerocal.service"
    text = (DEPLOY / "systemd" / "aerocal.service").read_text()
    # Only a program that exists is verified.
    unit.write_text(text.replace("/opt/aerocal/bin/aerocal", str(Path(sys.executable).resolve())))
    verified = ["systemd-analyze", "verify", "--recursive-errors=no", str(unit)]
    done = subprocess.run(verified, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.strip()) == (0, "")
    unit.write_text(unit.read_text().replace("KillMode=mixed", "KillMode=gently"))
    assert "kill mode" in subprocess.run(verified, capture_output=True, text=True, check=False).stderr


def test_the_installed_package_is_complete(tmp_path: Path) -> None:
    """As the image installs it: no file of the source tree is in reach, only the package's own."""
    source, target = tmp_path / "source", tmp_path / "installed"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, source)
    for name in ("flows", "tasks", "adjust"):
        shutil.copytree(REPOSITORY / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    subprocess.run([*install, "--no-build-isolation", "--target", target, source], check=True)
    variables = {**environment(tmp_path), "PYTHONPATH": str(target)}
    begin = [sys.executable, "-P", "-m", "flows.command"]
    block = tmp_path / "block"
    for arguments in (["simulate", "uce-low", "--out", str(block)], ["run", str(block / "project.toml")]):
        done = subprocess.run(
            [*begin, *arguments], env=variables, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    where = "import flows, tasks; print(flows.__file__, tasks.__file__)"
    shown = subprocess.run(
        [sys.executable, "-P", "-c", where],
        env=variables,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert shown.stdout.split() == [str(target / "flows/__init__.py"), str(target / "tasks/__init__.py")]
    assert (block / "results" / "report.html").is_file()
