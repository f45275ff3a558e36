"""Images that were given no orientation, or half of one, are oriented by their image points and adjusted."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from adjust.geometry import rotation
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.system_calibration import system_calibration
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth
from tests.close_range import FOCAL_LENGTH_MM, K1, PRINCIPAL_POINT_MM, CloseRange, close_range, write_project
from tests.flows.adjustment_alone import adjustment_alone

POSITIONS = ["x", "y", "z"]
ANGLES = ["heading", "pitch", "roll"]
CONTROL_ALONE = ('adjustment.observe=["control"]', "adjustment.free=[]")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """28 images in crossing strips, 84 control points, in a map projection."""
    folder = tmp_path_factory.mktemp("flight")
    place = ("project.crs=EPSG:25832", "project.latitude_deg=48.9", "project.longitude_deg=8.9")
    simulate_project(load_simulation("uce-high", ("points.count=600", *place)), folder)
    return folder


@pytest.fixture
def delivered(flight: Path, tmp_path: Path) -> Path:
    """A copy of the delivery, to be changed."""
    return Path(shutil.copytree(flight, tmp_path / "project"))


def run(project: Path, *overrides: str) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(project / "project.toml", overrides=overrides))


def assert_true(project: Path, outcome: RunOutcome, images: int = 28) -> None:
    assert outcome.error is None, outcome.error
    assert outcome.summary.counts.images == images
    assert compare_with_truth(project, outcome.directory).contradictions() == ()


def exposures(project: Path) -> pd.DataFrame:
    return pd.read_csv(project / "exposures.csv", dtype=str, keep_default_na=False)


def without_exposures(project: Path) -> None:
    text = (project / "project.toml").read_text()
    start = text.index("[inputs.exposures]")
    end = text.index("[inputs.control]")
    (project / "project.toml").write_text(text[:start] + text[end:])


def groups(outcome: RunOutcome) -> dict[str, int]:
    residuals = pd.read_parquet(outcome.directory / "residuals.parquet")
    return dict(residuals.groupby("group")["image"].nunique())


def test_a_block_without_any_exposure_is_placed_by_its_control(delivered: Path) -> None:
    without_exposures(delivered)
    outcome = run(delivered, *CONTROL_ALONE)
    assert_true(delivered, outcome)
    assert any("28 images were oriented by their image points" in text for text in outcome.summary.problems)


def test_positions_without_attitudes_and_strips(delivered: Path) -> None:
    """As many drones deliver; the positions are observed, attitudes are not."""
    table = exposures(delivered).assign(**dict.fromkeys(ANGLES, ""), strip="").drop(columns="time")
    table.to_csv(delivered / "exposures.csv", index=False)
    outcome = run(delivered, 'adjustment.free=["gnss_shift"]')
    assert_true(delivered, outcome)
    assert groups(outcome) == {"image_points": 28, "gnss_positions": 28, "control_points": 0}


def test_attitudes_without_positions(delivered: Path) -> None:
    exposures(delivered).assign(**dict.fromkeys(POSITIONS, "")).to_csv(
        delivered / "exposures.csv", index=False
    )
    outcome = run(delivered, 'adjustment.free=["boresight"]')
    assert_true(delivered, outcome)
    assert groups(outcome) == {"image_points": 28, "ins_attitudes": 28, "control_points": 0}


def test_a_block_of_which_a_part_was_oriented(delivered: Path) -> None:
    """Every third image has nothing but its name, one has only a position, one is not named at all."""
    table = exposures(delivered)
    table.loc[::3, [*POSITIONS, *ANGLES]] = ""
    table.loc[1, [*ANGLES, "strip"]] = ""
    table.drop(index=2).to_csv(delivered / "exposures.csv", index=False)
    outcome = run(delivered, 'inputs.images_without_exposure="orient"')
    assert_true(delivered, outcome)
    assert groups(outcome) == {
        "image_points": 28,
        "gnss_positions": 17,
        "ins_attitudes": 16,
        "control_points": 0,
    }


def test_a_mistake_in_attitudes_is_named_where_some_images_have_none(delivered: Path) -> None:
    table = exposures(delivered)
    table.loc[::3, ANGLES] = ""
    table.to_csv(delivered / "exposures.csv", index=False)
    outcome = run(delivered, "cameras.UCE-80.mount_deg=90")
    assert outcome.summary.status == "input_error"
    assert "The images look rotated by 270°" in str(outcome.error)


def test_a_boresight_of_degrees_is_found_where_some_images_have_no_attitude(tmp_path: Path) -> None:
    changes = ("points.count=400", "truth.boresight_deg=[2.0, -1.5, 1.0]")
    simulate_project(load_simulation("uce-high", changes), tmp_path)
    table = exposures(tmp_path)
    table.loc[::3, ANGLES] = ""
    table.to_csv(tmp_path / "exposures.csv", index=False)
    outcome = run(tmp_path)
    assert_true(tmp_path, outcome)
    assert groups(outcome)["ins_attitudes"] == 18
    found = pd.read_parquet(outcome.directory / "parameters.parquet").set_index("parameter")
    assert found.loc["boresight_roll", "value"] == pytest.approx(2.0, abs=0.005)


def test_an_image_that_no_exposure_names_is_a_slip_unless_declared(delivered: Path) -> None:
    exposures(delivered).drop(index=2).to_csv(delivered / "exposures.csv", index=False)
    outcome = run(delivered)
    assert outcome.summary.status == "input_error"
    assert 'inputs.images_without_exposure = "orient"' in str(outcome.error)


def test_an_image_that_nothing_joins_to_the_others_is_named(delivered: Path) -> None:
    without_exposures(delivered)
    points = pd.read_csv(delivered / "image_points.csv", dtype=str)
    lonely = points["image"].iloc[0]
    kept = (points["image"] != lonely) | (points.groupby("image").cumcount() < 4)
    points[kept].to_csv(delivered / "image_points.csv", index=False)
    outcome = run(delivered, *CONTROL_ALONE)
    assert_true(delivered, outcome, images=27)
    assert any("cannot be oriented" in text and lonely in text for text in outcome.summary.problems)


def test_an_image_with_few_points_keeps_the_heading_of_its_strip(delivered: Path) -> None:
    """It has no attitude that could be wrong: the block was refused for it."""
    table, points = exposures(delivered), pd.read_csv(delivered / "image_points.csv", dtype=str)
    image = table["image"].iloc[3]
    table.loc[table["image"] == image, ANGLES] = ""
    table.to_csv(delivered / "exposures.csv", index=False)
    kept = (points["image"] != image) | (points.groupby("image").cumcount() < 5)
    points[kept].to_csv(delivered / "image_points.csv", index=False)
    outcome = run(delivered)
    assert_true(delivered, outcome)
    assert groups(outcome)["ins_attitudes"] == 27


def test_a_block_on_a_map_that_nothing_places_is_refused(delivered: Path) -> None:
    without_exposures(delivered)
    text = (delivered / "project.toml").read_text()
    start, end = text.index("[inputs.control]"), text.index("[adjustment]")
    (delivered / "project.toml").write_text(text[:start] + text[end:])
    outcome = run(delivered, "adjustment.free=[]")
    assert outcome.summary.status == "input_error"
    assert "the location of the block in" in str(outcome.error)


def test_a_wrong_control_point_known_in_plan_only_is_named_without_a_height(delivered: Path) -> None:
    control = pd.read_csv(delivered / "control.csv", dtype=str)
    control["z"] = ""
    control.loc[5, "x"] = f"{float(control.loc[5, 'x']) + 250.0:.3f}"
    control.to_csv(delivered / "control.csv", index=False)
    outcome = run(delivered)
    assert f"control point {control.loc[5, 'point']}" in str(outcome.error)
    assert "(east -250." in str(outcome.error)
    assert "up" not in str(outcome.error).split(";")[0]


def normalized(truth: CloseRange, outcome: RunOutcome) -> dict[str, np.ndarray]:
    """(Adjusted − true)/σ of orientations, object points and camera."""
    images = pd.read_parquet(outcome.directory / "exterior_orientations.parquet").set_index("image")
    points = pd.read_parquet(outcome.directory / "object_points.parquet").set_index("point")
    parameters = pd.read_parquet(outcome.directory / "parameters.parquet").set_index("parameter")
    images, points = images.loc[truth.images], points.loc[truth.targets]
    angles = np.rad2deg(rotation.to_omega_phi_kappa(truth.local_from_camera))
    turned = images[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy() - angles
    x0, y0 = PRINCIPAL_POINT_MM
    true = {"focal_length": FOCAL_LENGTH_MM, "principal_point_x": x0, "principal_point_y": y0}
    camera = [parameters.loc[name, "value"] - value for name, value in true.items()]
    camera.append(parameters.loc["brown_mm:K1", "value"] - K1)
    of_camera = parameters.loc[[*true, "brown_mm:K1"], "sigma"].to_numpy()
    sigmas = [f"sigma_{axis}_m" for axis in "xyz"]
    return {
        "centres": (images[["x_m", "y_m", "z_m"]].to_numpy() - truth.projection_centre)
        / images[sigmas].to_numpy(),
        "angles": ((turned + 180.0) % 360.0 - 180.0)
        / images[[f"sigma_{name}_deg" for name in ("omega", "phi", "kappa")]].to_numpy(),
        "points": (points[["x_m", "y_m", "z_m"]].to_numpy() - truth.target) / points[sigmas].to_numpy(),
        "camera": np.array(camera) / of_camera,
    }


@pytest.mark.parametrize(
    "relief", [pytest.param(0.0, id="plane"), pytest.param(0.4, id="with relief", marks=pytest.mark.slow)]
)
def test_sixty_images_of_a_test_field_calibrate_a_camera_of_which_c_alone_is_roughly_known(
    relief: float, tmp_path: Path
) -> None:
    """Convergent, turned by 90°, distorted; c is 0.3 mm off, and there are control points."""
    generator = np.random.default_rng(13)
    truth = close_range(60, 80, relief, generator)
    write_project(tmp_path, truth, 3e-6, generator)
    outcome = carry_out(system_calibration, RunRequest(tmp_path / "project.toml"))
    assert outcome.error is None, outcome.error
    assert outcome.summary.counts.images == 60
    error = normalized(truth, outcome)
    assert stats.chi2.ppf(0.001, 4) < np.sum(error["camera"] ** 2) < stats.chi2.ppf(0.999, 4)
    for kind in ("centres", "angles", "points"):
        # Those of centres and angles hang together by the camera's.
        assert np.mean(error[kind] ** 2) == pytest.approx(1.0, abs=0.4), kind
    redundancy = json.loads((outcome.directory / "summary.json").read_text())["redundancy"]
    assert outcome.summary.sigma0 == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * redundancy))
