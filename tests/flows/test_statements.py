"""Statements about accuracy of a run: as data, as a page, in the report, in summary.json; and refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.tasks.accuracy.test_statement import own
from tests.tasks.documents.report.page_reader import Page


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """60 images with control and check points."""
    simulation = load_simulation("dmc-20cm", ("points.count=300",), 4)
    return simulate_project(simulation, tmp_path_factory.mktemp("flight")).project_file


def with_statements(flight: Path, text: str) -> Path:
    project = flight.with_name("with_statements.toml")
    project.write_text(flight.read_text(encoding="utf-8") + text, encoding="utf-8")
    return project


def test_two_standards_are_stated_from_the_check_points(flight: Path, tmp_path: Path) -> None:
    text = (
        '\n[[statement]]\nstandard = "asprs-2024"\nclass_m = 0.01\n[[statement]]\nstandard = "nssda-1998"\n'
    )
    found = carry_out(aerial_triangulation, RunRequest(with_statements(flight, text), tmp_path / "results"))
    assert found.error is None, found.error
    results = found.directory
    made = json.loads((results / "statements.json").read_text())["statements"]
    summary = json.loads((results / "summary.json").read_text())
    assert summary["accuracy_statements"] == made
    assert [one["passed"] for one in made] == [False, True]
    check = pd.read_parquet(results / "check_points.parquet")
    rmse = np.sqrt((check[["dx_m", "dy_m", "dz_m"]] ** 2).mean())
    assert made[1]["figures_m"]["Accuracy_z"] == pytest.approx(1.96 * rmse["dz_m"])
    assert made[1]["figures_m"]["Accuracy_r"] == pytest.approx(2.4477 * 0.5 * (rmse["dx_m"] + rmse["dy_m"]))
    assert "NOT meet a 1 cm RMSE_H" in made[0]["sentence"]
    assert any("says NO" in problem for problem in summary["problems"])
    for file in ("report.html", "statements.html"):
        page = Page((results / file).read_text(encoding="utf-8"))
        assert made[0]["sentence"] in page.text
        assert "Not compared with the document itself" in page.text
        value = page.tables["statement-figures"].numbers["1:height:Accuracy_z", "value"]
        assert float(value.data) == made[1]["figures_m"]["Accuracy_z"]
    assert "Accuracy statements" in Page((results / "report.html").read_text(encoding="utf-8")).text


def test_a_template_of_ones_own_states_and_a_change_of_it_computes_the_statement_only(
    flight: Path, tmp_path: Path
) -> None:
    own(flight.parent, "least_check_points = 5", "least_check_points = 4")
    project = with_statements(flight, '\n[[statement]]\ntemplate = "own.toml"\n')
    request = RunRequest(project, tmp_path / "results")
    first = carry_out(aerial_triangulation, request)
    assert first.error is None, first.error
    before = json.loads((first.directory / "statements.json").read_text())["statements"][0]
    assert before["standard"] == "Directive 12 of the survey department"
    adjusted = (first.directory / "residuals.parquet").stat().st_ino
    own(flight.parent, "least_check_points = 5", "least_check_points = 4000")
    again = carry_out(aerial_triangulation, request)
    assert again.error is None, again.error
    after = json.loads((again.directory / "statements.json").read_text())["statements"][0]
    assert after["passed"] is False
    assert "of 4000 points" in after["sentence"]
    # Published files are those of the store: the same one was not written again.
    assert (again.directory / "residuals.parquet").stat().st_ino == adjusted


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('template = "own.toml"', "unknown quantity 'RMSE_w'"),
        ('standard = "asprs-1990"', "asprs-2024"),
        ("class_m = 0.1", "either a standard or a template"),
        ('standard = "asprs-2024"\nvegetated = ["nobody"]', "'nobody' is listed under `vegetated`"),
        ('template = "missing.toml"', "missing.toml"),
        ('standard = "nssda-1998"\nclass_m = 0.01', "has no accuracy class"),
        ('standard = "nssda-1998"\nvegetated = ["1"]', "says nothing about points under vegetation"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(
    flight: Path, tmp_path: Path, text: str, words: str
) -> None:
    own(flight.parent, "RMSE_x = 0.05", "RMSE_w = 0.05")
    project = with_statements(flight, f"\n[[statement]]\n{text}\n")
    found = carry_out(aerial_triangulation, RunRequest(project, tmp_path / "results"))
    assert found.summary.status == "input_error"
    assert found.error is not None
    assert words in str(found.error)
