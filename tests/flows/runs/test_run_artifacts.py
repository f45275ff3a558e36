"""What a run shows in the dashboard: its state first, links to the production page, never more than fits."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.runs.recorded_run import FlowRunIdentity, configured_overview, ended_run, refused_run
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from tasks.production.run_record import OVERVIEW_VARIABLE, RECORDS_VARIABLE, RunRecord
from tasks.production.short_text import text_key, text_of
from tests.flows.conftest import write_block

IDENTITY = FlowRunIdentity("1234", "aerial-triangulation")


def markdown(run: RunRecord) -> str:
    """The text that the dashboard shows of a run."""
    return text_of(run, configured_overview())


@pytest.fixture(scope="module")
def request_of_block(tmp_path_factory: pytest.TempPathFactory) -> RunRequest:
    """A block whose surveyed points are all check points, and whose gate is not passed."""
    folder = tmp_path_factory.mktemp("artifacts") / "Block 7"
    write_block(folder)
    control = folder / "control.csv"
    control.write_text(control.read_text().replace(",control", ",check"))
    return RunRequest(folder / "project.toml", overrides=("gates.max_check_m.max=[9.0, 9.0, 0.001]",))


@pytest.fixture(scope="module")
def outcome(request_of_block: RunRequest) -> RunOutcome:
    return carry_out(aerial_triangulation, request_of_block)


@pytest.fixture(autouse=True)
def served(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(OVERVIEW_VARIABLE, "http://127.0.0.1:8051/")
    monkeypatch.setenv(RECORDS_VARIABLE, "records.sqlite")


def test_the_state_stands_in_the_first_line_and_links_follow(
    outcome: RunOutcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = markdown(ended_run(outcome, IDENTITY))
    assert text.startswith("**GateFailed: Gates not passed: max_check_m_z.**\n")
    assert "[Report](<http://127.0.0.1:8051/results/1234/report.html>)" in text
    assert "[Production page](<http://127.0.0.1:8051/>)" in text
    assert "decide whether they may be used" in text
    assert f"`{outcome.directory}`" in text
    monkeypatch.delenv(OVERVIEW_VARIABLE)
    assert "](<" not in markdown(ended_run(outcome, IDENTITY))


def test_keys_are_those_of_project_and_story(outcome: RunOutcome, request_of_block: RunRequest) -> None:
    def key(request: RunRequest, run: str) -> str:
        ended = replace(outcome, request=request)
        return text_key(ended_run(ended, FlowRunIdentity(run, "aerial-triangulation")))

    first = key(request_of_block, "1")
    assert re.fullmatch(r"block-7-[0-9a-f]{8}-aerial-triangulation", first)
    assert key(request_of_block, "2") == first
    assert key(RunRequest(Path("/elsewhere/Block 7/project.toml")), "1") != first
    assert re.fullmatch(r"[a-z0-9-]+", text_key(refused_run("../ÄÖ*", "InputError", "no", IDENTITY)))


def test_what_is_wrong_with_an_input_stands_there_with_what_to_do(request_of_block: RunRequest) -> None:
    request = replace(request_of_block, overrides=("inputs.exposures.crs=EPSG:0",))
    text = markdown(ended_run(carry_out(aerial_triangulation, request), IDENTITY))
    assert text.startswith("**InputError: ")
    assert "EPSG:0" in text.splitlines()[0]
    assert "Correct what the message names" in text
    assert "results/1234" not in text
    assert "<script>" not in markdown(refused_run("a", "Failed", "<script>", IDENTITY))


def test_many_problems_stay_small(outcome: RunOutcome) -> None:
    problems = tuple(f"Problem {number} " + "x" * 3000 for number in range(2000))
    many = replace(outcome, summary=outcome.summary.model_copy(update={"problems": problems}))
    text = markdown(ended_run(many, IDENTITY))
    assert len(text) < 20_000
    assert "1995 more in summary.json" in text


def test_a_check_leads_to_its_own_page(request_of_block: RunRequest, tmp_path: Path) -> None:
    overrides = ("direct_georeferencing.calibration=adjustment",)
    request = replace(request_of_block, overrides=overrides, out=tmp_path / "out")
    checked = carry_out(direct_georeferencing_check, request)
    text = markdown(ended_run(checked, FlowRunIdentity("1", "direct-georeferencing-check")))
    assert "/results/1/georeferencing_check.html>)" in text
