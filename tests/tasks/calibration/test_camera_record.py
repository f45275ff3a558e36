"""Records of several cameras: each holds its own parameters and those of the flights."""

from __future__ import annotations

import pandas as pd

from tasks.calibration.camera_record import rows_of

OWNERS = {"A": ("A", None), "A in B": ("A in B", None), "1": (None, "1"), "A in 2": ("A", "2")}
ROWS = (
    ("focal_length", "A"),
    ("focal_length", "A in B"),
    ("bluh:7", "A in 2"),
    ("bluh:7", "A in B"),
    ("gnss_shift_x", "1"),
    ("gnss_strip_bias_x", "3"),
)
PARAMETERS = pd.DataFrame(
    [(name, entity, *OWNERS.get(entity, (None, None))) for name, entity in ROWS],
    columns=["parameter", "entity", "camera", "flight"],
)


def keys(camera: str) -> list[tuple[str, str]]:
    own = rows_of(PARAMETERS, (camera,))
    return list(zip(own["parameter"], own["entity"], strict=True))


def test_a_camera_called_like_another_one_in_a_flight_keeps_its_own_parameters() -> None:
    flight = ("gnss_shift_x", "1")
    assert keys("A") == [("focal_length", "A"), ("bluh:7", "A in 2"), flight]
    assert keys("A in B") == [("focal_length", "A in B"), ("bluh:7", "A in B"), flight]
