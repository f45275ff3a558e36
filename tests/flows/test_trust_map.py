"""The trust map of a run: table, raster, figures, gates and report say the same."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rasterio

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.flows.conftest import write_block

CELL_M = 50.0
SETTINGS = f"""
trust_map_plan_m = {{ max = 1.0 }}
trust_map_height_m = {{ max = 0.001 }}
[trust_map]
cell_m = {CELL_M}
"""


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    project = write_block(tmp_path_factory.mktemp("trusted") / "block")
    project.write_text(project.read_text() + SETTINGS)
    found = carry_out(aerial_triangulation, RunRequest(project))
    assert found.error is None, found.error
    return found


@pytest.fixture(scope="module")
def table(outcome: RunOutcome) -> pd.DataFrame:
    return pd.read_parquet(outcome.directory / "trust_map_cells.parquet")


def test_every_cell_that_two_images_see_has_its_accuracy(table: pd.DataFrame) -> None:
    assert len(table) > 200
    assert (table["rays"] >= 2).all()
    sigma = table[["sigma_x_m", "sigma_y_m", "sigma_z_m"]].to_numpy()
    pair = table[["pair_sigma_x_m", "pair_sigma_y_m", "pair_sigma_z_m"]].to_numpy()
    assert np.isfinite(sigma).all()
    two = (table["rays"] == 2).to_numpy()
    np.testing.assert_allclose(sigma[two], pair[two], rtol=1e-9)
    assert np.median(pair[~two, 2] / sigma[~two, 2]) > 1.05
    # σ of 0.3 px of 5 µm from 1000 m with c = 50 mm: 3 cm on the ground, some 9 cm in height.
    assert 0.01 < np.median(sigma[:, 0]) < 0.05
    assert 0.03 < np.median(sigma[:, 2]) < 0.15
    assert (table["block_error_z_m"] > 0.0).all()


def test_cells_lie_in_a_grid_whose_neighbours_are_one_cell_apart(table: pd.DataFrame) -> None:
    assert table["x_m"].diff()[table["row"].diff() == 0].min() == pytest.approx(CELL_M)
    step = table.groupby("row")["y_m"].first().diff().dropna()
    np.testing.assert_allclose(step, -CELL_M)


def test_summary_and_gates_have_the_share_of_the_area(outcome: RunOutcome, table: pd.DataFrame) -> None:
    summary = json.loads((outcome.directory / "summary.json").read_text())
    place = int(np.ceil(0.95 * len(table))) - 1
    assert summary["trust_map_height_m"] == pytest.approx(np.sort(table["sigma_z_m"])[place])
    plan = [np.sort(table[f"sigma_{axis}_m"])[place] for axis in "xy"]
    assert summary["trust_map_plan_m"] == pytest.approx(max(plan))
    assert min(plan) < 0.99 * max(plan)
    external = summary["trust_map"]["external_m"]
    assert summary["trust_map_external_m"] == (None if None in external else max(external))
    assert summary["trust_map"]["cells"] == len(table)
    gates = {gate["name"]: gate for gate in summary["gates"]}
    assert gates["trust_map_plan_m"]["passed"]
    assert not gates["trust_map_height_m"]["passed"]
    assert gates["trust_map_height_m"]["unit"] == "m"
    assert summary["status"] == "gate_failed"


def test_the_report_draws_the_map_and_its_histogram(outcome: RunOutcome) -> None:
    page = (outcome.directory / "report.html").read_text()
    for text in ('id="trust"', 'id="figure-trust-map"', 'id="figure-trust-histogram"', 'id="trust-map"'):
        assert text in page
    assert "limit of the gate: 0.001 m" in page


def test_the_raster_has_a_band_for_every_value(outcome: RunOutcome, table: pd.DataFrame) -> None:
    with rasterio.open(outcome.directory / "trust_map.tif") as raster:
        band = raster.read(raster.descriptions.index("sigma_z_m") + 1)
        column, row = ~raster.transform @ (table["x_m"].to_numpy(), table["y_m"].to_numpy())
    np.testing.assert_allclose(row, table["row"] + 0.5)
    np.testing.assert_allclose(column, table["column"] + 0.5)
    np.testing.assert_allclose(band[table["row"], table["column"]], table["sigma_z_m"], rtol=1e-6)
    assert np.isfinite(band).sum() == len(table)


def test_cells_of_the_area_that_are_not_mapped_count_as_beyond_every_limit(
    table: pd.DataFrame, block: Path
) -> None:
    # Half of the area lies west of the block, where no image is.
    west, east = float(table["x_m"].min()), float(table["x_m"].max())
    south, north = float(table["y_m"].quantile(0.3)), float(table["y_m"].quantile(0.7))
    corners = [[2 * west - east, south], [east, south], [east, north], [2 * west - east, north]]
    given = SETTINGS.replace("0.001", "1.0") + f"area_m = {corners}\n"
    block.write_text(block.read_text() + given)
    found = carry_out(aerial_triangulation, RunRequest(block))
    assert found.error is None, found.error
    summary = json.loads((found.directory / "summary.json").read_text())
    assert 0.4 < summary["trust_map"]["unmapped"] < 0.7
    assert summary["trust_map_height_m"] is None
    assert not {gate["name"]: gate for gate in summary["gates"]}["trust_map_height_m"]["passed"]
    assert any("count as exceeding every limit" in problem for problem in summary["problems"])
    (failed,) = (problem for problem in summary["problems"] if "height_m counts as failed" in problem)
    assert "trust_map_height_m counts as failed: its value is unlimited on more than 5.0 %" in failed
    assert failed.endswith("% of the area is not mapped).")
    inner = pd.read_parquet(found.directory / "trust_map_cells.parquet")
    assert inner["y_m"].between(south, north).all()
    # The same cells as without the area have the same values.
    both = table.merge(inner, on=["x_m", "y_m"])
    assert len(both) > 50
    np.testing.assert_allclose(both["sigma_z_m_x"], both["sigma_z_m_y"], rtol=1e-6)


def test_an_area_elsewhere_is_an_error(warm_block: Path) -> None:
    warm_block.write_text(
        warm_block.read_text() + "[trust_map]\narea_m = [[9e5, 0.0], [9e5, 900.0], [9.1e5, 900.0]]\n"
    )
    outcome = carry_out(aerial_triangulation, RunRequest(warm_block))
    assert outcome.error is not None
    assert "does not overlap the block" in str(outcome.error)


def test_an_area_smaller_than_a_cell_is_an_error_that_says_so(warm_block: Path) -> None:
    area = "area_m = [[601, 301], [604, 301], [604, 304], [601, 304]]"
    warm_block.write_text(warm_block.read_text() + f"[trust_map]\ncell_m = 50.0\n{area}\n")
    outcome = carry_out(aerial_triangulation, RunRequest(warm_block))
    assert "No cell of 50 m has its middle in the area" in str(outcome.error)


def test_a_gate_without_its_map_is_an_error(block: Path) -> None:
    block.write_text(block.read_text() + "trust_map_height_m = { max = 0.05 }\n")
    outcome = carry_out(aerial_triangulation, RunRequest(block))
    assert outcome.error is not None
    assert "trust_map_height_m needs a trust map" in str(outcome.error)
