"""y-parallaxes of the UltraCam Eagle block of IGN, oriented by its GNSS/INS and its own calibration."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.direct_georeferencing_check import direct_georeferencing_check

PROJECT = Path(__file__).resolve().parents[2] / "examples" / "ign_ultracam_eagle" / "project.toml"


@pytest.fixture(scope="module")
def results(test_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("check")
    overrides = ("direct_georeferencing.calibration=adjustment",)
    outcome = carry_out(direct_georeferencing_check, RunRequest(PROJECT, out, overrides, test_data))
    assert outcome.error is None, outcome.error
    return out


def test_relative_errors_of_gnss_and_ins_are_far_below_their_absolute_sigmas(results: Path) -> None:
    summary = json.loads((results / "summary.json").read_text())
    found = summary["direct_georeferencing"]
    assert found["y_parallax_models"] == 17
    assert found["y_parallaxes"] + found["y_parallax_mismatches"] == 10_084
    # 0.5 and 1.85 px of 4 µm; σ of 10 cm and 0.003° as white noise would give 10 µm.
    assert found["y_parallax_rms_um"] == pytest.approx(2.0, abs=0.15)
    assert found["y_parallax_max_um"] == pytest.approx(7.4, abs=0.5)
    assert found["y_parallax_predicted_rms_um"] == pytest.approx(10.3, abs=0.5)
    assert any("less between successive exposures" in sentence for sentence in summary["problems"])


def test_what_a_relative_orientation_leaves_is_the_noise_of_the_image_coordinates(results: Path) -> None:
    found = json.loads((results / "summary.json").read_text())["direct_georeferencing"]
    # Residuals of the adjustment are 0.150 px in y; two rays make √2 of the σ of one, 0.21 px.
    assert 0.15 < found["y_parallax_remaining_sigma_um"] / (2.0**0.5 * 4.0) < 0.25


def test_mismatches_are_few_and_stand_out(results: Path) -> None:
    table = pd.read_parquet(results / "y_parallaxes.parquet")
    mismatch = table["status"] == "mismatch"
    assert 10 <= mismatch.sum() <= 60
    assert table.loc[mismatch, "remaining_um"].abs().min() > table.loc[
        ~mismatch, "remaining_um"
    ].abs().quantile(0.99)


def test_a_single_control_point_states_nothing(results: Path) -> None:
    summary = json.loads((results / "summary.json").read_text())
    found = summary["direct_georeferencing"]
    assert found["rmse_m"] == [None, None, None]
    assert found["at_control_of_calibration"]["points"] == [1, 1, 1]
    assert not any(item["tested"] for item in found["statements"])
