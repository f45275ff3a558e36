"""Heads of rigs whose images have no readings of their own: those of their event, or none at all."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth
from tests.flows.adjustment_alone import adjustment_alone

PLACE = ("project.crs=EPSG:25832", "project.latitude_deg=48.9", "project.longitude_deg=8.9")
POSITIONS, OPK = ["x", "y", "z"], ["omega", "phi", "kappa"]
Copy = Callable[[Path], Path]


@pytest.fixture
def copied(tmp_path: Path) -> Copy:
    """A copy of a delivery, to be changed."""
    return lambda project: Path(shutil.copytree(project, tmp_path / "project"))


@pytest.fixture(scope="module")
def penta(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fifteen exposures of a nadir head and four that are tilted by 45°."""
    changes = ("flight.lines=3", "flight.exposures=5", "points.count=500", *PLACE)
    folder = tmp_path_factory.mktemp("penta")
    simulate_project(load_simulation("penta", changes, 2), folder)
    return folder


@pytest.fixture(scope="module")
def dmc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fifteen exposures of four heads; the platform takes no pictures and is mounted otherwise."""
    changes = ("flight.lines=3", "flight.exposures=5", "points.count=450", "project.angles=omega-phi-kappa")
    folder = tmp_path_factory.mktemp("dmc")
    simulate_project(load_simulation("dmc-heads", (*changes, *PLACE)), folder)
    return folder


def run(project: Path, *overrides: str) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(project / "project.toml", overrides=overrides))


def emptied(project: Path, columns: list[str], but: str = "") -> None:
    """Empty columns of the exposures, except those of one camera."""
    table = pd.read_csv(project / "exposures.csv", dtype=str, keep_default_na=False)
    table.loc[table["camera"] != but, columns] = ""
    table.to_csv(project / "exposures.csv", index=False)


def assert_true(project: Path, outcome: RunOutcome, images: int) -> None:
    assert outcome.error is None, outcome.error
    assert outcome.summary.counts.images == images
    comparison = compare_with_truth(project, outcome.directory)
    assert comparison.joint is not None
    assert comparison.joint.probability > 1e-3
    # Fifteen events have much in common: a shift of the block is one draw for all positions.
    assert all(kind.pooled < 2.0 for kind in comparison.kinds)


def events_with(outcome: RunOutcome, group: str) -> int:
    residuals = pd.read_parquet(outcome.directory / "residuals.parquet")
    return int(residuals.loc[residuals["group"] == group, "image"].nunique())


def test_tilted_heads_without_attitudes_are_oriented_by_their_image_points(penta: Path, copied: Copy) -> None:
    """What is found is the orientation of the image; the tilt of the head must not be added once more."""
    project = copied(penta)
    emptied(project, ["heading", "pitch", "roll"])
    outcome = run(project, 'adjustment.free=["relative_rotation", "synchronisation_offset"]')
    assert_true(project, outcome, 75)
    assert events_with(outcome, "gnss_positions") == 15
    assert any("75 images were oriented by their image points" in text for text in outcome.summary.problems)


@pytest.fixture(scope="module")
def all_delivered(dmc: Path, tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    """Of the block in which every head delivers its readings."""
    request = RunRequest(dmc / "project.toml", tmp_path_factory.mktemp("all_delivered") / "results")
    return carry_out(adjustment_alone, request)


def test_angles_of_heads_that_are_mounted_otherwise_than_their_platform(
    dmc: Path, all_delivered: RunOutcome
) -> None:
    """κ of heads with mount_deg 90 and 270 are 90° from those of the platform whose attitude they give."""
    assert_true(dmc, all_delivered, 60)


def test_one_head_delivers_the_reading_of_all(dmc: Path, all_delivered: RunOutcome, copied: Copy) -> None:
    directory = all_delivered.directory
    full = pd.read_parquet(directory / "parameters.parquet").set_index(["parameter", "entity"])
    project = copied(dmc)
    emptied(project, [*POSITIONS, *OPK], but="PAN3")
    outcome = run(project)
    assert events_with(outcome, "gnss_positions") == events_with(outcome, "ins_attitudes") == 15
    one = pd.read_parquet(outcome.directory / "parameters.parquet").set_index(["parameter", "entity"])
    assert np.allclose(one["value"], full["value"], rtol=0.0, atol=1e-7)


def test_position_and_attitude_of_an_event_may_be_delivered_with_different_heads(
    dmc: Path, copied: Copy
) -> None:
    project = copied(dmc)
    emptied(project, POSITIONS, but="PAN2")
    emptied(project, OPK, but="PAN4")
    outcome = run(project)
    assert_true(project, outcome, 60)
    assert events_with(outcome, "gnss_positions") == events_with(outcome, "ins_attitudes") == 15


def test_heads_of_a_platform_without_attitudes(dmc: Path, copied: Copy) -> None:
    """Images that too few points join to the others are placed by these, or have the pose of their event."""
    project = copied(dmc)
    emptied(project, OPK)
    outcome = run(project)
    assert outcome.summary.status == "input_error"
    assert "a common rotation of all its heads is not determined" in str(outcome.error)
    assert_true(project, run(project, "adjustment.priors.relative_rotation_deg=[0.01, 0.01, 0.01]"), 60)
