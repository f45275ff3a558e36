"""Deliveries without GNSS and control, from the project file to the report."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

ALONE = ("adjustment.observe=[]", "adjustment.free=[]")
FREE = 'adjustment.datum="free_network"'
SEVEN = [
    *(f"shift in {axis}" for axis in "xyz"),
    *(f"rotation about {axis}" for axis in "xyz"),
    "scale",
]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """28 images in crossing strips, 84 control points, with the results of an adjustment in their datum."""
    folder = tmp_path_factory.mktemp("flight")
    simulate_project(load_simulation("uce-high", ("points.count=600",)), folder)
    run(folder)
    return folder


@pytest.fixture
def delivered(flight: Path, tmp_path: Path) -> Path:
    """A copy, to be changed: what a test's own run does not change is not computed again."""
    return Path(shutil.copytree(flight, tmp_path / "project"))


def run(project: Path, *overrides: str, story: Story = adjustment_alone) -> RunOutcome:
    outcome = carry_out(story, RunRequest(project / "project.toml", overrides=overrides))
    assert outcome.error is None, outcome.error
    return outcome


def figure(outcome: RunOutcome, name: str) -> object:
    return json.loads((outcome.directory / "summary.json").read_text())[name]


def normalized_after_similarity(project: Path, outcome: RunOutcome, turned_about: str) -> np.ndarray:
    """(Adjusted − true)/σ of the object points after the movement that fits them best.

    turned_about: "xyz" with a change of scale; "z" in plan only.
    """
    truth = pd.read_parquet(project / "truth" / "object_points.parquet").set_index("point")
    found = pd.read_parquet(outcome.directory / "object_points.parquet").set_index("point")
    x = found[["x_m", "y_m", "z_m"]].to_numpy(copy=True)
    true = truth.loc[found.index, ["x_m", "y_m", "z_m"]].to_numpy()
    sigma = found[["sigma_x_m", "sigma_y_m", "sigma_z_m"]].to_numpy()
    if turned_about == "z":
        x[:, :2] = fitted(x[:, :2], true[:, :2], with_scale=False)
    else:
        x = fitted(x, true, with_scale=True)
    return np.asarray((x - true) / sigma)


def fitted(x: np.ndarray, true: np.ndarray, with_scale: bool) -> np.ndarray:
    """Points x moved onto the true ones by shift, rotation and scale (Umeyama 1991)."""
    centred, true_centred = x - x.mean(axis=0), true - true.mean(axis=0)
    u, sizes, v = np.linalg.svd(true_centred.T @ centred)
    scale = sizes.sum() / np.sum(centred**2) if with_scale else 1.0
    return np.asarray(true.mean(axis=0) + scale * centred @ (u @ v).T)


def test_image_points_alone_give_a_network_that_is_true_up_to_a_similarity(delivered: Path) -> None:
    outcome = run(delivered, *ALONE, FREE)
    free = {"inner_constraints": "object_points", "defect": 7, "open": SEVEN}
    assert figure(outcome, "free_network") == free
    assert outcome.summary.sigma0 == pytest.approx(1.0, abs=0.05)
    assert outcome.summary.problems[0].startswith(
        "Free network: the observations do not determine 7 directions"
    )
    error = normalized_after_similarity(delivered, outcome, "xyz")
    # Errors of one block are correlated; 600 points pin the mean to some per cent.
    assert np.mean(error**2) == pytest.approx(1.0, abs=0.15)


def test_the_report_says_what_the_datum_is(delivered: Path) -> None:
    centres = 'adjustment.inner_constraints="projection_centres"'
    outcome = run(delivered, *ALONE, FREE, centres, story=aerial_triangulation)
    html = (outcome.directory / "report.html").read_text(encoding="utf-8")
    assert "The free network is adjusted" in html
    assert "approximate values of the projection centres" in html
    assert "redundancy n − u + 7" in html


def test_height_control_leaves_plan_position_and_azimuth_to_the_approximate_values(delivered: Path) -> None:
    control = pd.read_csv(delivered / "control.csv", dtype=str, keep_default_na=False)
    control.assign(x="", y="").to_csv(delivered / "control.csv", index=False)
    outcome = run(delivered, 'adjustment.observe=["control"]', "adjustment.free=[]", FREE)
    free = figure(outcome, "free_network")
    assert isinstance(free, dict)
    assert free["open"] == ["shift in x", "shift in y", "rotation about z"]
    error = normalized_after_similarity(delivered, outcome, "z")
    # Heights are held by 84 control points; plan errors hang together, as only relief holds the scale.
    assert np.mean(error[:, 2] ** 2) == pytest.approx(1.0, abs=0.3)
    assert np.mean(error[:, :2] ** 2) < 10.8
    assert outcome.summary.sigma0 == pytest.approx(1.0, abs=0.05)


def test_positions_with_a_free_shift_leave_the_block_where_its_approximate_values_are(
    delivered: Path,
) -> None:
    outcome = run(delivered, 'adjustment.observe=["gnss","ins"]', 'adjustment.free=["gnss_shift"]', FREE)
    free = figure(outcome, "free_network")
    assert isinstance(free, dict)
    assert free["defect"] == 3
    assert all("together with gnss_shift" in text for text in free["open"])


def test_a_datum_that_the_observations_determine_is_theirs(delivered: Path) -> None:
    ordinary = run(delivered)
    assert figure(ordinary, "free_network") is None
    adjusted = (ordinary.directory / "object_points.parquet").read_bytes()
    asked = run(delivered, FREE)
    assert (asked.directory / "object_points.parquet").read_bytes() == adjusted
    assert any("determine the whole datum" in text for text in asked.summary.problems)


def test_an_open_datum_names_the_setting(delivered: Path) -> None:
    outcome = carry_out(adjustment_alone, RunRequest(delivered / "project.toml", overrides=ALONE))
    assert outcome.summary.status == "not_computable"
    assert FREE.replace("=", " = ") in str(outcome.error)


def test_where_the_setting_would_not_help_it_is_not_named(delivered: Path) -> None:
    outcome = carry_out(
        adjustment_alone,
        RunRequest(delivered / "project.toml", overrides=('adjustment.observe=["gnss","control"]',)),
    )
    assert outcome.summary.status == "not_computable"
    assert "free_network" not in str(outcome.error)
