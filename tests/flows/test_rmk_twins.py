"""The twins of the published film flights: heights with and without self-calibration, and with GNSS."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.scenario_sweep import sweep_of
from tasks.settings.load_simulation import load_simulation
from tasks.settings.published_sweep import published_table
from tasks.simulation.simulate import simulate_project

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

CONTROL = "14 control points"


def swept(folder: Path, flight: str, *overrides: str) -> pd.DataFrame:
    """sweep.parquet of a flight by variant, without the grid."""
    project = folder / flight / "project.toml"
    if not project.exists():
        simulate_project(load_simulation(f"vaihingen-rmk-{flight}"), project.parent)
        text, cut = re.subn(r"(?ms)^\[sweep\.variants\.grid\].*?(?=^\[|\Z)", "", project.read_text())
        assert cut == 1
        project.write_text(text)
    request = RunRequest(project, folder / f"{flight}-{len(overrides)}", overrides=overrides)
    found = carry_out(sweep_of(request), request)
    assert found.error is None, found.error
    return pd.read_parquet(found.directory / "sweep.parquet").set_index("variant")


@pytest.mark.parametrize("flight", ["high", "low"])
def test_heights_are_those_of_the_print_if_control_alone_holds_the_block(flight: str, tmp_path: Path) -> None:
    printed = published_table("vaihingen-rmk-2008").figures
    table = swept(tmp_path, flight)
    for variant, tolerance in (("none", 0.2), ("selfcal", 0.45)):
        expected = printed[flight, CONTROL, variant]["rmse_check_z_m"]
        assert table.loc[variant, "rmse_check_z_m"] == pytest.approx(expected, rel=tolerance)
    assert table["sigma0_um"]["selfcal"] < table["sigma0_um"]["none"]


def test_gnss_would_halve_the_heights_of_the_low_flight(tmp_path: Path) -> None:
    """What an adjustment with GNSS would have found is not what is printed, 0.152 m."""
    alone = swept(tmp_path, "low").loc["none", "rmse_check_z_m"]
    with_gnss = swept(tmp_path, "low", 'adjustment.observe=["gnss", "ins", "control"]')
    assert with_gnss.loc["none", "rmse_check_z_m"] < 0.55 * alone
