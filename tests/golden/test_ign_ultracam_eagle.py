"""The real UltraCam Eagle block of IGN France: what a correct system must find in it.

Expected values: README.md of the data folder, worked out there with independent scripts.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from adjust.geometry import rotation
from docs.generate.example_figures import FIGURES, RUNS, figures_of
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame, local_from_grid, local_from_map
from tasks.settings.coordinates import Heights
from tests.flows.adjustment_alone import adjustment_alone

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
DATA = "ign_ultracam_eagle_m3"


@pytest.fixture(scope="module")
def adjusted(test_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., RunOutcome]:
    """Runs the example with some settings, each combination once; what they leave as it is, too."""
    done: dict[tuple[str, ...], RunOutcome] = {}

    def run(*overrides: str) -> RunOutcome:
        if overrides not in done:
            out = tmp_path_factory.mktemp("eagle")
            for first in list(done.values())[:1]:
                shutil.copytree(first.directory / ".store", out / ".store")
            request = RunRequest(EXAMPLES / "ign_ultracam_eagle" / "project.toml", out, overrides)
            done[overrides] = carry_out(adjustment_alone, request)
            assert done[overrides].error is None, done[overrides].error
        return done[overrides]

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_TEST_DATA", str(test_data))
        yield run


def figures(outcome: RunOutcome) -> dict:
    return dict(outcome.summary.to_json())


def test_direct_georeferencing_with_raw_gnss_ins_fits_as_published(adjusted) -> None:
    given = figures(adjusted())["given_orientations"]
    assert given["tie_rms_px"] == pytest.approx([0.44, 0.73], abs=0.005)
    (control,) = given["control"]
    found = [control["dx_m"], control["dy_m"], control["dz_m"]]
    np.testing.assert_allclose(found, [-0.11, 0.11, 0.98], atol=0.05)
    assert control["rays"] == 5


def test_adjustment_without_rejection(adjusted) -> None:
    result = figures(adjusted())
    assert 1.04 <= result["sigma0"] <= 1.09
    # 16,888 less six extra parameters: boresight and lever arm of the one camera in use.
    assert result["redundancy"] == 16_882
    assert result["image_rms_px"] == pytest.approx([0.140, 0.150], abs=0.005)
    assert result["counts"]["rejected"] == 0
    assert result["counts"]["image_points"] == 18_132 + 5
    assert result["counts"]["single_ray_points"] == 2_075
    assert any("2,075 points are measured in one image only" in text for text in result["problems"])


def test_half_of_the_sub_areas_are_systematic_and_corrections_hold_in_other_images(
    adjusted,
) -> None:
    without = figures(adjusted())["residual_grid"]["cameras"][0]
    assert without["known"] == 625
    assert without["significant"] == pytest.approx(0.51 * 625, abs=12)
    assert without["significant_jointly"] > 200
    assert without["rms_um"] == pytest.approx([0.25, 0.43], abs=0.02)
    corrected = figures(adjusted("adjustment.residual_grid.iterations=5"))
    iteration, camera = (corrected["residual_grid"][name] for name in ("iteration", "cameras"))
    sigma0 = [step["sigma0"] for step in iteration["steps"]]
    assert sigma0 == pytest.approx([1.064, 0.949, 0.937, 0.933], abs=0.003)
    assert iteration["reason"] == "cross_validation"
    # Images that took no part in their correction lose a fifth of their vPv.
    assert iteration["gain"] == pytest.approx(0.198, abs=0.01)
    assert camera[0]["significant"] < 0.06 * 625
    table = pd.read_parquet(adjusted().directory / "residual_autocorrelation.parquet")
    nearest = table[table["distance_to_mm"] == 1.0]["correlation"]
    assert nearest.max() == pytest.approx(0.28, abs=0.02)


@pytest.mark.slow
def test_collocation_holds_in_other_images_after_one_step(adjusted) -> None:
    corrected = figures(
        adjusted("adjustment.residual_grid.iterations=5", "adjustment.residual_grid.method=collocation")
    )
    iteration = corrected["residual_grid"]["iteration"]
    assert [step["sigma0"] for step in iteration["steps"]][:2] == pytest.approx([1.064, 0.936], abs=0.003)
    assert iteration["reason"] == "settled"
    # Means get no further than 0.1958 µm and 19.8 %.
    assert iteration["cross_validation"][1]["mean_rms_um"] == pytest.approx(0.1945, abs=0.0008)
    assert iteration["gain"] == pytest.approx(0.2005, abs=0.003)


def test_two_ray_points_along_the_base_are_uncontrolled_and_never_tested(adjusted) -> None:
    table = pq.read_table(
        adjusted("adjustment.rejection={critical_value=3.29}").directory / "residuals.parquet"
    )
    residuals = table.to_pandas()
    weak = residuals["redundancy"] < 0.1
    assert (residuals.loc[weak, "status"] == "uncontrolled").all()
    image = pq.read_table(adjusted().directory / "residuals.parquet").to_pandas()
    image = image[image["group"] == "image_points"]
    assert (image["status"] == "uncontrolled").sum() == pytest.approx(6_475, abs=5)


@pytest.mark.parametrize(("critical_value", "rejected", "sigma0"), [(4.13, 149, 0.957), (3.29, 311, 0.888)])
def test_heavy_tails_are_rejected_at_the_stated_critical_value(
    adjusted, critical_value: float, rejected: int, sigma0: float
) -> None:
    result = figures(adjusted(f"adjustment.rejection={{critical_value={critical_value}}}"))
    assert result["critical_value"] == critical_value
    assert abs(result["counts"]["rejected_image_points"] - rejected) <= 0.02 * rejected
    assert result["sigma0"] == pytest.approx(sigma0, abs=0.005)
    # After the last pass nothing controlled is left above the critical value.
    table = pq.read_table(
        adjusted(f"adjustment.rejection={{critical_value={critical_value}}}").directory / "residuals.parquet"
    )
    residuals = table.to_pandas()
    assert residuals.loc[residuals["status"] == "used", "standardized"].abs().max() <= critical_value


def test_redundancy_numbers_sum_to_the_redundancy(adjusted) -> None:
    residuals = pq.read_table(adjusted().directory / "residuals.parquet").to_pandas()
    assert residuals["redundancy"].sum() == pytest.approx(16_882, abs=1e-6)
    assert residuals["redundancy"].between(-1e-9, 1 + 1e-9).all()


def test_a_map_fixed_shift_fits_worse_than_a_lever_arm(adjusted) -> None:
    """The real offset turns with the aircraft."""
    shift = figures(adjusted('adjustment.free=["boresight","gnss_shift"]'))
    assert shift["sigma0"] == pytest.approx(1.081, abs=0.003)
    assert shift["sigma0"] > figures(adjusted())["sigma0"]


def test_boresight_and_lever_arm_are_those_of_the_independent_adjustment(adjusted) -> None:
    found = {item["parameter"]: item for item in figures(adjusted())["parameters"]}
    for name, expected in (("roll", -0.0010), ("pitch", 0.0069), ("yaw", 0.0024)):
        assert found[f"boresight_{name}"]["value"] == pytest.approx(expected, abs=0.0006)
        assert found[f"boresight_{name}"]["sigma"] == pytest.approx(0.0008, abs=0.0002)
    assert found["lever_arm_x"]["value"] == pytest.approx(0.63, abs=0.03)
    assert 0.50 <= found["lever_arm_y"]["value"] <= 0.60


def test_one_step_calibration_agrees_within_two_standard_deviations(adjusted) -> None:
    """Values of the one-step line of the data's README, turned into body axes (forward is −y)."""
    found = {item["parameter"]: item for item in figures(adjusted())["parameters"]}
    expected = {
        "boresight_roll": -0.0009, "boresight_pitch": 0.0069, "boresight_yaw": 0.0024,
        "lever_arm_x": 0.63, "lever_arm_y": 0.52, "lever_arm_z": 0.26,
    }  # fmt: skip
    for name, value in expected.items():
        assert abs(found[name]["value"] - value) <= 2.0 * found[name]["sigma"], name


