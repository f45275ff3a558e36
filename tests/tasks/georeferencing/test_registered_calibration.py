"""Calibrations from the registry as they are applied: names, covariances, whose control."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.calibration.record import CalibrationRecord
from tasks.georeferencing.registered_calibration import RegisteredCalibration, calibration_of_registered
from tasks.store.stage_key import Keyed
from tests.tasks.registry.records import NAMES, SIGMAS, VALUES, changed, covariance, record

SURVEYED = pd.DataFrame(
    {
        "point": ["A", "B"],
        "x_m": [1.0, 2.0],
        "y_m": [1.0, 2.0],
        "z_m": [0.0, 0.0],
        "role": ["control", "check"],
    }
)


def registered(
    calibration: CalibrationRecord, camera: str = "C", *, shares_control: bool = False
) -> RegisteredCalibration:
    return RegisteredCalibration(camera, calibration.text, calibration.digest, "said", shares_control)


def test_a_record_gives_values_and_full_covariance_under_the_names_of_the_project() -> None:
    found = calibration_of_registered((registered(record()),), SURVEYED, "local")
    keys = [(name, "C") for name in NAMES]
    assert [found.values[key] for key in keys] == VALUES.tolist()
    scale = np.outer(SIGMAS, SIGMAS)
    np.testing.assert_allclose(found.covariance(keys) / scale, covariance() / scale, atol=1e-15)
    with_shift = found.covariance([("focal_length", "C"), ("gnss_shift_x", "1")])
    assert with_shift[0, 1] == pytest.approx(-0.5 * SIGMAS[0] * 0.01)
    assert found.values["lever_arm_x", "C"] == 0.3
    assert ("lever_arm_x", "C") not in found.sigmas
    assert found.units["bluh:9", "C"] == "1/mm²"
    assert found.statuses["focal_length", "C"] == "significant"


def test_two_cameras_of_one_flight_share_its_shift() -> None:
    both = (registered(record(name="L"), "left"), registered(record(changed(1), name="R"), "right"))
    found = calibration_of_registered(both, SURVEYED, "local")
    assert found.entities("gnss_shift_x") == ("1",)
    assert found.values["focal_length", "right"] == changed(1)[0]
    assert found.covariance([("focal_length", "left"), ("focal_length", "right")])[0, 1] == 0.0


def test_flights_of_one_name_and_different_shifts_are_told_apart() -> None:
    both = (registered(record(name="L"), "left"), registered(record(name="R", shift_m=0.5), "right"))
    found = calibration_of_registered(both, SURVEYED, "local")
    assert found.entities("gnss_shift_x") == ("1 of left", "1 of right")
    assert found.values["gnss_shift_x", "1 of right"] == 0.5


def test_control_points_count_as_control_of_a_calibration_made_with_their_file() -> None:
    places = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]])
    for shares, expected in ((False, [False, False]), (True, [True, False])):
        chosen = (registered(record(), shares_control=shares),)
        found = calibration_of_registered(chosen, SURVEYED, "local")
        assert found.control.contains(["A", "B"], places, "local").tolist() == expected


def test_the_digest_and_nothing_of_the_place_is_in_the_key() -> None:
    one, other = registered(record()), registered(record(changed(1)))
    assert isinstance(one, Keyed)
    assert one.key_content() != other.key_content()
    assert one.input_files() == ()
