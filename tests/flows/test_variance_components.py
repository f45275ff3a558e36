"""Variance components in a run: stated in summary.json, said in words, and in the tables."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from flows.aerial_triangulation import aerial_triangulation
from flows.project_run import RunOutcome, RunRequest, carry_out
from tests.flows.conftest import PIXEL_SIGMA


def run(block: Path, name: str, *overrides: str) -> RunOutcome:
    outcome = carry_out(aerial_triangulation, RunRequest(block, block.parent / name, overrides))
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
        "control points in height" in text and "stay as stated" in text for text in outcome.summary.problems
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
