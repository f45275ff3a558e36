"""A camera of computer vision in a project: its distortion as published, converted, and entered wrongly."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.conversion import NOTEWORTHY, converted
from adjust.camera.additional.correction import correction
from adjust.camera.additional.effect import effects
from adjust.camera.additional.evaluation import slope_of
from adjust.camera.additional.register import additional_parameters
from flows.runs.project_run import RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone

C = 0.08
FORMAT = ImageFormat(34.008e-3, 52.026e-3, focal_length=C)
FORWARD = additional_parameters("brown-forward:k1,k2,p1", FORMAT)
#: Largest errors over the format, µm: ten times those of a mapping camera.
LARGEST_UM = np.array([-500.0, 100.0, 5.0])
VALUES = 1e-6 * LARGEST_UM / effects(FORWARD).largest
CAMERA = "cameras.UCE-80.additional_parameters"

Run = Callable[..., Path]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A block of 28 images measured with the distortion, and how to adjust it with other settings."""
    folder = tmp_path_factory.mktemp("distorted")
    true = ", ".join(f'"{name}" = {size}' for name, size in zip(FORWARD.names, LARGEST_UM, strict=True))
    changes = (
        f"truth.image_errors.additional_um={{{true}}}",
        "points.count=400",
        "truth.gnss_shift_m=[0, 0, 0]",
    )
    project = simulate_project(load_simulation("uce-high", changes), folder).project_file

    def run(*overrides: str) -> Path:
        # One folder for all: only the adjustment is computed again.
        outcome = carry_out(adjustment_alone, RunRequest(project, None, overrides))
        assert outcome.error is None, outcome.error
        return Path(outcome.directory)

    return run


def given(names: tuple[str, ...], values: np.ndarray) -> str:
    items = ", ".join(f'"{name}" = {value!r}' for name, value in zip(names, values.tolist(), strict=True))
    return f"{CAMERA}={{{items}}}"


def summary(results: Path) -> dict[str, object]:
    found = json.loads((results / "summary.json").read_text())
    assert isinstance(found, dict)
    return found


def copied_into_brown(sign: float) -> str:
    """The coefficients scaled to metres, as if direction were a matter of sign; p1 along −y is P2."""
    scale = np.array([C**-2, C**-4, -1.0 / C])
    return given(("brown:K1", "brown:K2", "brown:P2"), sign * VALUES * scale)


def stretch(results: Path) -> float:
    """By how much a correction stretches what is measured with equal σ, in the root mean square.

    Residuals of a correction are those of the ideal point, (I + ∂Δ/∂x̄) times those of the measured one.
    """
    points = pd.read_parquet(results / "image_points.parquet")[["x_mm", "y_mm"]].to_numpy() * 1e-3
    wanted = additional_parameters("brown", FORMAT)
    values = converted(FORWARD, VALUES, wanted).values
    slope = slope_of(lambda xy: correction(wanted, values, xy), points) + np.eye(2)
    return float(np.sqrt(0.5 * np.mean(np.sum(slope**2, axis=(1, 2)))))


def findings(results: Path) -> dict[str, float]:
    """Sizes of the distortion readings among the causes that were found, by quantity."""
    table = pd.read_parquet(results / "model_alternatives.parquet")
    chosen = table[(table["rank"] > 0) & table["quantity"].str.startswith("distortion")]
    return dict(zip(chosen["quantity"], chosen["explained"], strict=True))


def test_known_values_are_applied_in_their_direction(run: Run) -> None:
    results = run(given(FORWARD.names, VALUES))
    sigma0 = summary(results)["sigma0"]
    assert isinstance(sigma0, float)
    assert 0.95 < sigma0 < 1.05
    assert findings(results) == {}


def test_converted_values_fit_as_well(run: Run) -> None:
    wanted = additional_parameters("brown", FORMAT)
    conversion = converted(FORWARD, VALUES, wanted)
    assert conversion.largest < NOTEWORTHY
    results = run(given(FORWARD.names, VALUES))
    as_published = summary(results)["sigma0"]
    as_converted = summary(run(given(wanted.names, conversion.values)))["sigma0"]
    assert as_converted / stretch(results) == pytest.approx(as_published, abs=1e-3)  # type: ignore[operator]


def test_forward_and_backward_self_calibration_find_the_same_camera(run: Run) -> None:
    """The same fit, the true values, and values of one that are those of the other when converted."""
    selections = {"forward": "brown-forward:k1-k3,p1,p2", "backward": "brown:K1-K3,P1,P2"}
    sigma0, estimates = {}, {}
    for direction, selection in selections.items():
        results = run(
            f'adjustment.self_calibration.parameters="{selection}"',
            'adjustment.self_calibration.elimination="none"',
        )
        sigma0[direction] = summary(results)["sigma0"]
        table = pd.read_parquet(results / "parameters.parquet")
        own = table[table["parameter"].str.startswith("brown")].set_index("parameter")
        estimates[direction] = own.loc[list(additional_parameters(selection, FORMAT).names)]
    assert sigma0["backward"] / stretch(results) == pytest.approx(sigma0["forward"], abs=1e-3)
    forward, backward = estimates["forward"], estimates["backward"]
    true = np.array([VALUES[0], VALUES[1], 0.0, VALUES[2], 0.0])
    assert np.abs((forward["value"] - true) / forward["sigma"]).max() < 3.5
    wanted = additional_parameters(selections["backward"], FORMAT)
    given_forward = additional_parameters(selections["forward"], FORMAT)
    conversion = converted(given_forward, forward["value"].to_numpy(), wanted)
    assert np.abs((conversion.values - backward["value"]) / backward["sigma"]).max() < 1.0


def test_a_copy_in_the_other_direction_is_found(run: Run) -> None:
    results = run(copied_into_brown(-1.0))
    found = findings(results)
    assert found["distortion_direction"] == pytest.approx(1.0, abs=0.1)
    (sentence,) = (
        str(item["sentence"])
        for item in summary(results)["model_findings"]  # type: ignore[attr-defined]
        if item["quantity"] == "distortion_direction"
    )
    assert "appears to be defined in the other direction" in sentence
    assert "brown-forward" in sentence


def test_a_wrong_sign_is_found(run: Run) -> None:
    found = findings(run(given(FORWARD.names, -VALUES)))
    assert found["distortion_sign"] == pytest.approx(1.0, abs=0.1)


def test_the_command_converts_the_camera_of_a_project(tmp_path: Path) -> None:
    project = simulate_project(load_simulation("uce-high", ("points.count=100",)), tmp_path).project_file
    options = ("--set", given(FORWARD.names, VALUES), "--json", "--to")
    done = aerocal("convert-distortion", project, *options, "brown:K1-K3,P1,P2")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    expected = converted(FORWARD, VALUES, additional_parameters("brown:K1-K3,P1,P2", FORMAT))
    assert list(found["values"].values()) == pytest.approx(expected.values.tolist())
    assert found["misfit_max_um"] == pytest.approx(1e6 * expected.largest)
    assert ("Remark:" in done.stderr) == (expected.largest > 1e-7)
    poor = aerocal("convert-distortion", project, *options, "brown:K1")
    assert "differs by up to" in poor.stderr
    shown = aerocal("convert-distortion", project, *options[:2], "--to", "brown_mm:K1-K3,P1,P2").stdout
    assert "Misfit over the format of camera UCE-80" in shown
    assert 'additional_parameters = { "brown_mm:K1" = ' in shown
    refused = aerocal("convert-distortion", project, "--to", "brown")
    assert refused.returncode == 2
    assert "No camera has additional parameters" in refused.stderr
