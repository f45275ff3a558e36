"""Mean residuals from the project file to the published tables: computed, iterated, handed on."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

GRID = "adjustment.residual_grid"
REJECTED = "adjustment.rejection.critical_value=3.29"
FREE_NETWORK = ('adjustment.datum="free_network"', 'adjustment.observe=["ins"]', "adjustment.free=[]")
#: 28 images with radial errors and shifted CCD images; no gross errors in the way.
SPECIFICATION = ("points.count=1500", "truth.image_errors.radial_um=2.0", "truth.image_errors.tile_um=1.0")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flight")
    simulate_project(load_simulation("uce-high", SPECIFICATION), folder)
    return folder / "project.toml"


@pytest.fixture(scope="module")
def run(flight: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., RunOutcome]:
    outcomes: dict[tuple[str, ...], RunOutcome] = {}

    def carried_out(*overrides: str) -> RunOutcome:
        if overrides not in outcomes:
            out = tmp_path_factory.mktemp("out")
            # What the settings leave as it is was computed by the first run.
            for first in list(outcomes.values())[:1]:
                shutil.copytree(first.directory / ".store", out / ".store")
            outcomes[overrides] = carry_out(adjustment_alone, RunRequest(flight, out, overrides))
        return outcomes[overrides]

    return carried_out


@pytest.fixture(scope="module")
def report(flight: Path, run: Callable[..., RunOutcome]) -> Callable[..., str]:
    def reported(*overrides: str) -> str:
        out = run(*overrides).directory
        outcome = carry_out(aerial_triangulation, RunRequest(flight, out, overrides))
        assert outcome.error is None, outcome.error
        return (out / "report.html").read_text()

    return reported


def summary(outcome: RunOutcome) -> dict:
    assert outcome.error is None, outcome.error
    return json.loads((outcome.directory / "summary.json").read_text())


def grid_of(outcome: RunOutcome) -> pd.DataFrame:
    return pd.read_parquet(outcome.directory / "residual_grid.parquet")


def test_every_run_writes_the_means_and_says_that_they_are_systematic(run) -> None:
    outcome = run()
    table, figures = grid_of(outcome), summary(outcome)
    camera = figures["residual_grid"]["cameras"][0]
    assert figures["residual_grid"]["iteration"] is None
    assert camera["columns"] ** 2 == len(table) == table["p_value"].notna().sum()
    assert camera["significant"] == table["significant"].sum() > 0.4 * len(table)
    assert table["correction_x_um"].isna().all()
    assert any("Systematic image residuals of camera" in problem for problem in figures["problems"])
    assert any("neighbouring image points" in problem for problem in figures["problems"])
    # The means are those of the published residuals.
    points = pd.read_parquet(outcome.directory / "image_points.parquet")
    residuals = pd.read_parquet(outcome.directory / "residuals.parquet")
    chosen = residuals[
        (residuals["group"] == "image_points")
        & (residuals["component"] == "y")
        & (residuals["status"] == "used")
        & (residuals["redundancy"] > 0.2)
    ].merge(points, on=["image", "point"])
    for cell in table.sample(20, random_state=1).to_dict("records"):
        own = chosen[
            (chosen["x_mm"] - cell["x_mm"]).abs().lt(0.5 * cell["width_mm"])
            & (chosen["y_mm"] - cell["y_mm"]).abs().lt(0.5 * cell["height_mm"])
        ]
        assert cell["count_vy"] == len(own)
        assert cell["mean_vy_um"] == pytest.approx(own["residual"].mean(), abs=1e-9)


def test_the_correlation_of_neighbours_is_published(run) -> None:
    table = pd.read_parquet(run().directory / "residual_autocorrelation.parquet")
    assert list(table["distance_to_mm"]) == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0] * 2
    assert table.loc[table["distance_to_mm"] == 8.0, "correlated"].all()


def test_iterated_corrections_take_the_systematic_part_away(run) -> None:
    without, outcome = summary(run()), run(f"{GRID}.iterations=4")
    figures, table = summary(outcome), grid_of(outcome)
    iteration = figures["residual_grid"]["iteration"]
    assert 1 <= iteration["taken"] <= 4
    assert figures["sigma0"] == pytest.approx(iteration["steps"][-1]["sigma0"], rel=1e-3)
    assert figures["sigma0"] < 0.85 * without["sigma0"]
    assert iteration["gain"] > 0.2
    camera = figures["residual_grid"]["cameras"][0]
    assert camera["significant"] < 0.1 * len(table)
    assert not any("Systematic" in problem for problem in figures["problems"])
    assert any("were corrected" in problem for problem in figures["problems"])
    assert table["correction_x_um"].notna().all()
    rms = np.sqrt((table[["correction_x_um", "correction_y_um"]] ** 2).mean())
    assert camera["correction_rms_um"] == pytest.approx(rms.tolist(), rel=1e-6)


def test_collocation_takes_more_than_the_means_away_in_one_step(run, report) -> None:
    settings = (f"{GRID}.iterations=4", f'{GRID}.method="collocation"', f"{GRID}.cells=9")
    figures, means = summary(run(*settings)), summary(run(f"{GRID}.iterations=4", f"{GRID}.cells=9"))
    iteration = figures["residual_grid"]["iteration"]
    assert iteration["method"] == "collocation"
    assert iteration["steps"][1]["sigma0"] < means["residual_grid"]["iteration"]["steps"][1]["sigma0"]
    assert iteration["gain"] > 0.2
    assert figures["sigma0"] == pytest.approx(iteration["steps"][-1]["sigma0"], rel=1e-3)
    heights, of_means = (item["residual_grid"]["remaining"]["heights"] for item in (figures, means))
    assert 1.0 < heights < of_means
    assert any("by collocation of their mean residuals" in problem for problem in figures["problems"])
    assert 'id="grid-iteration"' in report(*settings)


def test_sub_areas_too_coarse_for_the_errors_are_named_with_the_number_that_is_enough(run) -> None:
    figures = summary(run(f"{GRID}.iterations=3", f"{GRID}.cells=5"))
    camera = figures["residual_grid"]["cameras"][0]
    within = camera["within"]
    assert within["significant"]
    assert within["probability"] < 1e-4
    assert 0.05 < within["rms_um"] < 1.0
    assert 5 < (within["enough"] or 15) <= 15
    # Errors within the sub-areas were looked for.
    assert camera["parts"] > 1
    (sentence,) = (problem for problem in figures["problems"] if "too coarse" in problem)
    assert "The 5 × 5 sub-areas are too coarse for the image errors of camera" in sentence
    # Nothing was to be corrected.
    assert summary(run())["residual_grid"]["cameras"][0]["within"] is None


def test_the_grid_of_another_run_is_applied_before_the_adjustment(run) -> None:
    first = run(f"{GRID}.iterations=4")
    file = first.directory / "residual_grid.parquet"
    second = run(f'{GRID}.file="{file}"')
    # The same block again: the corrections are the same, and so is the result.
    assert summary(second)["sigma0"] == pytest.approx(summary(first)["sigma0"], rel=1e-6)
    pd.testing.assert_frame_equal(
        grid_of(second)[["correction_x_um", "correction_y_um"]],
        grid_of(first)[["correction_x_um", "correction_y_um"]],
        atol=1e-9,
    )


def test_the_report_shows_corrections_and_what_is_left(report) -> None:
    html = report(f"{GRID}.iterations=4")
    assert "what remains after the corrections" in html
    assert html.count('aria-label="Corrections of camera') == 1
    assert 'id="grid-iteration"' in html
    assert "Correlation of residuals by distance" in html


def test_seams_of_the_camera_are_borders_of_the_sub_areas(run, report) -> None:
    name = grid_of(run())["camera"][0]
    seams = (f"cameras.{name}.tiles={{ seams_x_mm = [-10.0, 12.0], seams_y_mm = [3.0] }}", f"{GRID}.cells=9")
    table = grid_of(run(*seams))
    assert len(table) == 81
    borders = (table["x_mm"] - 0.5 * table["width_mm"]).round(6)
    assert {-10.0, 12.0} <= set(borders)
    assert set(table["tile_x"]) == {0, 1, 2}
    assert set(table["tile_y"]) == {0, 1}
    html = report(*seams)
    assert 'class="seams"><line' in html
    assert "what remains after the corrections" not in html


def test_seams_in_turned_calibration_axes_are_turned_back(run) -> None:
    name = grid_of(run())["camera"][0]
    outcome = run(
        f"cameras.{name}.tiles={{ seams_x_mm = [3.0], seams_y_mm = [] }}",
        f"cameras.{name}.calibration_axes_deg=90",
        f"{GRID}.cells=6",
    )
    # Calibration x points along image y.
    table = grid_of(outcome)
    assert 3.0 in set((table["y_mm"] - 0.5 * table["height_mm"]).round(6))
    assert set(table["tile_x"]) == {0}


def test_fewer_sub_areas_than_ccd_images_are_refused(run) -> None:
    name = grid_of(run())["camera"][0]
    outcome = run(
        f"cameras.{name}.tiles={{ seams_x_mm = [-10.0, 12.0], seams_y_mm = [] }}", f"{GRID}.cells=2"
    )
    assert outcome.error is not None
    assert "3 at least" in outcome.error


def test_a_file_of_another_camera_is_refused_before_anything_is_adjusted(run, tmp_path: Path) -> None:
    file = tmp_path / "residual_grid.parquet"
    file.write_bytes((run().directory / "image_points.parquet").read_bytes())
    outcome = run(f'{GRID}.file="{file}"')
    assert outcome.error is not None
    assert "not a table 'residual_grid'" in outcome.error


def test_additional_parameters_first_and_then_the_grid(run) -> None:
    parameters = 'adjustment.self_calibration.parameters="bluh:9-11"'
    sets = summary(run(parameters))
    both = run(parameters, f"{GRID}.iterations=4")
    figures = summary(both)
    assert figures["residual_grid"]["iteration"]["taken"] >= 1
    assert figures["residual_grid"]["iteration"]["steps"][0]["sigma0"] == pytest.approx(
        sets["sigma0"], rel=1e-6
    )
    assert figures["sigma0"] < 0.95 * sets["sigma0"]
    own, of_block = (
        pd.read_parquet(both.directory / f"{name}.parquet").set_index("parameter")
        for name in ("self_calibration", "parameters")
    )
    left = own.index[own["sigma"].notna()]
    for column in ("value", "sigma"):
        assert own.loc[left, column].tolist() == pytest.approx(of_block.loc[left, column].tolist(), rel=1e-12)
    # The parameters that were kept are estimated together with the corrections.
    kept = [item for item in figures["parameters"] if item["parameter"].startswith("bluh:")]
    assert {item["parameter"] for item in kept if item["sigma"] is not None} == {
        item["parameter"]
        for item in sets["parameters"]
        if item["parameter"].startswith("bluh:") and item["sigma"]
    }
    # What the parameters take the grid need not.
    alone = summary(run(f"{GRID}.iterations=4"))["residual_grid"]["cameras"][0]["correction_rms_um"]
    assert sum(figures["residual_grid"]["cameras"][0]["correction_rms_um"]) < sum(alone)


@pytest.mark.parametrize(
    "overrides",
    [
        pytest.param((REJECTED,), marks=pytest.mark.slow),
        pytest.param(("adjustment.variance_components=true",), marks=pytest.mark.slow),
        pytest.param(FREE_NETWORK, marks=pytest.mark.slow),
        (REJECTED, *FREE_NETWORK),
    ],
    ids=["rejection", "variance components", "free network", "rejection in a free network"],
)
def test_corrections_go_with_every_kind_of_adjustment(run, overrides: tuple[str, ...]) -> None:
    without, with_grid = summary(run(*overrides)), summary(run(*overrides, f"{GRID}.iterations=3"))
    iteration = with_grid["residual_grid"]["iteration"]
    assert iteration["steps"][0]["sigma0"] == pytest.approx(without["sigma0"], rel=1e-6)
    assert iteration["taken"] >= 1
    assert with_grid["image_rms_px"][1] < 0.9 * without["image_rms_px"][1]
    camera = with_grid["residual_grid"]["cameras"][0]
    assert camera["significant"] < 0.15 * camera["known"]
