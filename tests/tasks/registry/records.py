"""Records for the tests of the registry."""

from __future__ import annotations

from datetime import date

import numpy as np

from adjust.arrays import Floats
from tasks.calibration.record import (
    CalibratedCamera,
    CalibratedParameter,
    CalibrationFlight,
    CalibrationRecord,
)
from tasks.registry.approval import approval_of
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.contents import StoredCalibration
from tasks.registry.history import BEGINNING, Event, Validity
from tasks.registry.registry import Registry, Signature
from tasks.settings.camera_identity import CameraIdentity

NAMES = ("focal_length", "principal_point_x", "principal_point_y", "boresight_roll", "bluh:9")
UNITS = ("mm", "mm", "mm", "deg", "1/mm²")
VALUES = np.array([79.992, 0.004, -0.006, 0.0047, 1.5e-9])
SIGMAS = np.array([0.0012, 0.0005, 0.0005, 0.0003, 2e-10])
#: Correlations of the five, positive definite.
CORRELATIONS = np.array(
    [
        [1.0, 0.1, -0.2, 0.0, 0.3],
        [0.1, 1.0, 0.05, 0.0, 0.1],
        [-0.2, 0.05, 1.0, 0.6, 0.0],
        [0.0, 0.0, 0.6, 1.0, 0.0],
        [0.3, 0.1, 0.0, 0.0, 1.0],
    ]
)
SHIFT_SIGMA_M = 0.01
ENGINEER = Signature("ann", "calibration flight of the year")


def covariance(scale: float = 1.0) -> Floats:
    """(5, 5) covariance of the camera's parameters, in products of their units."""
    sigma = SIGMAS * scale
    return np.asarray(CORRELATIONS * np.outer(sigma, sigma))


def record(
    values: Floats = VALUES,
    *,
    name: str = "UCE",
    identity: CameraIdentity | None = None,
    flown: date | None = date(2024, 5, 2),
    scale: float = 1.0,
    shift_m: float = -0.262,
    **changes: object,
) -> CalibrationRecord:
    """A calibration of a camera: five parameters of its own, a GNSS shift of its flight, a held lever arm."""
    chosen = CameraIdentity(body="UC-E-1", imu="I-7") if identity is None else identity
    own = [parameter(*row, name) for row in zip(NAMES, UNITS, values, SIGMAS * scale, strict=True)]
    shift = parameter("gnss_shift_x", "m", shift_m, SHIFT_SIGMA_M, "1")
    matrix = np.zeros((6, 6))
    matrix[:5, :5], matrix[5, 5] = covariance(scale), SHIFT_SIGMA_M**2
    matrix[0, 5] = matrix[5, 0] = -0.5 * SIGMAS[0] * scale * SHIFT_SIGMA_M
    content: dict[str, object] = {
        "camera": CalibratedCamera(
            name=name, identity=chosen, columns=13080, rows=20010, pixel_um=5.2, mount_deg=0
        ),
        "parameters": (*own, shift, parameter("lever_arm_x", "m", 0.3, None, name)),
        "covariance": tuple(tuple(map(float, row)) for row in matrix),
        "flight": CalibrationFlight(
            project="test field", crs="local", flown=flown, images=456, strips=48, object_points=5000,
            image_points=40000, control_points=84, heights_m=(780.0, 2340.0),
            headings_deg=(0.0, 90.0, 180.0, 270.0), gsd_m=(0.051, 0.152),
        ),
        "sigma0": 1.0,
        "redundancy": 60000,
        "verdict": "accepted",
        "inputs": {},
        "software": {"aerocal": "0.1.0"},
    }  # fmt: skip
    return CalibrationRecord.model_validate({**content, **changes})


def parameter(name: str, unit: str, value: float, sigma: float | None, entity: str) -> CalibratedParameter:
    return CalibratedParameter(
        parameter=name,
        entity=entity,
        unit=unit,
        value=float(value),
        given=0.0,
        sigma=None if sigma is None else float(sigma),
        sigma_prior=None,
        status="fixed" if sigma is None else "significant",
        verdict="held" if sigma is None else "determined",
    )


def stored(
    number: int, calibration: CalibrationRecord, *, approved: bool = True, although: str = ""
) -> StoredCalibration:
    """A calibration of a registry, without the registry."""
    sealed = SealedRecord.of(calibration)
    events = [Event(1, number, sealed.digest, "draft", None, None, None, "ann", "2026-01-01", "", "", "")]
    if approved:
        values = ("2020-06-01", None, None, "ben", "2026-01-02", "", although, BEGINNING)
        events.append(Event(2, number, sealed.digest, "approved", *values))
    return StoredCalibration(number, number, sealed, tuple(events))


def changed(number: int) -> Floats:
    """Values that differ from record to record, within their σ."""
    return VALUES + 0.1 * number * SIGMAS


def add(registry: Registry, calibration: CalibrationRecord) -> StoredCalibration:
    return registry.add(SealedRecord.of(calibration), ENGINEER)


def approve(
    registry: Registry, number: int, start: date, end: date | None = None, although: str = ""
) -> StoredCalibration:
    approval = approval_of(registry.contents(), str(number), Validity(start, end), although)
    registry.approve(approval, Signature("ben"), although)
    return registry.calibration(str(number))
