"""What a run shows in the dashboard: verdict first, traffic lights with words, and never more than fits."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from flows.aerial_triangulation import aerial_triangulation
from flows.direct_georeferencing_check import direct_georeferencing_check
from flows.project_run import RunOutcome, RunRequest, carry_out
from flows.recorded_run import FlowRunIdentity
from flows.run_artifacts import (
    artifacts_beside_records,
    artifacts_of_outcome,
    artifacts_of_refusal,
)
from tasks.dashboard.artifacts import DashboardArtifact
from tasks.production.variable import OVERVIEW_VARIABLE, RECORDS_VARIABLE
from tasks.quality_gates import GateResult
from tests.flows.conftest import write_block

ALL_CHECK = ",check"
IDENTITY = FlowRunIdentity("1234", "aerial-triangulation")


@pytest.fixture(scope="module")
def request_of_block(tmp_path_factory: pytest.TempPathFactory) -> RunRequest:
    """A block whose surveyed points are all check points, some with names that mean something elsewhere."""
    folder = tmp_path_factory.mktemp("artifacts") / "Block 7"
    write_block(folder)
    control = folder / "control.csv"
    control.write_text(control.read_text().replace(",control", ALL_CHECK))
    first = control.read_text().splitlines()[1].split(",")[0]
    for file in (control, folder / "image_points.csv"):
        file.write_text(re.sub(rf"\b{first}\b", "<script>alert(1)</script>", file.read_text()))
    return RunRequest(folder / "project.toml", overrides=("gates.max_check_m.max=[9.0, 9.0, 0.001]",))


@pytest.fixture(scope="module")
def outcome(request_of_block: RunRequest) -> RunOutcome:
    return carry_out(aerial_triangulation, request_of_block)


@pytest.fixture(autouse=True)
def served(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(OVERVIEW_VARIABLE, "http://127.0.0.1:8051/")
    monkeypatch.setenv(RECORDS_VARIABLE, "records.sqlite")


def by_name(artifacts: tuple[DashboardArtifact, ...]) -> Mapping[str, DashboardArtifact]:
    return {one.key.rpartition("triangulation-")[2] or one.key: one for one in artifacts}


def test_the_verdict_stands_in_the_first_line(outcome: RunOutcome, request_of_block: RunRequest) -> None:
    verdict = by_name(artifacts_of_outcome(outcome, request_of_block, IDENTITY))["verdict"].data
    assert re.match(
        r"\*\*🔴 GateFailed: 1 of 5 limits not kept: "
        r"largest difference at check points, z 0\.\d{3} m \(limit ≤ 0\.001 m\)\.\*\*\n",
        verdict,
    )
    assert "| σ0 | 0." in verdict
    assert "| 🟢 kept |" in verdict
    assert "| 🔴 not kept |" in verdict
    assert "the stated σ allow" in verdict
    assert "| RMS at check points, east, north, up |" in verdict
    assert "[Report](<http://127.0.0.1:8051/results/1234/report.html>)" in verdict
    assert f"`{outcome.directory}`" in verdict
    assert verdict.index("### What to do") < verdict.index("### σ0") < verdict.index("### Figures")


def test_the_gravest_and_biggest_check_points_come_first(
    outcome: RunOutcome, request_of_block: RunRequest
) -> None:
    table = by_name(artifacts_of_outcome(outcome, request_of_block, IDENTITY))["check-points"]
    rows = json.loads(table.data)
    assert table.type == "table"
    assert [row["verdict"] for row in rows] == ["🔴 beyond the limit in up"] * 5
    assert "<\u2060script>alert(1)<\u2060/script>" in [row["point"] for row in rows]
    ratios = [
        max(
            abs(float(size)) / float(sigma)
            for axis in ("east", "north", "up")
            for size, sigma in re.findall(
                r"([+-]?[\d.]+) \(σ ([\d.]+)\)", row[f"{axis} [m]"].replace("−", "-")
            )
        )
        for row in rows
    ]
    assert ratios == pytest.approx(sorted(ratios, reverse=True), rel=0.05)
    kept = replace(outcome, summary=outcome.summary.model_copy(update={"gates": ()}))
    table = by_name(artifacts_of_outcome(kept, request_of_block, IDENTITY))["check-points"]
    lights = {row["verdict"] for row in json.loads(table.data)}
    assert lights <= {"🟢 within 3 σ", "🟡 more than 3 σ in up"}


def test_map_and_report_are_links_to_what_is_served(
    outcome: RunOutcome, request_of_block: RunRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = by_name(artifacts_of_outcome(outcome, request_of_block, IDENTITY))
    assert (made["map"].type, made["map"].data) == (
        "image",
        "http://127.0.0.1:8051/results/1234/map.svg",
    )
    assert made["report"].data == "[Report](<http://127.0.0.1:8051/results/1234/report.html>)"
    drawing = (outcome.directory / "map.svg").read_text()
    assert drawing.count("<svg ") == 1
    assert "<script" not in drawing
    assert "&lt;script&gt;" in drawing
    monkeypatch.delenv(OVERVIEW_VARIABLE)
    alone = by_name(artifacts_of_outcome(outcome, request_of_block, IDENTITY))
    assert sorted(alone) == ["check-points", "verdict"]
    assert "report.html" in alone["verdict"].data
    beside = by_name(artifacts_beside_records(outcome, request_of_block, IDENTITY))
    assert sorted(beside) == ["check-points", "verdict"]


def test_keys_are_those_of_project_and_story(outcome: RunOutcome, request_of_block: RunRequest) -> None:
    def keys(request: RunRequest, run: str) -> list[str]:
        identity = FlowRunIdentity(run, "aerial-triangulation")
        return [one.key for one in artifacts_of_outcome(outcome, request, identity)]

    first = keys(request_of_block, "1")
    assert all(re.fullmatch(r"block-7-[0-9a-f]{8}-aerial-triangulation-[a-z-]+", key) for key in first)
    assert keys(request_of_block, "2") == first
    elsewhere = RunRequest(Path("/elsewhere/Block 7/project.toml"))
    assert not set(keys(elsewhere, "1")) & set(first)
    (refused,) = artifacts_of_refusal("../ÄÖ*", "InputError", "no", IDENTITY)
    assert re.fullmatch(r"[a-z0-9-]+", refused.key)


def test_what_is_wrong_with_an_input_stands_there_with_what_to_do(request_of_block: RunRequest) -> None:
    request = replace(request_of_block, overrides=("inputs.exposures.crs=EPSG:0",))
    (verdict,) = artifacts_of_outcome(carry_out(aerial_triangulation, request), request, IDENTITY)
    first, *rest = verdict.data.splitlines()
    assert first.startswith("**🔴 InputError: ")
    assert "EPSG:0" in first
    assert "### What to do" in rest
    assert "Correct what the message names" in verdict.data
    assert "There is no new result" in verdict.data
    assert "<script>" not in artifacts_of_refusal("a", "Failed", "<script>", IDENTITY)[0].data


def test_many_problems_and_gates_stay_small(outcome: RunOutcome, request_of_block: RunRequest) -> None:
    problems = tuple(f"Problem {number} " + "x" * 3000 for number in range(2000))
    gate = GateResult(name="rmse_check_m_x", value=None, limit=1.0, unit="m", passed=False)
    many = outcome.summary.model_copy(update={"problems": problems, "gates": (gate,)})
    made = artifacts_of_outcome(replace(outcome, summary=many), request_of_block, IDENTITY)
    verdict = by_name(made)["verdict"].data
    assert len(verdict) < 200_000
    assert "1960 more in summary.json" in verdict
    assert "the only limit is not kept: RMS at check points, x (no such figure)" in verdict.splitlines()[0]


def test_estimates_that_contradict_the_truth_are_no_success(
    outcome: RunOutcome, request_of_block: RunRequest
) -> None:
    made = artifacts_beside_records(outcome, request_of_block, IDENTITY, ["c is wrong by 9 σ."])
    assert made[0].data.startswith("**🔴 ContradictsTruth: c is wrong by 9 σ.**")


def test_a_check_shows_what_was_found_beside_what_was_expected(
    request_of_block: RunRequest, tmp_path: Path
) -> None:
    overrides = ("direct_georeferencing.calibration=adjustment",)
    request = replace(request_of_block, overrides=overrides, out=tmp_path / "out")
    checked = carry_out(direct_georeferencing_check, request)
    identity = FlowRunIdentity("1", "direct-georeferencing-check")
    made = {one.key.rpartition("check-")[2]: one for one in artifacts_of_outcome(checked, request, identity)}
    assert made["map"].data.endswith("/georeferencing_map.svg")
    assert (tmp_path / "out" / "georeferencing_map.svg").read_text().startswith("<?xml")
    assert re.search(
        r"\| RMS at 5 independent points, east, north, up \| [\d., ]+ m \| ", made["verdict"].data
    )
    assert "[Direct-georeferencing check](<" in made["verdict"].data
    assert "5 independent check points" in made["points"].description


def test_a_result_that_cannot_be_read_any_more_is_remarked_on(
    outcome: RunOutcome, request_of_block: RunRequest, caplog: pytest.LogCaptureFixture
) -> None:
    table = outcome.directory / "check_points.parquet"
    bytes_before = table.read_bytes()
    table.unlink()
    try:
        assert artifacts_of_outcome(outcome, request_of_block, IDENTITY) == ()
    finally:
        table.write_bytes(bytes_before)
    assert "could not be made" in caplog.text
