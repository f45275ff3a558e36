"""The record of a calibration: what it refuses, and that its text and digest are those of its content."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from tasks.calibration.record import (
    CalibratedCamera,
    CalibratedParameter,
    CalibrationFlight,
    CalibrationRecord,
)
from tasks.settings.camera_identity import CameraIdentity


def parameter(name: str, value: float, sigma: float | None) -> CalibratedParameter:
    return CalibratedParameter(
        parameter=name,
        entity="UCE",
        unit="mm",
        value=value,
        given=0.0,
        sigma=sigma,
        sigma_prior=None,
        status="fixed" if sigma is None else "significant",
        verdict="held" if sigma is None else "determined",
    )


def record(**changes: object) -> CalibrationRecord:
    content: dict[str, object] = {
        "camera": CalibratedCamera(
            name="UCE",
            identity=CameraIdentity(body="UC-E-1"),
            columns=13080,
            rows=20010,
            pixel_um=5.2,
            mount_deg=0,
        ),
        "parameters": (
            parameter("focal_length", 79.992, 0.001),
            parameter("principal_point_x", 0.004, None),
            parameter("principal_point_y", -0.006, 0.0005),
        ),
        "covariance": ((1e-6, 2e-8), (2e-8, 2.5e-7)),
        "flight": CalibrationFlight(
            project="p",
            crs="local",
            flown=None,
            images=392,
            strips=40,
            object_points=5000,
            image_points=40000,
            control_points=84,
            heights_m=(780.0, 2340.0),
            headings_deg=(0.0, 90.0, 180.0, 270.0),
            gsd_m=(0.051, 0.152),
        ),
        "sigma0": 1.0,
        "redundancy": 60000,
        "verdict": "accepted",
        "inputs": {},
        "software": {"aerocal": "0.1.0"},
    }
    return CalibrationRecord.model_validate({**content, **changes})


def test_the_text_of_a_record_gives_the_same_record_and_digest() -> None:
    one = record()
    other = CalibrationRecord.model_validate_json(one.text)
    assert other == one
    assert other.digest == one.digest
    assert record(sigma0=1.1).digest != one.digest


def test_the_covariance_is_that_of_the_estimated_parameters_in_their_order() -> None:
    assert [item.parameter for item in record().estimated] == ["focal_length", "principal_point_y"]
    assert record().covariance_matrix.tolist() == [[1e-6, 2e-8], [2e-8, 2.5e-7]]


@pytest.mark.parametrize(
    "covariance",
    [((1e-6,),), ((1e-6, 2e-8), (3e-8, 2.5e-7)), ((4e-6, 2e-8), (2e-8, 2.5e-7)), ()],
)
def test_a_covariance_that_does_not_belong_to_the_parameters_is_refused(covariance: object) -> None:
    with pytest.raises(ValidationError):
        record(covariance=covariance)


def test_a_parameter_twice_is_refused() -> None:
    twice = (parameter("focal_length", 80.0, None), parameter("focal_length", 80.0, None))
    with pytest.raises(ValidationError, match="twice"):
        record(parameters=twice, covariance=())


def test_held_parameters_alone_have_an_empty_covariance() -> None:
    held = record(parameters=(parameter("focal_length", 80.0, None),), covariance=())
    assert held.covariance_matrix.shape == (0, 0)
