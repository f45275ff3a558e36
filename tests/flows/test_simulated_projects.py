"""A simulated project through the command line and back to its truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone

ON_THE_EARTH = ("project.crs=EPSG:25832", "project.latitude_deg=48.9", "project.longitude_deg=8.9")
ON_A_MAP = ("project.angles=omega-phi-kappa", *ON_THE_EARTH)
SMALLER = (
    "flight.0.lines=3", "flight.0.exposures=6", "flight.1.lines=2", "flight.1.exposures=4",
    "points.count=300",
)  # fmt: skip
AXES = ["x_m", "y_m", "z_m"]
ANGLES = ["omega_deg", "phi_deg", "kappa_deg"]


def _adjusted(folder: Path, preset: str, *changes: str) -> None:
    """Simulate and adjust, as the command line does it."""
    simulate_project(load_simulation(preset, changes), folder)
    outcome = carry_out(adjustment_alone, RunRequest(folder / "project.toml"))
    assert outcome.error is None, outcome.error


def _adjusted_by_commands(folder: Path, preset: str, *changes: str) -> None:
    overrides = [part for change in changes for part in ("--set", change)]
    done = aerocal("simulate", preset, "--out", folder, *overrides)
    assert done.returncode == 0, done.stderr
    done = aerocal("run", folder / "project.toml", "--server", "none")
    assert done.returncode == 0, done.stderr


def _differences(folder: Path, table: str, columns: list[str], key: str | list[str]) -> pd.DataFrame:
    """Estimated minus true."""
    estimated = pd.read_parquet(folder / "results" / f"{table}.parquet").set_index(key)
    true = pd.read_parquet(folder / "truth" / f"{table}.parquet").set_index(key).loc[estimated.index]
    return estimated[columns] - true[columns]


@pytest.mark.parametrize(
    ("images", "changes"),
    [
        pytest.param(200, (), id="local", marks=pytest.mark.slow),
        pytest.param(200, ON_A_MAP, id="map", marks=pytest.mark.slow),
        pytest.param(26, (*ON_A_MAP, *SMALLER), id="smaller"),
    ],
)
def test_the_test_field_without_noise_gives_its_truth_back(
    tmp_path: Path, images: int, changes: tuple[str, ...]
) -> None:
    folder = tmp_path / "exact"
    _adjusted(folder, "uce-low", "noise.level=0", *changes)
    positions = _differences(folder, "exterior_orientations", AXES, "image")
    assert len(positions) == images
    assert positions.abs().to_numpy().max() < 1e-6
    angles = np.radians(_differences(folder, "exterior_orientations", ANGLES, "image"))
    assert angles.abs().to_numpy().max() < 1e-9
    assert _differences(folder, "object_points", AXES, "point").abs().to_numpy().max() < 1e-5
    parameters = _differences(folder, "parameters", ["value"], ["parameter", "entity"])["value"].abs()
    assert parameters.filter(like="boresight").max() < np.degrees(1e-9)
    # The shift is counted along the axes of the local frame, whose origin the two sides choose apart.
    assert parameters.filter(like="gnss_shift").max() < 1e-6


def test_estimates_of_a_noisy_block_lie_within_their_standard_deviations(tmp_path: Path) -> None:
    folder = tmp_path / "noisy"
    changes = ("truth.lever_arm_m=[0.35, -0.1, 0.0]", "truth.focal_length_change_mm=-0.008")
    _adjusted(folder, "uce-high", *changes, 'project.free=["boresight", "gnss_shift"]')
    # A lever arm and a focal length that are not estimated must show.
    check = pd.read_parquet(folder / "results" / "parameters.parquet").set_index("parameter")
    assert abs(check.loc["gnss_shift_z", "value"] - 0.286) > 5.0 * check.loc["gnss_shift_z", "sigma"]

    folder = tmp_path / "right"
    _adjusted_by_commands(folder, "uce-high")
    for table, key, columns in (
        ("exterior_orientations", "image", AXES + ANGLES),
        ("object_points", "point", AXES),
    ):
        error = _differences(folder, table, columns, key)
        estimated = pd.read_parquet(folder / "results" / f"{table}.parquet").set_index(key)
        sigma = estimated[[f"sigma_{name}" for name in columns]].to_numpy()
        normalized = error.to_numpy() / sigma
        assert 0.8 < np.sqrt(np.mean(normalized**2)) < 1.2
        assert np.abs(normalized).max() < 6.0


def test_the_help_names_every_preset_and_teaches() -> None:
    from tasks.settings.load_simulation import preset_names

    text = aerocal("simulate", "--help").stdout
    for name in preset_names():
        assert name in text
    for word in ("--out", "--set", "--seed", "aerocal simulate uce-low --out block"):
        assert word in text


def test_a_wrong_specification_ends_with_two_and_one_line(tmp_path: Path) -> None:
    done = aerocal("simulate", "uce-lov", "--out", tmp_path / "a")
    assert done.returncode == 2
    assert "Did you mean 'uce-low'?" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "a").exists()


def test_a_time_offset_is_found_with_the_rates_of_the_body_and_a_lever_arm_beside_it(tmp_path: Path) -> None:
    changes = (
        "truth.time_offset_s=0.005",
        "truth.lever_arm_m=[0.35, -0.1, 0.0]",
        "trajectory.rate_deg_s=[1.0, 1.0, 1.0]",
        'project.free=["boresight", "gnss_shift", "lever_arm", "time_offset"]',
    )
    _adjusted(tmp_path, "uce-high", *changes)
    exposures = pd.read_csv(tmp_path / "exposures.csv")
    assert np.std(exposures[["rate_roll", "rate_pitch", "rate_yaw"]].to_numpy()) == pytest.approx(
        1.0, rel=0.3
    )
    found = pd.read_parquet(tmp_path / "results" / "parameters.parquet").set_index("parameter")
    offset, arm = found.loc["time_offset"], found.loc["lever_arm_x"]
    # Left in the attitudes, 5 ms at 1 °/s would be 5 mdeg, twice the noise of roll and pitch.
    assert abs(offset["value"] - 0.005) < 4.0 * offset["sigma"] < 0.004
    assert abs(arm["value"] - 0.35) < 4.0 * arm["sigma"]
