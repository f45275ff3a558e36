"""Check points of a plain run against what the σ of adjusted points and survey let expect."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from scipy import stats

from flows.command.result_table import result_table
from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.flows.adjustment_alone import adjustment_alone

AXES = ("dx", "dy", "dz")
GATE = "gates.check_over_limit={max=1.0}"


@pytest.fixture
def block(warm_block: Path) -> Path:
    return warm_block


def as_check_points(project: Path, *, raised_m: float = 0.0, sigma_m: float = 0.02) -> None:
    """Make all surveyed points but the first of the file check points, and raise them."""
    table = pd.read_csv(project.with_name("control.csv"), dtype={"point": str})
    chosen = table.index > 0
    table["role"] = np.where(chosen, "check", "control")
    table.loc[chosen, "z"] += raised_m
    table["sz"] = sigma_m
    table.to_csv(project.with_name("control.csv"), index=False)


def run(project: Path, *settings: str, story: Story = adjustment_alone) -> tuple[RunOutcome, dict[str, Any]]:
    outcome = carry_out(story, RunRequest(project, overrides=settings))
    assert outcome.error is None
    return outcome, json.loads((outcome.directory / "summary.json").read_text())


def test_check_points_that_agree_are_within_limits_made_of_their_own_sigmas(block: Path) -> None:
    as_check_points(block)
    outcome, summary = run(block, GATE, story=aerial_triangulation)
    found = summary["check_point_test"]
    table = pd.read_parquet(outcome.directory / "check_points.parquet")
    assert found["points"] == [4, 4, 4] == [len(table)] * 3
    for k, axis in enumerate(AXES):
        assert found["rmse_m"][k] == pytest.approx(float(np.sqrt(np.mean(table[f"{axis}_m"] ** 2))))
        # The trace of the joint covariance is the sum of the variances of the points.
        assert found["predicted_rmse_m"][k] == pytest.approx(
            float(np.sqrt(np.mean(table[f"sigma_{axis}_m"] ** 2))), rel=1e-6
        )
        assert 1.0 <= found["degrees_of_freedom"][k] <= 4.0
        # Points of one block err together: their mean is less certain than of independent ones.
        assert found["predicted_mean_sigma_m"][k] > found["predicted_rmse_m"][k] / 2.0
        assert found["predicted_low_m"][k] < found["rmse_m"][k] < found["predicted_high_m"][k]
        # Six figures, each to both sides.
        tail, freedom = (1.0 - found["confidence"]) / 12.0, found["degrees_of_freedom"][k]
        limits = found["predicted_rmse_m"][k] * np.sqrt(stats.chi2.ppf([tail, 1.0 - tail], freedom) / freedom)
        assert [found["predicted_low_m"][k], found["predicted_high_m"][k]] == pytest.approx(limits.tolist())
        limit = found["predicted_mean_sigma_m"][k] * stats.norm.isf(tail)
        assert found["mean_limit_m"][k] == pytest.approx(limit)
    assert found["over_limit"] < 1.0
    assert summary["status"] == "done"
    assert not any("check points are" in text for text in outcome.summary.problems)
    assert "Check points against their predicted σ" in (outcome.directory / "report.html").read_text()


def test_check_points_half_a_metre_too_high_are_beyond_their_limits_everywhere(block: Path) -> None:
    as_check_points(block, raised_m=0.5)
    outcome, summary = run(block, GATE, story=aerial_triangulation)
    assert summary["check_point_test"]["over_limit"] > 2.0
    said = next(text for text in outcome.summary.problems if "beyond their limits" in text)
    assert "RMS up 0." in said
    assert "mean up -0." in said
    assert "east" not in said
    assert [gate["name"] for gate in summary["gates"] if not gate["passed"]] == ["check_over_limit"]
    assert summary["status"] == "gate_failed"
    html = (outcome.directory / "report.html").read_text()
    assert "the check points are beyond their limits" in html
    assert "beyond its limits" in html
    console = Console(record=True, width=120)
    console.print(result_table(outcome))
    assert "beyond their limits" in console.export_text()


def test_differences_far_below_their_sigmas_are_a_remark_and_no_failure(block: Path) -> None:
    as_check_points(block, sigma_m=10.0)
    outcome, summary = run(block)
    assert any("smaller than expected from their σ: RMS up 0." in text for text in outcome.summary.problems)
    assert summary["check_point_test"]["over_limit"] < 1.0
    assert summary["status"] == "done"


def test_the_survey_has_one_scale_whatever_sigma0_is(block: Path) -> None:
    # Image points stated three times too coarse: σ0 near 1/3 says nothing about the survey.
    coarse = "inputs.image_points.sigma=0.9"
    outcome, summary = run(block, coarse, "gates={}")
    assert summary["sigma0"] < 0.5
    left_out = pd.read_parquet(outcome.directory / "control_residuals.parquet").set_index("point")
    name = str(left_out.index[0])
    table = pd.read_csv(block.with_name("control.csv"), dtype={"point": str})
    table.loc[table["point"] == name, "role"] = "check"
    table.to_csv(block.with_name("control.csv"), index=False)
    outcome, again = run(block, coarse, "gates={}")
    checked = pd.read_parquet(outcome.directory / "check_points.parquet").set_index("point")
    for axis in AXES:
        assert checked.loc[name, f"sigma_{axis}_m"] > 0.02
        assert left_out.loc[name, f"sigma_loo_{axis}_m"] == pytest.approx(
            checked.loc[name, f"sigma_{axis}_m"],
            rel=2.0 * abs(again["sigma0"] / summary["sigma0"] - 1.0) + 1e-3,
        )


def test_a_free_network_without_datum_has_nothing_to_test(block: Path) -> None:
    as_check_points(block)
    _, summary = run(
        block, 'adjustment.datum="free_network"', "adjustment.observe=[]", "adjustment.free=[]", "gates={}"
    )
    assert summary["check_point_test"] is None
