"""Exposures that were delivered without a position: no observation, and oriented by image points."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tests.flows.adjustment_alone import adjustment_alone


def without_position(project: Path, images: list[str], columns: tuple[str, ...] = ("x", "y", "z")) -> None:
    """Empty some columns of some exposures in the delivered file."""
    table = pd.read_csv(project.with_name("exposures.csv"), dtype=str)
    for column in columns:
        table.loc[table["image"].isin(images), column] = ""
    table.to_csv(project.with_name("exposures.csv"), index=False)


def run(project: Path) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(project))


def test_an_exposure_without_position_is_no_observation_and_is_oriented_by_its_image_points(
    block: Path,
) -> None:
    full = run(block)
    before = pd.read_parquet(full.directory / "exterior_orientations.parquet").set_index("image")
    redundancy = json.loads((full.directory / "summary.json").read_text())["redundancy"]
    without_position(block, ["1_002", "2_004"])
    outcome = run(block)
    assert outcome.error is None
    assert any("2 exposures have no position (1_002, 2_004)" in text for text in outcome.summary.problems)
    summary = json.loads((outcome.directory / "summary.json").read_text())
    assert summary["redundancy"] == pytest.approx(redundancy - 6)
    assert summary["counts"]["images"] == 8
    residuals = pd.read_parquet(outcome.directory / "residuals.parquet")
    gnss = residuals[
        (residuals["group"] == "gnss_positions") & residuals["status"].isin(["used", "uncontrolled"])
    ]
    assert sorted(set(gnss["image"])) == sorted(set(before.index) - {"1_002", "2_004"})
    after = pd.read_parquet(outcome.directory / "exterior_orientations.parquet").set_index("image")
    for axis in "xyz":
        moved = np.abs(after[f"{axis}_m"] - before[f"{axis}_m"])
        # The image points hold them, with a larger σ than with a position of their own.
        assert (moved < 4.0 * after[f"sigma_{axis}_m"]).all()
        assert after.loc["2_004", f"sigma_{axis}_m"] > before.loc["2_004", f"sigma_{axis}_m"]
    delivered = pd.read_parquet(outcome.directory / "exposures.parquet").set_index("image")
    assert np.isnan(delivered.loc["1_002", ["x_m", "sigma_x_m"]].astype(float)).all()


def test_half_a_position_is_an_error_that_names_the_line(block: Path) -> None:
    without_position(block, ["1_002"], ("x",))
    error = str(run(block).error)
    assert "exposures.csv:3:" in error
    assert "The column 'x' is empty here, but not y and z." in error
