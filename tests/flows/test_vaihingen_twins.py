"""The twins of the Vaihingen flights show the pattern of the print, and answer what it leaves open."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tasks.settings.published_sweep import published_table

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "vaihingen_twin"
Tables = dict[str, pd.DataFrame]


def aerocal(*arguments: str | Path) -> None:
    command = [sys.executable, "-m", "flows.command", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module", params=["ucx", "dmc"])
def twin(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Tables]:
    """Camera, and sweep.parquet of the high and the low flight by variant, as the example's README says."""
    folder = tmp_path_factory.mktemp(request.param)
    for flight in ("high", "low"):
        aerocal("simulate", EXAMPLE / f"{request.param}-{flight}.toml", "--out", folder / flight)
        aerocal("run", folder / flight / "project.toml", "--set", "adjustment.residual_grid.cells=25")
    tables = {}
    for flight in ("high", "low"):
        aerocal("sweep", folder / flight / "project.toml")
        tables[flight] = pd.read_parquet(folder / flight / "results" / "sweep.parquet").set_index("variant")
        assert (tables[flight]["status"] == "done").all()
    return request.param, tables


@pytest.mark.parametrize("flight", ["high", "low"])
def test_self_calibration_improves_heights_most_and_the_grid_a_little(
    twin: tuple[str, Tables], flight: str
) -> None:
    table = twin[1][flight]
    z = table["rmse_check_z_m"]
    assert z["selfcal"] < 0.65 * z["none"]
    assert z["selfcal"] < z["grid"] < z["none"]
    assert table["sigma0_um"]["grid"] < table["sigma0_um"]["none"]
    gain = z["none"] - z["grid"]
    assert gain < 0.5 * (z["none"] - z["selfcal"])


def test_the_heights_are_about_those_of_the_print(twin: tuple[str, Tables]) -> None:
    camera, tables = twin
    published = published_table(f"vaihingen-{camera}-2008").figures
    for flight, tolerance in (("high", 0.2), ("low", 0.5)):
        for variant in ("none", "selfcal"):
            printed = published[flight, "9 control points", variant]["rmse_check_z_m"]
            found = tables[flight].loc[variant, "rmse_check_z_m"]
            assert found == pytest.approx(printed, rel=tolerance), (flight, variant)


def test_the_best_subdivision_is_neither_the_coarsest_nor_the_finest(twin: tuple[str, Tables]) -> None:
    table = twin[1]["high"]
    z = table["rmse_check_z_m"]
    assert z["grid 9 x 9"] < z["grid 3 x 3"] < z["none"]
    assert abs(z["grid"] - z["grid 9 x 9"]) < 0.2 * (z["grid 3 x 3"] - z["grid 9 x 9"])
    assert z["grid 9 x 9 iterated"] < z[["grid 9 x 9", "grid", "grid 50 x 50"]].min()


@pytest.mark.parametrize("flight", ["high", "low"])
def test_collocation_improves_heights_more_than_every_grid_of_means(
    twin: tuple[str, Tables], flight: str
) -> None:
    z = twin[1][flight]["rmse_check_z_m"]
    grids = [name for name in z.index if "grid" in name and name != "selfcal and grid"]
    assert z["selfcal"] < z["collocation"] < z[grids].min()


def test_cells_are_significant_before_a_correction_and_by_chance_after_it(twin: tuple[str, Tables]) -> None:
    table = twin[1]["high"]
    share = table["cells_significant"] / table["cells_by_chance"]
    assert share["none"] > 1.8
    assert share["grid"] < 1.2


def test_the_grids_of_both_flights_say_the_same(twin: tuple[str, Tables]) -> None:
    table = twin[1]["low"]
    z = table["rmse_check_z_m"]
    assert z["grid of both"] < z["none"]
    assert z["grid of both"] == pytest.approx(z["grid"], rel=0.03)
    assert table["sigma0_um"]["own grid"] < table["sigma0_um"]["grid of both"] < table["sigma0_um"]["grid"]
