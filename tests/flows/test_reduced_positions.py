"""Positions of the antenna, of the projection centre and of both give the same block: `position` is heard."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.geometry import rotation
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.block.given_orientations import GivenOrientations, Mountings
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

ARM = (0.8, -0.3, -1.2)
FLIGHT = ("points.count=250", "points.detection=0.7", f"truth.lever_arm_m={list(ARM)}")
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
HELD = 'adjustment.free=["boresight", "gnss_shift"]'
STATED = f"cameras.UCE-80.lever_arm_m={list(ARM)}"


@pytest.fixture(scope="module")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("positions")
    simulate_project(load_simulation("uce-high", FLIGHT), folder)
    table = pd.read_csv(folder / "exposures.csv")
    angles = np.deg2rad(table[["heading", "pitch", "roll"]].to_numpy(np.float64))
    arm = NED @ rotation.ned_from_body(angles) @ np.array(ARM)
    reduced = table.assign(**{axis: table[axis] - arm[:, k] for k, axis in enumerate("xyz")})
    reduced.to_csv(folder / "reduced.csv", index=False)
    half = np.arange(len(table)) % 2 == 0
    table[half].to_csv(folder / "half.csv", index=False)
    reduced[~half].to_csv(folder / "reduced_half.csv", index=False)
    return folder


def exposures(file: str, position: str) -> str:
    sigma = "{position_m=0.05, attitude_deg=[0.003, 0.003, 0.008]}"
    angles = '{order="heading-pitch-roll", unit="deg", reference="true-north"}'
    return (
        f'{{file="{file}", format="csv", crs="local", heights="ellipsoidal", position="{position}", '
        f"angles={angles}, sigma={sigma}}}"
    )


def run(delivery: Path, out: str, *inputs: tuple[str, str], more: tuple[str, ...] = ()) -> RunOutcome:
    stated = ", ".join(exposures(*item) for item in inputs)
    changes = (f"inputs.exposures=[{stated}]", STATED, *more)
    return carry_out(adjustment_alone, RunRequest(delivery / "project.toml", delivery / out, changes))


def test_what_was_reduced_is_undone_whatever_is_mixed(delivery: Path) -> None:
    found = {}
    for name, inputs in {
        "antenna": (("exposures.csv", "antenna"),),
        "imu": (("exposures.csv", "imu"),),
        "reduced": (("reduced.csv", "projection_centre"),),
        "mixed": (("half.csv", "antenna"), ("reduced_half.csv", "projection_centre")),
    }.items():
        outcome = run(delivery, name, *inputs)
        assert outcome.error is None, outcome.error
        summary = json.loads((outcome.directory / "summary.json").read_text())
        parameters = pd.read_parquet(outcome.directory / "parameters.parquet")
        centres = pd.read_parquet(outcome.directory / "exterior_orientations.parquet")
        found[name] = (summary["sigma0"], parameters, centres)
    sigma0, parameters, centres = found["antenna"]
    assert sigma0 == pytest.approx(1.0, abs=0.05)
    for name in ("imu", "reduced", "mixed"):
        assert found[name][0] == pytest.approx(sigma0, rel=1e-6)
        np.testing.assert_allclose(found[name][1]["value"], parameters["value"], rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(found[name][2]["z_m"], centres["z_m"], atol=1e-4)


def test_a_lever_arm_that_was_calibrated_on_reduced_positions_is_applied(delivery: Path) -> None:
    """As the registry gives it: the delivery was reduced by none, and all of the arm is left over."""
    left = ("cameras.UCE-80.reduced_by_m=[0,0,0]", HELD)
    known = run(delivery, "known", ("exposures.csv", "projection_centre"), more=left)
    antenna = run(delivery, "held", ("exposures.csv", "antenna"), more=(HELD,))
    for outcome in (known, antenna):
        assert outcome.error is None, outcome.error
    found, expected = (
        json.loads((outcome.directory / "summary.json").read_text())["sigma0"] for outcome in (known, antenna)
    )
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_wrong_word_for_the_position_is_noticed(delivery: Path) -> None:
    """The arm is taken off twice: the tests of the model name it."""
    outcome = run(delivery, "wrong", ("reduced.csv", "antenna"), more=(HELD,))
    assert outcome.error is None
    assert any(
        "lever arm" in text.lower() or "shifted against" in text for text in outcome.summary.problems
    ), outcome.summary.problems


def test_antenna_and_imu_in_one_project_are_refused(delivery: Path) -> None:
    outcome = run(delivery, "both", ("half.csv", "antenna"), ("reduced_half.csv", "imu"))
    assert outcome.summary.status == "input_error"
    assert "antenna, others that of the IMU" in str(outcome.error)


def test_the_antenna_of_a_body_that_turns_is_faster_than_the_projection_centre(delivery: Path) -> None:
    """By ω × l: 1.5 cm/s at 1 °/s about an axis 0.85 m away."""
    outcome = run(delivery, "turning", ("reduced.csv", "projection_centre"))
    tables = [pd.read_parquet(outcome.directory / f"{name}.parquet") for name in ("exposures", "cameras")]
    exposures, mountings = tables[0], Mountings.from_table(tables[1])
    project = load_project(delivery / "project.toml").project
    map_frame = MapFrame.of(project.crs, project.heights)
    frame = local_frame(map_frame, exposures[["x_m", "y_m", "z_m"]].to_numpy(np.float64))
    flown = dict.fromkeys(("velocity_east_m_s", "velocity_north_m_s", "velocity_up_m_s"), 50.0)
    turning = dict.fromkeys(("rate_roll_deg_s", "rate_pitch_deg_s"), 0.0) | {"rate_yaw_deg_s": 1.0}
    given = GivenOrientations.from_tables(exposures.assign(**flown, **turning), mountings, map_frame, frame)
    faster = given.velocity - np.einsum("nij,j->ni", given.local_from_enu, np.full(3, 50.0))
    # About the axis down: ω × l = ω (−l_right, l_forward, 0) in the axes of the body.
    expected = np.deg2rad(1.0) * given.local_from_body() @ np.array([-ARM[1], ARM[0], 0.0])
    np.testing.assert_allclose(faster, expected, atol=1e-9)
    assert np.linalg.norm(faster, axis=1) == pytest.approx(0.0149, abs=1e-4)
