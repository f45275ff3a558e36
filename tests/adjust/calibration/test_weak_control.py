"""Other mountings in a block on three control points: its tilt looks like one in every direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from adjust.calibration.orientation_differences import OrientationDifferences
from adjust.calibration.two_step import two_step_calibration
from adjust.simulate.survey import SurveyLayout
from tests.adjust.calibration.strips_flown import RULE
from tests.adjust.calibration.two_step_flights import TwoStepFlight, two_step_flight

STRIPS = 12
NEARLY_IN_LINE = SurveyLayout("list", places=((-900.0, -800.0), (0.0, 100.0), (900.0, 800.0)))


@pytest.fixture(scope="module")
def on_three_points() -> TwoStepFlight:
    return two_step_flight(STRIPS, NEARLY_IN_LINE)


def pitched(differences: OrientationDifferences, degrees: float) -> OrientationDifferences:
    """The camera remounted for the second half of the strips of each direction."""
    moved = differences.misalignment.copy()
    moved[differences.strip % (STRIPS // 2) >= STRIPS // 4, 1] += np.deg2rad(degrees)
    return replace(differences, misalignment=moved)


def others(flight: TwoStepFlight, seed: int, degrees: float) -> list[int]:
    """Strips of another mounting than most, by their numbers."""
    differences = pitched(flight.differences(flight.simulated.flown_again(seed)), degrees)
    found = two_step_calibration(differences, RULE, flight.errors)
    return np.flatnonzero(found.mountings.mounting).tolist()


@pytest.mark.parametrize("seed", [0, 3, 4, 5])
def test_a_block_that_is_tilted_has_one_mounting(on_three_points: TwoStepFlight, seed: int) -> None:
    """By the scatter alone these four have two or three: σ of the tilt is 0.035°, of a strip 0.003°."""
    assert others(on_three_points, seed, 0.0) == []


@pytest.mark.parametrize("seed", [3, 4, 6])
def test_a_remounted_camera_is_found_in_a_block_that_is_tilted(
    on_three_points: TwoStepFlight, seed: int
) -> None:
    """0.04°, about the σ of the tilt."""
    assert others(on_three_points, seed, 0.04) == [0, 1, 2, 6, 7, 8]


@pytest.mark.slow
@pytest.mark.parametrize(
    "survey", [NEARLY_IN_LINE, *(SurveyLayout("spread", count=count) for count in (3, 5, 20))]
)
def test_other_mountings_are_found_alike_on_few_control_points_and_on_many(survey: SurveyLayout) -> None:
    """By chance in 1 % of the flights; at 0.05°, seventeen times the stated σ of a strip's mean, in most."""
    flight, flights = two_step_flight(STRIPS, survey), 40
    by_chance = sum(bool(others(flight, seed, 0.0)) for seed in range(flights))
    found = [sum(bool(others(flight, seed, size)) for seed in range(flights)) for size in (0.03, 0.05)]
    print(len(survey.places) or survey.count, "points: by chance", by_chance, "at 0.03, 0.05°", found)
    assert by_chance <= stats.binom.ppf(0.999, flights, RULE.error_probability)
    assert found[-1] >= 0.9 * flights
