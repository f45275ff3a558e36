"""Errors of GNSS and INS correlated over time: simulated, declared, estimated, refused with the reason."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth
from tests.flows.adjustment_alone import adjustment_alone

CORRELATED = (
    "points.count=250",
    "noise.gnss_m=[0, 0, 0]",
    "noise.gnss_markov_m=[0.05, 0.05, 0.05]",
    "noise.gnss_correlation_s=30",
    "noise.ins_deg=[0, 0, 0]",
    "noise.ins_markov_deg=[0.003, 0.003, 0.008]",
    "noise.ins_correlation_s=40",
)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """28 images in crossing strips with results; positions and attitudes have correlated errors only."""
    folder = tmp_path_factory.mktemp("correlated")
    simulate_project(load_simulation("uce-high", CORRELATED), folder)
    assert run(folder).error is None
    return folder


@pytest.fixture
def delivered(flight: Path, tmp_path: Path) -> Path:
    """A copy, to be changed: what a test's own run does not change is not computed again."""
    return Path(shutil.copytree(flight, tmp_path / "project"))


def run(project: Path, *overrides: str) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(project / "project.toml", overrides=overrides))


def change(path: Path, edit: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    edit(pd.read_csv(path, dtype=str, keep_default_na=False)).to_csv(path, index=False)


def sigmas(outcome: RunOutcome) -> dict[str, float]:
    table = pq.read_table(outcome.directory / "parameters.parquet").to_pandas()
    return dict(zip(table["parameter"], table["sigma"], strict=True))


def test_the_simulated_project_declares_the_correlation_and_its_truth_fits(delivered: Path) -> None:
    project = load_project(delivered / "project.toml")
    assert project.adjustment.gnss_correlation_s == 30.0
    assert project.adjustment.ins_correlation_s == 40.0
    assert project.inputs.exposures[0].sigma.position_m == pytest.approx((0.05, 0.05, 0.05))
    assert project.inputs.exposures[0].sigma.attitude_deg == pytest.approx((0.003, 0.003, 0.008))
    outcome = run(delivered)
    assert outcome.error is None, outcome.error
    assert compare_with_truth(delivered, outcome.directory).contradictions() == ()
    rows = dict(outcome.summary.to_json())["correlation_times"]
    assert [(row["group"], row["stated_s"], row["correlation_s"], row["verdict"]) for row in rows] == [
        ("gnss_positions", 30.0, 30.0, "stated"),
        ("ins_attitudes", 40.0, 40.0, "stated"),
    ]


def test_leaving_the_correlation_out_promises_too_much(delivered: Path) -> None:
    right = sigmas(run(delivered))
    text = (delivered / "project.toml").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if "correlation_s" not in line]
    assert len(lines) == len(text.splitlines()) - 2
    (delivered / "project.toml").write_text("\n".join(lines), encoding="utf-8")
    outcome = run(delivered)
    assert dict(outcome.summary.to_json())["correlation_times"] is None
    white = sigmas(outcome)
    for parameter in ("boresight_roll", "boresight_pitch", "gnss_shift_x", "gnss_shift_y"):
        assert white[parameter] < 0.8 * right[parameter], parameter


def test_correlation_times_and_divisions_of_what_the_adjustment_does_not_use_are_named(
    delivered: Path,
) -> None:
    def named(*overrides: str) -> list[str]:
        outcome = run(delivered, 'adjustment.variance_components_by=["flight"]', *overrides)
        assert outcome.error is None, outcome.error
        return [text for text in outcome.summary.problems if "has no effect" in text]

    divided = (
        "adjustment.variance_components_by has no effect on the adjustment: variance components are not "
        "estimated (adjustment.variance_components)."
    )
    assert named() == [divided]
    assert named('adjustment.observe=["control"]', "adjustment.free=[]") == [
        "adjustment.gnss_correlation_s has no effect on the adjustment: no GNSS positions are observed.",
        "adjustment.ins_correlation_s has no effect on the adjustment: no INS attitudes are observed.",
        divided,
    ]
    assert named("adjustment.variance_components=true") == []


