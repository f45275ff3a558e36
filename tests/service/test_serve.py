"""``aerocal serve`` for real: form, deliveries, schedules, runs by hand."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from datetime import date
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.server.door import basic
from flows.server.state_file import find_server
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.files.installation import InstallationError
from tasks.production.run_record import RunRecord
from tasks.registry.registry import Registry
from tasks.settings.registry import registry_address
from tasks.store.run_lock import run_lock
from tests.flows.conftest import write_block
from tests.ports import free_port
from tests.service.served import Served, engines_of, served, until
from tests.service.stored_block import store_stages, write_stored_block
from tests.tasks.registry.records import add, approve, record

pytestmark = [pytest.mark.service, pytest.mark.timeout(600)]

MANUAL = "aerial-triangulation/manual"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("serve")
    write_stored_block(folder / "root" / "block", "strict", "cleaned")
    store_stages(folder / "hand")
    calibrations = folder / "root" / "registry.sqlite"
    registry = Registry.at(registry_address(str(calibrations)))
    add(registry, record())
    approve(registry, 1, date(2024, 6, 1))
    schedule = ("--cron", "30 1 * * *", "--timezone", "Europe/Berlin")
    keep = ("--registry", str(calibrations), "--keep-days", "60", "--history-days", "100")
    # Old runs are looked for every hour otherwise.
    often = {"PREFECT_SERVER_SERVICES_DB_VACUUM_LOOP_SECONDS": "5"}
    with served(folder, *schedule, *keep, **often) as running:
        yield running


def test_the_form_refuses_a_wrong_value_before_there_is_a_run(server: Served) -> None:
    before = len(server.runs(flows={"name": {"any_": ["aerial-triangulation"]}}))
    with pytest.raises(InstallationError, match="'nonsense' is not one of"):
        server.start(MANUAL, {"project": "block", "settings": {"datum": "nonsense"}})
    with pytest.raises(InstallationError, match="'output'"):
        server.start(MANUAL, {"project": "block", "output": "../out"})
    assert len(server.runs(flows={"name": {"any_": ["aerial-triangulation"]}})) == before


def test_every_parameter_of_the_form_is_described(server: Served) -> None:
    for story in ("aerial-triangulation", "system-calibration", "direct-georeferencing-check"):
        schema = server.api.get(f"/deployments/name/{story}/manual")["parameter_openapi_schema"]
        fields = schema["properties"] | schema["definitions"]["RunForm"]["properties"]
        assert len(fields) == 13
        for name, field in fields.items():
            assert field.get("description"), name
            assert "default" in field or name == "project"


def test_a_run_ends_in_the_state_that_says_what_happened(server: Served) -> None:
    done = server.start(MANUAL, {"project": "block"})
    missed = server.start(
        MANUAL, {"project": "block", "settings": {"sigma0_limit": 0.71}, "output": "strict"}
    )
    outside = server.start(MANUAL, {"project": "../state/serve.json"})
    states = {name: server.ended(run) for name, run in (("d", done), ("m", missed), ("o", outside))}
    assert [states[key]["state_name"] for key in "dmo"] == ["Completed", "GateFailed", "InputError"]
    # The name is completed after the state.
    until(lambda: server.run(missed)["name"] == "block · aerial-triangulation · GateFailed", 20)
    assert "sigma0" in states["m"]["state"]["message"]
    assert str(server.folder / "root") in states["o"]["state"]["message"]
    results = server.folder / "root" / "block"
    assert json.loads((results / "results" / "summary.json").read_text())["status"] == "done"
    assert json.loads((results / "strict" / "summary.json").read_text())["status"] == "gate_failed"
    assert states["m"]["run_count"] == 1, "a failed gate is not tried again"
    recorded = {run.id: run for run in server.records.runs()}
    assert [recorded[run].state for run in (done, missed, outside)] == [
        "Completed",
        "GateFailed",
        "InputError",
    ]
    assert recorded[done].project == "block"
    assert {stage.stage for stage in recorded[done].stages} > {"import_exposures", "bundle_adjustment"}
    assert not all(gate.passed for gate in recorded[missed].figures.gates)


def test_runner_and_page_load_nothing_that_computes(server: Served) -> None:
    """Nor does a run that finds everything stored: it loads the same flows as the runner, and its story."""
    for process in (server.process.pid, server.group_of("flows.serving.deployments")):
        loaded = Path(f"/proc/{process}/maps").read_text()
        assert "/pydantic_core/" in loaded
        assert not [name for name in ("numba", "pandas", "scipy") if f"/{name}/" in loaded]


def test_a_run_by_hand_appears_in_the_dashboard(server: Served) -> None:
    block = server.folder / "root" / "block" / "project.toml"
    command = [sys.executable, "-m", "flows.command", "run", str(block), "--out", str(server.folder / "hand")]
    done = subprocess.run(command, env=server.environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    named = server.runs(flow_runs={"name": {"any_": ["block/project.toml"]}})
    assert [run["state_name"] for run in named] == ["Completed"]
    assert named[0]["deployment_id"] is None
    done = subprocess.run(
        [*command, "--server", "none"], env=server.environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(server.runs(flow_runs={"name": {"any_": ["block/project.toml"]}})) == 1
    recorded = server.records.run(named[0]["id"])
    assert recorded is not None
    assert (recorded.state, recorded.directory) == ("Completed", str(server.folder / "hand"))


def test_a_delivery_is_begun_when_it_is_complete_and_only_once(server: Served) -> None:
    def runs() -> list[object]:
        return server.runs(flow_runs={"tags": {"all_": ["delivery"]}})

    write_block(server.folder / "inbox" / "block-7")
    nightly = server.ended(server.start("inbox/nightly", {}))
    assert "Not complete yet: block-7." in nightly["state"]["message"]
    assert runs() == []
    (server.folder / "inbox" / "block-7" / "DELIVERED").touch()
    until(runs, 60)
    nightly = server.ended(server.start("inbox/nightly", {}))
    assert "Deliveries with a run already: 1." in nightly["state"]["message"]
    (run,) = runs()
    assert server.ended(run["id"])["state_name"] == "Completed"  # type: ignore[index]
    assert (server.folder / "inbox" / "block-7" / "results" / "report.html").is_file()
    # The same bytes again: another run, which computes nothing.
    os.utime(server.folder / "inbox" / "block-7" / "DELIVERED", (1, 1))
    again = until(lambda: next((one for one in runs() if one["id"] != run["id"]), None), 60)  # type: ignore[index]
    assert server.ended(again["id"])["state_name"] == "Completed"  # type: ignore[index]
    store = server.folder / "inbox" / "block-7" / "results" / ".store"
    assert len(list((store / "bundle_adjustment").iterdir())) == 1


def test_a_second_server_does_not_take_deliveries_from_the_same_inbox(server: Served, tmp_path: Path) -> None:
    inbox, state, port = str(server.folder / "inbox"), str(tmp_path / "state"), free_port("127.0.0.1")
    words = ("serve", "--root", inbox, "--inbox", inbox, "--state", state, "--port", str(port))
    second = subprocess.run(
        [sys.executable, "-m", "flows.command", *words], capture_output=True, text=True, check=False
    )
    assert second.returncode == 1
    assert f"Another server takes its deliveries from the inbox {inbox}" in " ".join(second.stderr.split())


def test_a_cancelled_run_ends_with_its_process(server: Served) -> None:
    runner = server.group_of("flows.serving.deployments")
    with run_lock(server.folder / "root" / "block" / "cancelled"):
        run = server.start(MANUAL, {"project": "block", "output": "cancelled"})
        server.in_state(run, "RUNNING")
        assert engines_of(runner)
        state = {"type": "CANCELLING", "name": "Cancelling"}
        server.api.post(f"/flow_runs/{run}/set_state", {"state": state})
        assert server.ended(run)["state_name"] == "Cancelled"
        until(lambda: not engines_of(runner), 30)
        # The run could not note it any more; the server's watch does.
        until(lambda: (found := server.records.run(run)) is not None and found.state == "Cancelled", 30)


def test_a_suspended_run_lets_its_process_go_and_goes_on_when_it_is_resumed(server: Served) -> None:
    def recorded() -> RunRecord | None:
        return server.records.run(run)

    with run_lock(server.folder / "root" / "block" / "suspended"):
        run = server.start(MANUAL, {"project": "block", "output": "suspended"})
        server.in_state(run, "RUNNING")
        until(lambda: (found := recorded()) is not None and found.state == "Running", 60)
        details = {"pause_reschedule": True, "pause_timeout": "2100-01-01T00:00:00Z"}
        state = {"type": "PAUSED", "name": "Suspended", "state_details": details}
        server.api.post(f"/flow_runs/{run}/set_state", {"state": state})
    until(lambda: (found := recorded()) is not None and found.message.startswith("Suspended"), 90)
    assert server.run(run)["state_name"] == "Suspended"
    assert not (server.folder / "root" / "block" / "suspended" / "manifest.json").exists()
    server.api.post(f"/flow_runs/{run}/resume", {})
    assert server.ended(run)["state_name"] == "Completed"
    found = recorded()
    assert found is not None
    assert found.state == "Completed"


def test_no_more_runs_than_the_limit_at_a_time_and_one_project_is_computed_once(server: Served) -> None:
    with run_lock(server.folder / "root" / "block" / "twice"):
        runs = [server.start(MANUAL, {"project": "block", "output": "twice"}) for _ in range(2)]
        until(lambda: "RUNNING" in {server.run(run)["state_type"] for run in runs}, 60)
        with pytest.raises(AssertionError, match="not within"):
            until(lambda: {server.run(run)["state_type"] for run in runs} == {"RUNNING"}, 8)
    assert [server.ended(run)["state_name"] for run in runs] == ["Completed", "Completed"]
    store = server.folder / "root" / "block" / "twice" / ".store"
    assert len(list((store / "bundle_adjustment").iterdir())) == 1


def test_the_schedule_has_runs_in_its_time_zone(server: Served) -> None:
    scheduled = until(
        lambda: server.runs(
            flows={"name": {"any_": ["inbox"]}}, flow_runs={"state": {"type": {"any_": ["SCHEDULED"]}}}
        ),
        60,
    )
    # 1:30 in Berlin is 0:30 (winter) or 23:30 (summer).
    assert {run["expected_start_time"][11:16] for run in scheduled} <= {"00:30", "23:30"}


def test_calibrations_that_are_due_end_in_a_state_of_that_name(server: Served) -> None:
    deployment = "recalibration-due/recalibration-due"
    found = server.api.get(f"/deployments/name/{deployment}")
    fields = found["parameter_openapi_schema"]["properties"]
    assert [name for name, field in fields.items() if not field.get("description")] == []
    assert (fields["within_days"]["default"], fields["max_age_days"]["default"]) == (30, 730)
    (schedule,) = found["schedules"]
    assert (schedule["schedule"]["cron"], schedule["schedule"]["timezone"]) == ("0 6 * * 1", "Europe/Berlin")
    runs = {
        "due": server.start(deployment, {"max_age_days": 1}),
        "not due": server.start(deployment, {"max_age_days": 0}),
        "unknown": server.start(deployment, {"without": ["UCX"]}),
    }
    ended = {name: server.ended(run) for name, run in runs.items()}
    assert {name: run["state_name"] for name, run in ended.items()} == {
        "due": "RecalibrationDue", "not due": "Completed", "unknown": "InputError",
    }  # fmt: skip
    assert "UCE (body UC-E-1), virtual image: Calibration 1 is" in ended["due"]["state"]["message"]
    assert ended["not due"]["state"]["message"] == "No calibration is due: 1 camera checked."
    assert "Did you mean 'UCE'" in ended["unknown"]["state"]["message"]
    until(
        lambda: server.run(runs["due"])["name"] == "registry · recalibration-due · RecalibrationDue",
        20,
    )
    assert ended["due"]["run_count"] == 1
    with pytest.raises(InstallationError, match="max_age_days"):
        server.start(deployment, {"max_age_days": -1})


def test_a_clean_up_removes_what_nobody_has_used_and_leaves_what_is_published(server: Served) -> None:
    deployment = "clean-up/clean-up"
    found = server.api.get(f"/deployments/name/{deployment}")
    assert found["parameters"] == {"keep_days": 60}
    (schedule,) = found["schedules"]
    assert (schedule["schedule"]["cron"], schedule["schedule"]["timezone"]) == ("0 3 * * *", "Europe/Berlin")
    fields = found["parameter_openapi_schema"]["properties"]
    assert [name for name, field in fields.items() if not field.get("description")] == []
    results = server.folder / "root" / "block" / "cleaned"
    # The second is the default, whose stages are stored.
    for critical in (3.5, 4.13):
        changes = (f"adjustment.rejection.critical_value={critical}",)
        request = RunRequest(server.folder / "root" / "block" / "project.toml", results, changes)
        assert carry_out(aerial_triangulation, request).error is None
    lists = list(results.glob(".store/*/*/stage.json"))
    for file in lists:
        os.utime(file, (1e9, 1e9))
    published = {file.name: file.read_bytes() for file in results.iterdir() if file.is_file()}
    looked = server.ended(server.start(deployment, {"keep_days": 60, "act": "look"}))
    assert looked["state_name"] == "Completed"
    assert len(list(results.glob(".store/*/*/stage.json"))) == len(lists)
    done = server.ended(server.start(deployment, {"keep_days": 60}))
    assert done["state_name"] == "Completed"
    assert done["state"]["message"] == looked["state"]["message"].replace("Would remove", "Removed")
    assert len(list(results.glob(".store/bundle_adjustment/*"))) == 1
    assert {file.name: file.read_bytes() for file in results.iterdir() if file.is_file()} == published


def test_the_server_forgets_what_has_ended_long_ago_and_nothing_else(server: Served) -> None:
    vacuum = server.api.get("/admin/settings")["server"]["services"]["db_vacuum"]
    assert set(vacuum["enabled"]) == {"events", "flow_runs"}
    assert vacuum["retention_period"] in (100 * 86_400, "P100D")
    flow = server.api.get("/deployments/name/inbox/nightly")["flow_id"]
    done = {"flow_id": flow, "state": {"type": "COMPLETED", "name": "Completed"}}
    old, new = (str(server.api.post("/flow_runs/", done)["id"]) for _ in range(2))
    assert server.run(old)["end_time"] is not None
    database = server.folder / "state" / "prefect" / "prefect.db"
    with closing(sqlite3.connect(database, timeout=30)) as connection, connection:
        changed = connection.execute(
            "UPDATE flow_run SET end_time = '2020-01-01 00:00:00.000000' WHERE id = ?", [old]
        )
        assert changed.rowcount == 1
    until(lambda: server.run(old) is None, 60)
    assert server.run(new)["state_name"] == "Completed"


def test_the_server_is_private(server: Served) -> None:
    found = find_server(server.folder / "state")
    assert found is not None
    assert (found.alive, found.url) == (True, server.api.url)
    listening = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    addresses = {line[1].split(":")[0] for line in listening if int(line[1].split(":")[1], 16) == server.port}
    assert addresses == {"0100007F"}


def test_pages_of_the_dashboard_speak_to_their_own_server_only(server: Served) -> None:
    for page in ("/", "/v2/", "/v2/dashboard"):
        address = f"http://127.0.0.1:{server.port}{page}"
        asked_for = {"Accept": "text/html", "Authorization": basic(server.password)}
        with urllib.request.urlopen(urllib.request.Request(address, headers=asked_for), timeout=30) as answer:
            policy = answer.headers["Content-Security-Policy"]
        assert policy.startswith("connect-src 'self';"), page
