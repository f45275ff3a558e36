"""The published UltraCam Eagle calibration flight, simulated: what `make demo` runs, held to its limits."""

from __future__ import annotations

import io
import json
import re
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from flows.command.truth_table import show
from flows.stories.flight_check import FlightCheck, flight_check
from tasks.settings.load_simulation import load_simulation
from tests.conftest import REPOSITORY

PUBLISHED_RMSE_M = (0.029, 0.033, 0.059)
# Of σ, in the units of parameters.parquet.
LIMITS = {
    "focal_length": 1.2e-3,
    "principal_point_x": 0.6e-3,
    "principal_point_y": 0.6e-3,
    "boresight_roll": 0.0003,
    "boresight_pitch": 0.0003,
    "boresight_yaw": 0.0007,
    "gnss_shift_x": 0.011,
    "gnss_shift_y": 0.011,
    "gnss_shift_z": 0.020,
}

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def demonstrated(tmp_path_factory: pytest.TempPathFactory) -> FlightCheck:
    simulation = load_simulation("uce-calibration")
    return flight_check(simulation, tmp_path_factory.mktemp("flight"), calibrates=True)


@pytest.fixture(scope="module")
def checked(demonstrated: FlightCheck) -> dict[str, Any]:
    summary = json.loads((demonstrated.outcome.directory / "summary.json").read_text())
    figures = summary["direct_georeferencing"]
    assert isinstance(figures, dict)
    return figures


def test_the_nine_parameters_come_back_with_the_precision_asked_for(demonstrated: FlightCheck) -> None:
    comparison = demonstrated.comparison
    assert comparison is not None
    assert {item.parameter for item in comparison.parameters} == set(LIMITS)
    for item in comparison.parameters:
        assert item.sigma <= LIMITS[item.parameter], item.parameter
        assert abs(item.t) < 3.3, item.parameter
    assert comparison.joint is not None
    assert comparison.joint.chi_squared < 21.7
    assert comparison.contradictions() == ()
    assert demonstrated.outcome.summary.status == "done"


@pytest.mark.parametrize(("points", "least"), [("independent", 30), ("at_control_of_calibration", 84)])
def test_differences_of_directly_georeferenced_points_are_those_predicted(
    checked: dict[str, Any], points: str, least: int
) -> None:
    figures = checked if points == "independent" else checked[points]
    assert min(figures["points"]) >= least
    found, predicted = np.array(figures["rmse_m"]), np.array(figures["predicted_rmse_m"])
    assert np.all(np.abs(found / predicted - 1.0) < 0.25)
    assert np.all(found <= 2.0 * np.array(PUBLISHED_RMSE_M))


def test_only_independent_points_carry_a_statement(checked: dict[str, Any]) -> None:
    assert all("40 check points" in item["sentence"] for item in checked["statements"])


def test_parallaxes_are_those_of_white_attitude_noise(checked: dict[str, Any]) -> None:
    """Larger than the published 8.7 µm, because 0.003° independent from image to image cannot give those."""
    assert checked["y_parallax_rms_um"] == pytest.approx(checked["y_parallax_predicted_rms_um"], rel=0.1)
    assert checked["y_parallax_max_um"] <= checked["y_parallax_predicted_max_limit_um"]
    assert checked["y_parallax_predicted_rms_um"] > 8.7


def shown_by_the_readme() -> list[str]:
    """The lines that `make demo` ends with, as README has them, without those of the folder."""
    page = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"ends with:\n\n```\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    lines = [line.rstrip() for line in block.splitlines()]
    return [
        line for line in lines if line and line != "…" and not line.startswith(("Report:", "Certificate:"))
    ]


def test_the_readme_shows_this_run(demonstrated: FlightCheck) -> None:
    assert demonstrated.comparison is not None
    screen = io.StringIO()
    simulation = load_simulation("uce-calibration")
    show(Console(file=screen, width=80), simulation, demonstrated.outcome, demonstrated.comparison)
    printed = " ".join(screen.getvalue().split())
    assert [line for line in shown_by_the_readme() if " ".join(line.split()) not in printed] == []