def test_estimated_correlation_times_are_reported_with_their_limits(delivered: Path) -> None:
    """From wrong times the true ones are found, and it is said that the stated ones are wrong.

    Of two 95 % intervals one misses in every tenth block, and this is one block; how often they hold the
    truth is counted in tests/adjust/test_correlated_monte_carlo.py. Here they are 99 % intervals.
    """
    outcome = run(
        delivered,
        "adjustment.gnss_correlation_s=5",
        "adjustment.ins_correlation_s=200",
        "adjustment.variance_components=true",
        "adjustment.estimate_correlation=true",
        "adjustment.confidence=0.99",
    )
    assert outcome.error is None, outcome.error
    rows = {row["group"]: row for row in dict(outcome.summary.to_json())["correlation_times"]}
    for group, truth, stated in (("gnss_positions", 30.0, 5.0), ("ins_attitudes", 40.0, 200.0)):
        row = rows[group]
        assert row["verdict"] == "estimated", row
        assert row["lower_s"] < truth < row["upper_s"], row
        assert row["lower_s"] < row["correlation_s"] < row["upper_s"], row
        assert not row["lower_s"] < stated < row["upper_s"], row
        said = f"the errors of {group.replace('_', ' ')} is {row['correlation_s']:.3g} s"
        sentences = [text for text in outcome.summary.problems if said in text]
        assert len(sentences) == 1, outcome.summary.problems
        assert f"not {stated:.3g} s as stated; the adjustment uses it." in sentences[0]


@pytest.mark.parametrize(
    ("column", "message"),
    [("time", "The exposures have no times"), ("strip", "The exposures contain no strips")],
)
def test_without_times_or_strips_a_correlation_is_refused(delivered: Path, column: str, message: str) -> None:
    change(delivered / "exposures.csv", lambda table: table.assign(**{column: ""}))
    outcome = run(delivered)
    assert message in str(outcome.error)
    assert "gnss_correlation_s" in str(outcome.error)


def test_a_correlation_without_effect_needs_no_times(delivered: Path) -> None:
    change(delivered / "exposures.csv", lambda table: table.assign(time=""))
    outcome = run(delivered, 'adjustment.observe=["control"]', "adjustment.free=[]")
    assert outcome.error is None, outcome.error
    assert sum("has no effect on the adjustment" in text for text in outcome.summary.problems) == 2


def test_an_attitude_without_time_is_named_whether_there_is_a_position_or_not(delivered: Path) -> None:
    def one_empty(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[3, ["x", "y", "z", "time"]] = ""
        return table

    change(delivered / "exposures.csv", one_empty)
    said = str(run(delivered).error)
    assert said.startswith("adjustment.ins_correlation_s: 1 of ")
    assert "exposures have no time (the first is" in said


def test_an_exposure_without_time_is_named(delivered: Path) -> None:
    def one_empty(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[3, "time"] = ""
        return table

    change(delivered / "exposures.csv", one_empty)
    names = pd.read_csv(delivered / "exposures.csv", dtype=str)["image"]
    outcome = run(delivered)
    assert f"1 of {len(names)} exposures have no time (the first is {names[3]})" in str(outcome.error)


@pytest.mark.parametrize("later_s", [0.0, 2e-5])
def test_two_exposures_of_a_strip_at_the_same_time_are_refused_by_name(
    delivered: Path, later_s: float
) -> None:
    def same_time(table: pd.DataFrame) -> pd.DataFrame:
        rows = table.index[table["strip"] == table["strip"].iloc[0]]
        table.loc[rows[1], "time"] = f"{float(table.loc[rows[0], 'time']) + later_s:.6f}"
        table.loc[rows[0], "time"] = f"{float(table.loc[rows[0], 'time']):.6f}"
        return table

    change(delivered / "exposures.csv", same_time)
    names = pd.read_csv(delivered / "exposures.csv", dtype=str)["image"]
    outcome = run(delivered)
    assert f"Images {names[0]} and {names[1]}" in str(outcome.error)
    assert "same time" in str(outcome.error)
