"""Two-step calibration of 2,739 images of IGN France: adjusted by IGN against GNSS/INS.

Expected values: README.md of the data folder, worked out there with independent scripts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.settings.inputs import ExposuresInput
from tasks.settings.load import load_project
from tasks.stages.ingest import import_exposures
from tasks.stages.two_step import calibrate_in_two_steps
from tasks.store.notes import read_notes
from tasks.store.store import Store
from tasks.tables.parquet import read_table

PROJECT = Path(__file__).resolve().parents[2] / "examples" / "ign_ultracam_eagle" / "project.toml"
OTHER_MOUNTING = ["x00030", "x00032", "x00040"]


@pytest.fixture(scope="module")
def calibrated(test_data: Path, tmp_path_factory: pytest.TempPathFactory):
    return calibration(test_data, tmp_path_factory.mktemp("two-step"))


def calibration(test_data: Path, folder: Path, *overrides: str):
    """Outputs of the stage for the project with some settings changed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_TEST_DATA", str(test_data))
        project = load_project(PROJECT, overrides)
    delivered = {
        "file": test_data / "ign_ultracam_eagle_m3" / "21FD2447_alt_s07.OPK",
        "format": "ign-opk",
        "crs": "EPSG:2154",
        "heights": {
            "geoid": test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif",
            "linear_alteration": {"ground_m": 205.0},
        },
        "position": "projection_centre",
        "angles": {"order": "omega-phi-kappa", "unit": "deg", "reference": "grid"},
    }
    store = Store.of(folder)
    common = {"cameras": project.cameras, "project": project.project}
    observed = import_exposures(store, sources=project.inputs.exposures, **common)
    adjusted = import_exposures(store, sources=(ExposuresInput.model_validate(delivered),), **common)
    return calibrate_in_two_steps(
        store,
        exposures=observed["exposures"],
        adjusted=adjusted["exposures"],
        cameras=observed["cameras"],
        project=project.project,
        mounting=project.calibration.mounting,
        limits=project.calibration.limits,
        strip_bias_m=project.adjustment.priors.gnss_strip_bias_m,
    )


@pytest.fixture(scope="module")
def figures(calibrated) -> dict:
    (camera,) = read_notes(calibrated["notes"]).figures["two_step"]
    return camera


@pytest.fixture(scope="module")
def means(calibrated) -> pd.DataFrame:
    table = read_table(calibrated["orientation_difference_means"])
    return table.set_index(["scope", "group", "component"]).sort_index()


def test_every_adjusted_image_of_the_camera_takes_part(figures) -> None:
    assert (figures["camera"], figures["images"], figures["strips"]) == ("UCE-M3-f120-s07", 2739, 25)


def test_boresight_in_camera_axes_is_that_of_the_independent_script(figures) -> None:
    found = figures["adjusted_minus_observed_in_camera_axes"]
    plain, robust = (np.array(found[name]["rotation_deg"]) for name in ("all_plain", "all_robust"))
    np.testing.assert_allclose(plain, [-0.0061, 0.0000, -0.0027], atol=0.0003)
    np.testing.assert_allclose(robust, plain, atol=0.001)


def test_offset_in_camera_axes_is_that_of_the_main_strips(figures) -> None:
    x, y, _ = figures["adjusted_minus_observed_in_camera_axes"]["main_robust"]["offset_m"]
    assert x == pytest.approx(0.34, abs=0.01)
    assert 0.60 <= y <= 0.65


def test_boresight_and_lever_arm_in_body_axes(figures) -> None:
    """Forward is −y of the image (κ_mount 90°): roll, pitch, yaw and forward, right."""
    np.testing.assert_allclose(figures["boresight_deg"], [0.000, 0.006, 0.003], atol=0.001)
    np.testing.assert_allclose(figures["lever_arm_m"][:2], [0.61, 0.34], atol=0.01)


def test_three_strips_are_reported_as_another_mounting(calibrated, figures) -> None:
    (other,) = figures["other_mountings"]
    assert other["strips"] == OTHER_MOUNTING
    x, y, _ = other["adjusted_minus_observed_in_camera_axes"]["offset_m"]
    assert x == pytest.approx(-0.08, abs=0.01)
    assert 0.33 <= y <= 0.37
    assert figures["images_of_main_mounting"] == 2739 - other["images"]
    (remark,) = (text for text in read_notes(calibrated["notes"]).problems if "another mounting" in text)
    assert ", ".join(OTHER_MOUNTING) in remark


def test_scatter_inside_the_strips_is_one_centimetre(means) -> None:
    for component in ("forward", "right"):
        inside = means.xs(("strip", component), level=("scope", "component"))["rms"]
        assert inside.between(0.005, 0.02).all()


def test_the_offset_turns_with_the_aircraft(figures) -> None:
    assert figures["offset_fixed_in"] == "body"
    assert figures["offset_rms_body_m"] < 0.02
    assert figures["offset_rms_map_m"] > 0.6
    tests = {item["tested"]: item for item in figures["tests"]}
    assert tests["lever_arm"]["probability"] < 1e-20
    assert tests["shift"]["probability"] > 0.1
    np.testing.assert_allclose(figures["separated"]["shift_m"], 0.0, atol=0.005)


def test_the_other_mounting_is_one_of_the_lever_arm_not_of_the_boresight(figures) -> None:
    tests = {item["tested"]: item["probability"] for item in figures["tests"]}
    assert tests["lever_arm_by_mounting"] < 1e-20
    assert all(tests[f"{name}_by_mounting"] > 0.01 for name in ("roll", "pitch", "yaw"))


def test_the_heading_of_the_ins_drifts_from_strip_to_strip(calibrated, means) -> None:
    yaw = means.xs(("strip", "yaw"), level=("scope", "component"))
    # IGN's strips, as adjusted − observed about the camera's z axis: −0.017 … +0.0035°.
    assert -yaw["value"].max() == pytest.approx(-0.017, abs=0.001)
    assert -yaw["value"].min() == pytest.approx(0.0035, abs=0.001)
    assert yaw.loc["x00021", "drift"] == pytest.approx(-0.029, abs=0.002)
    assert any(
        "x00021: the yaw of the INS drifts" in text for text in read_notes(calibrated["notes"]).problems
    )


def test_three_directions_and_one_flying_height_are_recognised(means) -> None:
    groups = means.reset_index().groupby("scope")["group"].unique()
    assert sorted(groups["heading"]) == ["157 deg", "337 deg", "64 deg"]
    assert len(groups["height"]) == 1


def test_differences_of_the_images_average_to_the_means(calibrated, means) -> None:
    images = read_table(calibrated["orientation_differences"])
    assert len(images) == 2739
    plain = means.loc[("all", "all", "forward"), "value_plain"]
    assert images["forward_m"].mean() == pytest.approx(plain, abs=1e-12)
    assert images.loc[images["strip"].isin(OTHER_MOUNTING), "mounting"].eq(1).all()


#: What the reduction left over is the arm of the point that was delivered.
ANTENNA = "inputs.exposures.position=antenna"


@pytest.mark.parametrize(("given", "named"), [("[-0.61,-0.34,0.37]", True), ("[0.61,0.34,0.37]", False)])
def test_a_lever_arm_given_the_wrong_way_round_is_named(
    test_data: Path, tmp_path: Path, given: str, named: bool
) -> None:
    outputs = calibration(test_data, tmp_path, f"cameras.UCE-M3-f120-s07.lever_arm_m={given}", ANTENNA)
    remarks = [text for text in read_notes(outputs["notes"]).problems if "wrong sign" in text]
    assert len(remarks) == named
    assert all("along forward and right" in text for text in remarks)