def test_the_correlation_of_roll_and_lever_arm_is_shown(adjusted) -> None:
    """φ and x of the camera are roll and right of the body; a larger roll goes with a smaller offset."""
    table = pq.read_table(adjusted().directory / "correlations.parquet").to_pandas()
    pairs = table.set_index(["parameter_a", "parameter_b"])["correlation"]
    names = ("boresight_roll", "lever_arm_y")
    found = [pairs[pair] for pair in (names, names[::-1]) if pair in pairs.index]
    assert len(found) == 1
    assert -1.0 < float(found[0]) < -0.3


@pytest.mark.parametrize(
    ("gnss_sigma_m", "position_sd_m"), [(0.10, 0.20), pytest.param(0.03, 0.08, marks=pytest.mark.slow)]
)
def test_orientations_agree_with_those_of_ign(
    adjusted, test_data: Path, gnss_sigma_m: float, position_sd_m: float
) -> None:
    overrides = () if gnss_sigma_m == 0.10 else (f"inputs.exposures.sigma.position_m={gnss_sigma_m}",)
    table = pq.read_table(adjusted(*overrides).directory / "exterior_orientations.parquet").to_pandas()
    attitude, position = in_camera_axes(table, test_data)
    assert np.abs(attitude.mean(axis=0)).max() <= 0.003
    assert attitude.std(axis=0, ddof=1).max() <= 0.003
    assert position.std(axis=0, ddof=1).max() <= position_sd_m


