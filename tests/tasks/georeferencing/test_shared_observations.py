"""Whether a calibration comes from the flight it is applied to: the data decide."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.georeferencing.calibration import CalibrationFlight
from tasks.georeferencing.shared_observations import same_exposures

EXPOSURES = pd.DataFrame(
    {
        "image": ["a", "b", "c"],
        "flight": ["1", "1", None],
        **{f"{axis}_m": [100.0, 200.0, 300.0] for axis in "xyz"},
        **{f"{name}_deg": [1.0, 2.0, 3.0] for name in ("omega", "phi", "kappa")},
        **{f"{name}_deg": [np.nan] * 3 for name in ("heading", "pitch", "roll")},
    }
)
FLIGHT = CalibrationFlight(pd.DataFrame(), EXPOSURES, pd.DataFrame(), "EPSG:25832")


def test_the_same_readings_are_the_same_flight_and_angles_that_are_not_given_do_not_matter() -> None:
    assert same_exposures(FLIGHT, EXPOSURES, "EPSG:25832") == {"a", "b", "c"}
    assert same_exposures(FLIGHT, EXPOSURES.iloc[:1], "EPSG:25832") == {"a"}


@pytest.mark.parametrize(
    ("column", "value"), [("x_m", 200.01), ("kappa_deg", 2.0001), ("flight", "2"), ("image", "B")]
)
def test_another_reading_flight_or_name_is_another_exposure(column: str, value: object) -> None:
    changed = EXPOSURES.copy()
    changed.loc[1, column] = value
    assert same_exposures(FLIGHT, changed, "EPSG:25832") == {"a", "c"}


def test_in_another_crs_nothing_is_taken_for_the_same() -> None:
    assert same_exposures(FLIGHT, EXPOSURES, "EPSG:2154") == frozenset()
