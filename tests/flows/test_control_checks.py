"""Control points as check points of themselves: from one run, and from runs that really are without them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.flows.adjustment_alone import adjustment_alone

AXES = ("dx", "dy", "dz")


@pytest.fixture
def block(warm_block: Path) -> Path:
    return warm_block


def run(project: Path, *settings: str, story: Story = adjustment_alone) -> Path:
    outcome = carry_out(story, RunRequest(project, overrides=settings))
    assert outcome.error is None
    return outcome.directory


def with_role(project: Path, points: list[str], role: str) -> None:
    """Give control points another role in the delivered file."""
    table = pd.read_csv(project.with_name("control.csv"), dtype=str)
    table.loc[table["point"].isin(points), "role"] = role
    table.to_csv(project.with_name("control.csv"), index=False)


# Of the four points two are enough for every day.
@pytest.mark.parametrize("chosen", [[0, 2], pytest.param([1, 3], marks=pytest.mark.slow)])
def test_a_point_left_out_in_theory_is_the_check_point_it_would_have_been(
    block: Path, chosen: list[int]
) -> None:
    foreseen = pd.read_parquet(run(block, "adjustment.sigma0=a_priori") / "control_residuals.parquet")
    assert len(foreseen) == 4
    for row in foreseen.iloc[chosen].to_dict("records"):
        with_role(block, [row["point"]], "check")
        checked = pd.read_parquet(run(block, "adjustment.sigma0=a_priori") / "check_points.parquet")
        with_role(block, [row["point"]], "control")
        found = checked.set_index("point").loc[row["point"]]
        for axis in AXES:
            sigma = found[f"sigma_{axis}_m"]
            # The equations are not quite linear: a hundredth of a standard deviation.
            assert row[f"loo_{axis}_m"] == pytest.approx(found[f"{axis}_m"], abs=0.01 * sigma)
            assert row[f"sigma_loo_{axis}_m"] == pytest.approx(sigma, rel=1e-3)
            assert row[f"sigma_loo_{axis}_m"] > row[f"sigma_{axis}_m"]


def test_the_summary_states_leave_one_out_always_and_folds_on_request(block: Path) -> None:
    plain = json.loads((run(block) / "summary.json").read_text())
    assert plain["k_fold"] is None
    out = run(block, "adjustment.control_folds=2", story=aerial_triangulation)
    summary = json.loads((out / "summary.json").read_text())
    assert summary["leave_one_out"] == plain["leave_one_out"]
    table = pd.read_parquet(out / "control_residuals.parquet")
    for k, axis in enumerate(AXES):
        rms = float(np.sqrt(np.mean(table[f"loo_{axis}_m"] ** 2)))
        assert summary["leave_one_out"]["rmse_m"][k] == pytest.approx(rms)
        assert summary["leave_one_out"]["max_m"][k] == pytest.approx(table[f"loo_{axis}_m"].abs().max())
        squares = (table[f"loo_{axis}_m"] / table[f"sigma_loo_{axis}_m"]) ** 2
        assert summary["leave_one_out"]["rms_over_sigma"][k] == pytest.approx(np.sqrt(squares.mean()))
    assert summary["k_fold"]["folds"] == 2
    assert summary["k_fold"]["points"] == 4
    assert all(value > 0.0 for value in summary["k_fold"]["rmse_m"])
    assert "left out in 2 folds" in (out / "report.html").read_text()


def test_without_control_points_nothing_is_left_out(block: Path) -> None:
    with_role(block, list(pd.read_csv(block.with_name("control.csv"))["point"]), "check")
    out = run(block, "adjustment.control_folds=5")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["leave_one_out"] is None
    assert summary["k_fold"] is None
    assert pd.read_parquet(out / "control_residuals.parquet").empty


def test_a_rejected_control_point_is_named_and_is_the_check_point_it_has_become(block: Path) -> None:
    table = pd.read_csv(block.with_name("control.csv"), dtype={"point": str})
    wrong = str(table["point"].iloc[1])
    table.loc[1, "z"] += 2.0
    table.to_csv(block.with_name("control.csv"), index=False)
    rejection = 'adjustment.rejection={critical_value=4.0, test="observations"}'
    outcome = carry_out(
        aerial_triangulation, RunRequest(block, overrides=(rejection, "adjustment.sigma0=a_priori"))
    )
    assert outcome.error is None
    assert any(f"Rejected control points: {wrong}." in text for text in outcome.summary.problems)
    summary = json.loads((outcome.directory / "summary.json").read_text())
    found = pd.read_parquet(outcome.directory / "control_residuals.parquet").set_index("point")
    assert found["status"].to_dict() == {
        name: "rejected" if name == wrong else "used" for name in found.index
    }
    used = found[found["status"] == "used"]
    assert summary["counts"]["control"] == len(used) == len(found) - 1
    assert summary["rmse_control_m"][2] == pytest.approx(float(np.sqrt(np.mean(used["dz_m"] ** 2))))
    html = (outcome.directory / "report.html").read_text()
    assert f"rejected control point {wrong}:" in html
    with_role(block, [wrong], "check")
    as_check = run(block, rejection, "adjustment.sigma0=a_priori")
    checked = pd.read_parquet(as_check / "check_points.parquet").set_index("point").loc[wrong]
    for axis in AXES:
        assert found.loc[wrong, f"{axis}_m"] == pytest.approx(checked[f"{axis}_m"], abs=1e-4)
        assert found.loc[wrong, f"sigma_{axis}_m"] == pytest.approx(checked[f"sigma_{axis}_m"], rel=1e-3)
    assert abs(found.loc[wrong, "dz_m"] + 2.0) < 0.3


def test_control_without_sigma_is_fixed_and_still_checked_by_the_rest(block: Path) -> None:
    out = run(block, "inputs.control.sigma_m=0", 'adjustment.sigma0="a_priori"')
    table = pd.read_parquet(out / "control_residuals.parquet")
    left_out = pd.read_parquet(run(block, 'adjustment.sigma0="a_priori"') / "control_residuals.parquet")
    for axis in AXES:
        assert (table[f"{axis}_m"].abs() < 1e-4).all()
        # Without the point the same as before, but for the survey that counts as perfect.
        assert (table[f"loo_{axis}_m"] - left_out[f"loo_{axis}_m"]).abs().max() < 0.1
        assert (table[f"sigma_loo_{axis}_m"] < left_out[f"sigma_loo_{axis}_m"]).all()


@pytest.mark.parametrize("rejection", ["none", "{ critical_value = 4.13 }"])
def test_a_control_point_a_metre_off_is_named_whether_it_is_rejected_or_not(
    block: Path, rejection: str
) -> None:
    # A sound block names none.
    sound = json.loads((run(block, f"adjustment.rejection={rejection}") / "summary.json").read_text())
    said = re.compile(r"(?:The given coordinates of control point|Rejected control points:) ([^\s,.]+)")
    assert not [sentence for sentence in sound["problems"] if said.match(sentence)]
    table = pd.read_csv(block.with_name("control.csv"))
    wrong = table.index[table["role"] == "control"][1]
    table.loc[wrong, "x"] += 1.0
    table.to_csv(block.with_name("control.csv"), index=False)
    summary = json.loads((run(block, f"adjustment.rejection={rejection}") / "summary.json").read_text())
    named = [found.group(1) for sentence in summary["problems"] if (found := said.match(sentence))]
    assert named == [str(table.loc[wrong, "point"])]
