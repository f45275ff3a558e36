"""`aerocal calibrate` on delivered orientations alone: no image points, no control, no certificate."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adjust.camera.interior import nominal_mounting
from adjust.geometry import rotation
from flows.command.result_table import result_table
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from flows.stories.system_calibration import system_calibration
from tasks.results.publish import OF_EVERY_TWO_STEP_CALIBRATION
from tests.flows.refused_at_start import require_refused_at_start
from tests.tasks.documents.report.page_reader import Page

PROJECT = """\
version = 1
[project]
name = "two days"
crs = "local"
heights = "ellipsoidal"
[cameras.CAM]
columns = 10000
rows = 8000
pixel_um = 5.0
focal_length_mm = 100.0
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 90
lever_arm_m = [0.4, 0.0, -1.1]
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
position = "antenna"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
[calibration.adjusted]
file = "adjusted.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
position = "projection_centre"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
"""
BORESIGHT_DEG = (0.02, -0.03, 0.05)
LEVER_ARM = (0.4, 0.0, -1.1)
SHIFTS = ((0.25, -0.1, 0.05), (-0.15, 0.2, 0.1))
STRIPS_OF_DAY, PER_STRIP = 8, 12
_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def delivered(
    folder: Path, remounted_deg: float = 0.0, project: str = PROJECT, headings: Any = (0, 180)
) -> Path:
    """Two days of strips; between them the roll of the camera changes. Strips err by 0.0005° and 1 cm."""
    random = np.random.default_rng(11)
    rows: dict[str, list[dict[str, object]]] = {"exposures": [], "adjusted": []}
    mount = nominal_mounting(90)
    for strip in range(2 * STRIPS_OF_DAY):
        day = strip // STRIPS_OF_DAY
        heading = np.deg2rad(headings[strip % len(headings)])
        turned = np.deg2rad(random.normal(0.0, 0.0005, 3))
        moved = random.normal(0.0, 0.01, 3)
        boresight = np.deg2rad([BORESIGHT_DEG[0] + day * remounted_deg, *BORESIGHT_DEG[1:]])
        for number in range(PER_STRIP):
            attitude = np.array([heading, *np.deg2rad(random.normal(0.0, 1.0, 2))])
            body = _ENU_FROM_NED @ rotation.ned_from_body(attitude)
            camera = body @ rotation.from_roll_pitch_yaw(boresight) @ rotation.exp(turned) @ mount
            centre = np.array([500.0 * strip, 300.0 * number, 2000.0])
            antenna = centre + body @ LEVER_ARM + SHIFTS[day] + moved
            of_image = {
                "image": f"{strip:02}_{number:02}",
                "camera": "CAM",
                "strip": f"S{strip:02}",
                "flight": f"day {day + 1}",
            }
            for name, position, matrix in (
                ("exposures", antenna, body @ mount),
                ("adjusted", centre, camera),
            ):
                angles = np.rad2deg(rotation.to_omega_phi_kappa(matrix))
                six = dict(zip(("x", "y", "z", "omega", "phi", "kappa"), (*position, *angles), strict=True))
                rows[name].append(of_image | six)
    for name, own in rows.items():
        pd.DataFrame(own).to_csv(folder / f"{name}.csv", index=False, float_format="%.9f")
    (folder / "project.toml").write_text(project, encoding="utf-8")
    return folder / "project.toml"


def run(project: Path, *overrides: str) -> RunOutcome:
    return carry_out(system_calibration, RunRequest(project, None, overrides))


def figures(outcome: RunOutcome) -> dict[str, Any]:
    content = json.loads((outcome.directory / "summary.json").read_text())
    assert isinstance(content, dict)
    return content


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    outcome = run(delivered(tmp_path_factory.mktemp("one-mounting")))
    assert outcome.error is None, outcome.error
    return outcome


@pytest.fixture(scope="module")
def remounted(tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    outcome = run(delivered(tmp_path_factory.mktemp("remounted"), 0.004))
    assert outcome.error is None, outcome.error
    return outcome


@pytest.fixture
def calibrated_project(accepted: RunOutcome, tmp_path: Path) -> Path:
    """The project file of a copy of that calibration with its results."""
    return shutil.copytree(accepted.directory.parent, tmp_path / "copy") / "project.toml"


def test_boresight_and_shift_come_out_and_the_verdict_says_what_does_not(accepted: RunOutcome) -> None:
    found = figures(accepted)["two_step_calibration"]
    assert (accepted.summary.status, found["verdict"], found["reasons"]) == ("done", "accepted", [])
    assert "no certificate of the interior orientation" in found["sentence"]
    values = {item["parameter"]: item for item in found["parameters"]}
    for name, true in zip(("roll", "pitch", "yaw"), BORESIGHT_DEG, strict=True):
        item = values[f"boresight_{name}"]
        assert item["verdict"] == "determined"
        assert abs(item["value"] - true) < 4.0 * item["sigma"] < 0.001
    assert values["lever_arm_x"]["verdict"] == "not_called_for"


def test_no_record_and_no_certificate_are_written(accepted: RunOutcome) -> None:
    names = {path.name for path in accepted.directory.iterdir() if not path.name.startswith(".")}
    assert names == {
        "cameras.parquet",
        "exposures.parquet",
        "orientation_differences.parquet",
        "orientation_difference_means.parquet",
        "report.html",
        "summary.json",
        "manifest.json",
    }


def test_the_shift_of_each_day_is_its_own(accepted: RunOutcome) -> None:
    means = pd.read_parquet(accepted.directory / "orientation_difference_means.parquet")
    flights = means[means["scope"] == "flight"].set_index(["group", "component"])["value"]
    for day, shift in enumerate(SHIFTS):
        found = flights.loc[f"day {day + 1}"]
        np.testing.assert_allclose(found[["east", "north", "up"]], shift, atol=0.015)
    tests = {item["tested"]: item for item in figures(accepted)["two_step"][0]["tests"]}
    assert tests["shift_by_flight"]["probability"] < 1e-4
    assert tests["lever_arm_by_flight"]["probability"] > 1e-3
    assert any(
        "GNSS shift of camera CAM differs from flight to flight" in p for p in accepted.summary.problems
    )


def test_a_camera_remounted_by_four_millidegrees_is_named_with_its_strips(remounted: RunOutcome) -> None:
    found = figures(remounted)
    (other,) = found["two_step"][0]["other_mountings"]
    assert other["strips"] == [f"S{number:02}" for number in range(8, 16)]
    assert other["boresight_deg"][0] == pytest.approx(BORESIGHT_DEG[0] + 0.004, abs=0.0008)
    assert other["boresight_sigma_deg"][0] < 0.0005
    assert found["two_step_calibration"]["verdict"] == "restricted"
    assert any("not flown with one mounting" in text for text in remounted.summary.problems)
    assert any("Strips S08, S09" in text for text in remounted.summary.problems)
    assert remounted.summary.status == "done"


def test_in_one_direction_lever_arm_and_shift_are_not_told_apart(tmp_path: Path) -> None:
    found = figures(run(delivered(tmp_path, headings=(30,))))
    assert found["two_step"][0]["offset_fixed_in"] == "undecided"
    verdicts = {item["parameter"]: item["verdict"] for item in found["two_step_calibration"]["parameters"]}
    assert {verdicts[f"{name}_{axis}"] for name in ("lever_arm", "gnss_shift") for axis in "xy"} == {
        "not_determinable"
    }
    assert found["two_step_calibration"]["verdict"] == "restricted"


def test_a_boresight_beyond_its_limit_is_refused(calibrated_project: Path) -> None:
    outcome = run(calibrated_project, "calibration.limits.roll_pitch_deg=0.00005")
    assert outcome.summary.status == "gate_failed"
    assert "The calibration is refused: boresight_roll of CAM is weak" in outcome.summary.problems[0]


def test_a_gate_of_the_adjustment_is_left_to_one(calibrated_project: Path) -> None:
    outcome = run(calibrated_project, "gates.sigma0={max=1.2}")
    assert outcome.summary.status == "done"
    assert any("sigma0 is not tested" in text for text in outcome.summary.problems)


def test_an_edited_report_is_refused_before_anything_is_computed(calibrated_project: Path) -> None:
    require_refused_at_start(
        calibrated_project.parent / "results", "report.html", OF_EVERY_TWO_STEP_CALIBRATION,
        lambda: run(calibrated_project),
    )  # fmt: skip


def test_the_report_shows_means_tests_and_strips(remounted: RunOutcome) -> None:
    page = Page((remounted.directory / "report.html").read_text(encoding="utf-8"))
    (camera,) = figures(remounted)["two_step"]
    means = page.tables["two-step-boresights"]
    assert means.keys == [
        f"CAM@{name}"
        for name in ("mounting 0", "mounting 1", "flight day 1 (mounting 0)", "flight day 2 (mounting 1)")
    ]
    for mounting in camera["mountings"]:
        shown = means.numbers[f"CAM@mounting {mounting['mounting']}", "roll"]
        assert float(shown.data) == mounting["boresight_deg"][0]
    assert "S08" in page.tables["two-step-mountings"].texts["CAM@mounting 1"][-1]
    tests = page.tables["two-step-tests"]
    for item in camera["tests"]:
        if item["probability"] is not None:
            assert float(tests.numbers[f"CAM@{item['tested']}", "probability"].data) == item["probability"]
    assert camera["offset_sentence"] in page.text
    assert "no certificate of the interior orientation" in page.text


def test_the_screen_says_it_too(remounted: RunOutcome, capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    Console(width=200).print(result_table(remounted))
    shown = capsys.readouterr().out
    assert "The two-step calibration is accepted with restrictions." in shown
    assert "boresight_roll" in shown
    assert "σ0" not in shown


def test_without_image_points_nothing_else_is_computed(tmp_path: Path) -> None:
    outcome = carry_out(aerial_triangulation, RunRequest(delivered(tmp_path)))
    assert outcome.summary.status == "input_error"
    assert "There are no image points" in str(outcome.error)


def test_a_project_with_nothing_to_adjust_is_one_message(tmp_path: Path) -> None:
    project = delivered(tmp_path, project=PROJECT[: PROJECT.index("[calibration.adjusted]")])
    outcome = run(project)
    assert outcome.summary.status == "input_error"
    assert "no image points" in str(outcome.error)
    assert "calibration.adjusted" in str(outcome.error)


@pytest.mark.parametrize("key", ["offset_m", "misalignment_deg"])
def test_the_sizes_that_no_longer_act_are_unknown(tmp_path: Path, key: str) -> None:
    outcome = run(delivered(tmp_path), f"calibration.mounting.{key}=0.1")
    assert outcome.summary.status == "input_error"
    assert key in str(outcome.error)