def in_camera_axes(table: pd.DataFrame, data: Path) -> tuple[np.ndarray, np.ndarray]:
    """Ours minus IGN's: small rotations (n, 3) in degrees, positions (n, 3) in metres."""
    columns = ["image", "x", "y", "z", "omega", "phi", "kappa", "camera"]
    path = data / DATA / "21FD2447_alt_s07.OPK"
    reference = (
        pd.read_csv(path, sep=r"\s+", skiprows=5, names=columns).set_index("image").loc[table["image"]]
    )
    results = MapFrame.of("EPSG:2154", Heights.model_validate("ellipsoidal"))
    heights = {
        "geoid": data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif",
        "linear_alteration": {"ground_m": 205.0},
    }
    delivered = MapFrame.of("EPSG:2154", Heights.model_validate(heights))
    x_ours = table[["x_m", "y_m", "z_m"]].to_numpy()
    x_theirs = results.from_geodetic(delivered.to_geodetic(reference[["x", "y", "z"]].to_numpy()))
    frame = local_frame(results, x_ours)

    def placed(x: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        from_camera = rotation.from_omega_phi_kappa(np.deg2rad(angles))
        return local_from_map(results, frame, x), local_from_grid(results, frame, x) @ from_camera

    ours, our_rotation = placed(x_ours, table[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy())
    theirs, their_rotation = placed(x_theirs, reference[["omega", "phi", "kappa"]].to_numpy())
    camera_from_local = np.swapaxes(their_rotation, 1, 2)
    attitude = np.rad2deg(rotation.log(camera_from_local @ our_rotation))
    return attitude, np.einsum("nij,nj->ni", camera_from_local, ours - theirs)


def test_focal_length_is_not_determined_by_one_flying_height(adjusted) -> None:
    """One height and one control point: σ is near 1 mm, 250 px, and the result says why."""
    result = figures(adjusted('adjustment.free=["boresight","lever_arm","focal_length"]'))
    focal = next(item for item in result["parameters"] if item["parameter"] == "focal_length")
    assert focal["sigma"] > 0.5
    assert focal["status"] == "not_determinable"
    assert any("focal_length" in text and "correlated" in text for text in result["problems"])


# Daily on simulated blocks, in tests/flows/test_unoriented_images.py and test_unusual_blocks.py.
@pytest.mark.slow
def test_without_ins_the_strips_give_the_headings_and_the_block_the_attitudes(
    test_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Starting attitudes are wrong by degrees; the result agrees with that of the INS within its σ."""
    monkeypatch.setenv("AEROCAL_TEST_DATA", str(test_data))
    measured = set(pd.read_csv(test_data / DATA / "Filtered_all_liaisons.mes", sep=r"\s+", header=None)[1])
    delivered = pd.read_csv(test_data / DATA / "trajectograhie.opk", sep=r"\s+")
    own = delivered[delivered["ID"].isin(measured)]
    exposures = pd.DataFrame(
        {"image": own["ID"], "camera": own["CAMERA"], "strip": own["ID"].str.slice(10, 16)}
        | {axis: own[axis.upper()] for axis in "xyz"}
        | dict.fromkeys(("omega", "phi", "kappa"), "")
    )
    exposures.to_csv(tmp_path / "exposures.csv", index=False)
    overrides = (
        f'inputs.exposures.file="{tmp_path / "exposures.csv"}"',
        'inputs.exposures.format="csv"',
        'adjustment.free=["lever_arm"]',
    )
    request = RunRequest(EXAMPLES / "ign_ultracam_eagle" / "project.toml", tmp_path / "out", overrides)
    outcome = carry_out(adjustment_alone, request)
    assert outcome.error is None
    assert any("20 exposures have no attitude" in text for text in outcome.summary.problems)
    table = pq.read_table(tmp_path / "out" / "exterior_orientations.parquet").to_pandas()
    attitude, _ = in_camera_axes(table, test_data)
    assert np.abs(attitude.mean(axis=0)).max() <= 0.003
    assert attitude.std(axis=0, ddof=1).max() <= 0.003


def test_the_figures_that_pages_state_are_those_of_a_run(adjusted) -> None:
    found = figures_of(
        {name: figures(adjusted(f"adjustment.rejection={value}")) for name, value in RUNS.items()}
    )
    stated = json.loads(FIGURES.read_text(encoding="utf-8"))
    assert found == pytest.approx(stated, abs=2e-4), "run python -m docs.generate.example_figures"
