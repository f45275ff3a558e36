"""Variance components in a run: stated in summary.json, said in words, and in the tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tests.flows.adjustment_alone import adjustment_alone
from tests.flows.conftest import PIXEL_SIGMA


def run(block: Path, name: str, *overrides: str) -> RunOutcome:
    outcome = carry_out(adjustment_alone, RunRequest(block, block.parent / name, overrides))
    assert outcome.error is None, outcome.error
    return outcome


def test_sigmas_stated_wrongly_are_estimated_reported_and_used(block: Path) -> None:
    wrong = (
        f"inputs.image_points.sigma={3.0 * PIXEL_SIGMA}",
        "gates.sigma0={ min = 0.8, max = 1.2 }",
    )
    stated = run(block, "stated", *wrong)
    assert dict(stated.summary.to_json())["variance_components"] is None
    assert stated.summary.status == "gate_failed"
    outcome = run(block, "estimated", *wrong, "adjustment.variance_components=true")
    assert outcome.summary.status == "done"
    summary = dict(outcome.summary.to_json())
    # Not quite one: control in height has too little redundancy and keeps its weight.
    assert summary["sigma0"] == pytest.approx(1.0, abs=0.05)
    table = summary["variance_components"]
    assert 1 <= table["rounds"] <= 8
    parts = {row["part"]: row for row in table["components"]}
    image = parts["image_points"]
    assert image["sigma"] == pytest.approx(PIXEL_SIGMA * 5.0, rel=0.1)
    assert image["unit"] == "um"
    assert image["factor_lower"] < 1.0 / 3.0 < image["factor_upper"]
    assert image["degrees_of_freedom"] <= image["redundancy"]
    weak = parts["control_points height"]
    assert not weak["estimated"]
    assert weak["factor"] == 1.0
    assert weak["factor_lower"] is None
    assert any(
        text.startswith("The stated σ of image points do not agree") for text in outcome.summary.problems
    )
    assert any(
        "control points in height" in text and "remain as stated" in text for text in outcome.summary.problems
    )
    residuals = pq.read_table(outcome.directory / "residuals.parquet").to_pandas()
    used = residuals[(residuals["group"] == "image_points") & (residuals["status"] == "used")]
    assert used["sigma"].median() == pytest.approx(image["sigma"])


def test_right_sigmas_give_no_remark_and_the_same_block(block: Path) -> None:
    stated, estimated = run(block, "stated"), run(block, "estimated", "adjustment.variance_components=true")
    assert not [text for text in estimated.summary.problems if "do not agree with the residuals" in text]
    tables = [
        pq.read_table(outcome.directory / "exterior_orientations.parquet").to_pandas()
        for outcome in (stated, estimated)
    ]
    shift = (tables[0][["x_m", "y_m", "z_m"]] - tables[1][["x_m", "y_m", "z_m"]]).abs().max().max()
    assert shift < 0.5 * tables[0]["sigma_x_m"].median()


def in_two_files(project: Path) -> None:
    """Deliver a third of the points as manual measurements in a file of their own, with twice the noise."""
    table = pd.read_csv(project.with_name("image_points.csv"), dtype={"image": str, "point": str})
    is_manual = table["point"].str[1:].astype(int) % 3 == 0
    manual = table[is_manual].copy()
    random = np.random.default_rng(6)
    manual[["x", "y"]] += np.sqrt(3.0) * PIXEL_SIGMA * random.normal(size=(len(manual), 2))
    table[~is_manual].to_csv(project.with_name("image_points.csv"), index=False)
    manual.to_csv(project.with_name("manual.csv"), index=False)
    text = project.read_text().replace("[inputs.image_points]", "[[inputs.image_points]]")
    second = (
        f'[[inputs.image_points]]\nfile = "manual.csv"\nformat = "csv"\nunit = "px"\nsigma = {PIXEL_SIGMA}\n'
    )
    project.write_text(text.replace("[inputs.exposures]", f"{second}[inputs.exposures]"))


def test_points_of_two_files_get_their_own_sigma(block: Path) -> None:
    in_two_files(block)
    outcome = run(
        block,
        "by_file",
        "adjustment.variance_components=true",
        'adjustment.variance_components_by=["file", "camera", "flight"]',
    )
    components = dict(outcome.summary.to_json())["variance_components"]["components"]
    parts = {row["part"]: row for row in components}
    automatic, manual = (
        parts[f"image_points of {name}, camera C"] for name in ("image_points.csv", "manual.csv")
    )
    assert automatic["factor_lower"] < 1.0 < automatic["factor_upper"]
    assert manual["factor_lower"] < 2.0 < manual["factor_upper"]
    assert any(
        text.startswith("The stated σ of image points of manual.csv, camera C do not agree")
        for text in outcome.summary.problems
    )
    # One flight is no division.
    assert "gnss_positions plan" in parts
    table = pq.read_table(outcome.directory / "image_points.parquet").to_pandas()
    assert set(table["input_file"]) == {"image_points.csv", "manual.csv"}
    residuals = pq.read_table(outcome.directory / "residuals.parquet").to_pandas()
    rays = residuals[residuals["group"] == "image_points"].merge(table, on=["image", "point"])
    sigma = rays.groupby("input_file")["sigma"].median()
    assert sigma["manual.csv"] / sigma["image_points.csv"] == pytest.approx(2.0, rel=0.15)
