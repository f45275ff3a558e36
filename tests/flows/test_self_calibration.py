"""Self-calibration from the project file to the tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

PARAMETERS = "adjustment.self_calibration.parameters"
ALL_52 = f'{PARAMETERS}="bluh:1-12+42-73+81-88"'


def simulated(folder: Path, preset: str, *overrides: str) -> Path:
    simulate_project(load_simulation(preset, overrides), folder)
    return folder / "project.toml"


def run(project: Path, *overrides: str) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(project, overrides=overrides))


def table(outcome: RunOutcome, name: str) -> pd.DataFrame:
    return pd.read_parquet(outcome.directory / f"{name}.parquet")


@pytest.fixture(scope="module")
def radial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """28 images with a radial error of 3 µm in the corner."""
    folder = tmp_path_factory.mktemp("radial")
    return simulated(folder, "uce-high", "points.count=900", "truth.image_errors.radial_um=3.0")


def test_a_radial_error_is_found_and_what_models_nothing_is_eliminated(radial: Path) -> None:
    outcome = run(radial, f'{PARAMETERS}="bluh:1-12"')
    assert outcome.error is None, outcome.error
    found = table(outcome, "self_calibration").set_index("parameter")
    kept = found[found["decision"] == "is significant"]
    assert "bluh:9" in kept.index
    # What bluh:9 corrects is 3 µm in the corner, vanishing at 128/162.6 of the half diagonal like the error.
    corner = kept.loc["bluh:9", "effect_max_um"]
    sigma = corner / abs(kept.loc["bluh:9", "t"])
    assert abs(corner - 3.0) < 4.0 * sigma
    assert len(kept) <= 4
    parameters = table(outcome, "parameters").set_index("parameter")
    dropped = found.index[found["decision"] == "is eliminated"]
    assert (parameters.loc[dropped, "status"] == "eliminated").all()
    assert (parameters.loc[dropped, "value"] == 0.0).all()
    assert parameters.loc[kept.index, "status"].eq("significant").all()
    np.testing.assert_allclose(parameters.loc[kept.index, "value"], kept["value"], rtol=1e-12)
    figures = outcome.summary.to_json()["self_calibration"]
    assert isinstance(figures, dict)
    assert figures["offered"] == 12
    assert figures["kept"] == len(kept)
    assert outcome.summary.to_json()["sigma0"] == pytest.approx(1.0, abs=0.05)


def test_a_known_sigma0_decides_what_is_eliminated(radial: Path) -> None:
    """Image points stated twenty times too coarse: with σ0 = 1 nothing is significant any more."""
    coarse = (f'{PARAMETERS}="bluh:1-12"', "inputs.image_points.sigma=0.024")
    free = run(radial, *coarse)
    found = table(free, "self_calibration").set_index("parameter")
    known = run(radial, *coarse, 'adjustment.sigma0="a_priori"')
    other = table(known, "self_calibration").set_index("parameter")
    figures = free.summary.to_json()["self_calibration"]
    assert isinstance(figures, dict)
    sigma0 = figures["sigma0_of_all"]
    assert isinstance(sigma0, float)
    assert sigma0 < 0.5
    np.testing.assert_allclose(other["t_of_all"], sigma0 * found["t_of_all"], rtol=1e-6)
    np.testing.assert_allclose(other["sigma_of_all"], found["sigma_of_all"] / sigma0, rtol=1e-6)
    assert (other["decision"] == "is significant").sum() < (found["decision"] == "is significant").sum()


def test_too_many_parameters_for_the_block_are_taken_out_by_name(tmp_path: Path) -> None:
    """52 parameters, 20 images of one height, few points."""
    project = simulated(
        tmp_path,
        "uce-high",
        "flight.0.exposures=5",
        "flight.1.exposures=5",
        "points.count=150",
    )
    free = 'adjustment.free=["boresight","gnss_shift","focal_length","principal_point"]'
    outcome = run(project, ALL_52, free)
    assert outcome.error is None, outcome.error
    found = table(outcome, "self_calibration")
    assert len(found) == 52
    assert found["reason"].str.len().gt(10).all()
    kept = found[found["decision"] == "is significant"]
    assert len(kept) <= 4
    assert np.isfinite(table(outcome, "exterior_orientations").select_dtypes("number")).all().all()


def test_a_prior_holds_what_the_block_does_not_know(radial: Path) -> None:
    outcome = run(
        radial,
        ALL_52,
        "adjustment.self_calibration.sigma_um=0.01",
        'adjustment.self_calibration.elimination="none"',
    )
    assert outcome.error is None, outcome.error
    parameters = table(outcome, "parameters")
    own = parameters[parameters["parameter"].str.startswith("bluh:")]
    assert np.isfinite(own["sigma_prior"]).all()
    sigma0 = outcome.summary.to_json()["sigma0"]
    assert isinstance(sigma0, float)
    assert (own["sigma"] <= 1.001 * sigma0 * own["sigma_prior"]).all()
    # σ contains σ0, the stated σ of the prior does not: without it both are on one scale.
    scaled = own["sigma"] / (sigma0 * own["sigma_prior"])
    assert own["sigma_over_prior"].to_numpy() == pytest.approx(scaled.to_numpy())
    assert (own["status"] == "prior_only").sum() > 20


def test_two_heights_with_the_same_errors_do_not_differ(tmp_path: Path) -> None:
    project = simulated(
        tmp_path, "uce-high", 'flight.1.flight="2"', "points.count=900", "truth.image_errors.radial_um=3.0"
    )
    outcome = run(project, f'{PARAMETERS}="bluh:9-11"', 'adjustment.self_calibration.per="flight"')
    assert outcome.error is None, outcome.error
    figures = outcome.summary.to_json()["self_calibration"]
    assert isinstance(figures, dict)
    (test,) = figures["flights"]
    assert (test["first"], test["second"], test["parameters"]) == ("UCE-80 in 1", "UCE-80 in 2", 3)
    assert not test["differ"]


def test_an_unknown_set_is_refused_with_the_nearest_one(radial: Path) -> None:
    outcome = run(radial, f'{PARAMETERS}="bluhh:1-12"')
    assert outcome.error is not None
    assert "bluh" in str(outcome.error)
