"""The stories as Prefect flows: same bytes, and states that say what happened."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from flows.runs.project_run import RunOutcome, RunRequest, StoryName, story_named
from tests.command_line import aerocal
from tests.conftest import Start
from tests.waiting import until

if TYPE_CHECKING:
    from prefect.client.schemas.objects import FlowRun

pytestmark = [pytest.mark.prefect, pytest.mark.usefixtures("prefect_server")]


def reported(request: RunRequest, name: StoryName = "aerial_triangulation") -> RunOutcome:
    from flows.serving.registered import run_and_report

    return run_and_report(request, name, lambda: story_named(name))


def latest_run(story: str) -> FlowRun:
    """The latest run of a story, as the server knows it."""
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowFilter, FlowFilterName
    from prefect.client.schemas.sorting import FlowRunSort

    own = FlowFilter(name=FlowFilterName(any_=[story]))
    with get_client(sync_client=True) as client:
        (run,) = client.read_flow_runs(flow_filter=own, sort=FlowRunSort.START_TIME_DESC, limit=1)
    return run


def as_flow(
    project_file: Path, out: Path, *overrides: str, name: StoryName = "aerial_triangulation"
) -> tuple[FlowRun, str, str, str]:
    """A run that is reported to the server: as it is there, with type, name and message of its state."""
    reported(RunRequest(project_file, out, overrides), name)
    run = latest_run(name.replace("_", "-"))
    assert run.state is not None
    return run, run.state.type.value, str(run.state.name), str(run.state.message)


def results_of(block: Path) -> Path:
    return block.parent / "results"


def digests(out: Path) -> dict[str, str]:
    artifacts = json.loads((out / "manifest.json").read_text())["artifacts"]
    return {entry["file"]: entry["sha256"] for entry in artifacts.values()}


def test_under_prefect_and_in_process_give_the_same_bytes_and_prefect_keeps_none(
    block: Path, run_before: Path, tmp_path: Path
) -> None:
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import FlowRunFilter, FlowRunFilterId, TaskRunFilter

    plain, flow = run_before / "results", tmp_path / "flow"
    run, kind, name, _message = as_flow(block, flow)
    assert (kind, name, run.name) == ("COMPLETED", "Completed", "block/project.toml")
    assert run.parameters["project_file"] == str(block)
    assert len(digests(plain)) >= 10
    assert digests(flow) == digests(plain)
    for file in digests(flow):
        assert (flow / file).read_bytes() == (plain / file).read_bytes()
    storage = Path(os.environ["PREFECT_HOME"]) / "storage"
    assert not storage.exists() or not any(storage.iterdir())
    own = FlowRunFilter(id=FlowRunFilterId(any_=[run.id]))

    def stages() -> set[str]:
        with get_client(sync_client=True) as client:
            runs = client.read_task_runs(flow_run_filter=own, task_run_filter=TaskRunFilter())
        return {run.name.rsplit("-", 1)[0] for run in runs}

    # The server records tasks in its own time, also after the end of the flow.
    expected = {
        "approximate_values",
        "bundle_adjustment",
        "import_control",
        "import_exposures",
        "import_image_points",
        "publish",
        "remarks",
        "report",
    }
    until(lambda: stages() == expected, 60.0)


def test_a_wrong_setting_is_the_name_of_the_state(warm_block: Path) -> None:
    _run, kind, found, message = as_flow(warm_block, results_of(warm_block), "gates.sigma1.max=0.71")
    assert (kind, found) == ("FAILED", "InputError")
    assert "Did you mean 'sigma0'?" in message


def test_a_failed_gate_is_the_state_and_the_verdict_and_a_verdict_that_cannot_be_stored_stops_nothing(
    warm_block: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import ArtifactFilter, ArtifactFilterFlowRunId

    from flows.serving.registered import show
    from tasks.production.run_record import RunRecord

    run, kind, name, message = as_flow(warm_block, results_of(warm_block), "gates.sigma0.max=0.71")
    assert (kind, name) == ("FAILED", "GateFailed")
    assert "sigma0" in message
    with get_client(sync_client=True) as client:
        own = ArtifactFilter(flow_run_id=ArtifactFilterFlowRunId(any_=[run.id]))
        stored = client.read_artifacts(artifact_filter=own)
    (verdict,) = (one for one in stored if str(one.key).endswith("-aerial-triangulation-verdict"))
    assert verdict.type == "markdown"
    assert str(verdict.data).startswith("**GateFailed: Gates not passed: sigma0.**")

    @flow(name="refused")
    def refused() -> str:
        show(RunRecord.of("1", Path("project.toml"), "No Such Key", "Failed"))
        return "done"

    log = logging.getLogger("aerocal")
    # Prefect's own handlers write to the streams of the time when they were made.
    log.addHandler(caplog.handler)
    try:
        assert refused() == "done"
    finally:
        log.removeHandler(caplog.handler)
    assert "was not stored" in caplog.text


def test_a_direct_georeferencing_check_is_a_flow_of_its_own(warm_block: Path) -> None:
    overrides, out = ["direct_georeferencing.calibration=adjustment"], results_of(warm_block)
    check: StoryName = "direct_georeferencing_check"
    assert as_flow(warm_block, out, *overrides, name=check)[2] == "Completed"
    assert (out / "georeferencing_check.html").is_file()
    gates = [*overrides, "gates.y_parallax_max_um.max=0.01"]
    _run, _kind, name, message = as_flow(warm_block, out, *gates, name=check)
    assert (name, "y_parallax_max_um" in message) == ("GateFailed", True)


def test_the_outcome_reported_to_a_server_is_the_one_of_the_run(warm_block: Path) -> None:
    done = reported(RunRequest(warm_block))
    assert done.error is None
    assert done.summary.status == "done"
    refused = reported(RunRequest(warm_block, overrides=("inputs.exposures.crs=EPSG:0",)))
    assert refused.summary.status == "input_error"
    assert refused.error is not None


def server_address() -> str:
    from prefect.settings import PREFECT_API_URL

    return str(PREFECT_API_URL.value())


def test_the_command_line_reports_to_a_server(warm_block: Path, start: Start) -> None:
    command = (sys.executable, "-m", "flows.command", "run", warm_block, "--server", server_address())
    options = ("--set", "gates.sigma0.max=0.71", "--json")
    process = start(*command, *options, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    shown, log = process.communicate(timeout=200)
    assert process.returncode == 4, log
    assert json.loads(shown)["status"] == "gate_failed"
    assert "Finished in state GateFailed('Gates not passed: sigma0" in log


def test_wrong_input_is_one_line_under_a_server_too(
    warm_block: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with (warm_block.parent / "image_points.csv").open("a") as stream:
        stream.write("1_0011,p1,10,10\n")
    # Prefect's loggers hand nothing on.
    for logger in ("prefect", "prefect.flow_runs", "prefect.task_runs"):
        monkeypatch.setattr(logging.getLogger(logger), "handlers", [caplog.handler])
    done = aerocal("run", warm_block, "--server", server_address())
    assert done.returncode == 2
    assert "Finished in state InputError" in caplog.text
    assert "Traceback" not in done.stderr + caplog.text
    assert [line for line in done.stderr.splitlines() if line.startswith("Error: ") and "1_0011" in line]
