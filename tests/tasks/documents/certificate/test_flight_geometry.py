"""Overlaps and spacings of strips whose places are written down."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.calibration.record import CalibratedCamera
from tasks.documents.certificate.flight_geometry import StripGroup, strip_groups
from tasks.documents.certificate.flight_section import axis_words
from tasks.settings.camera_identity import CameraIdentity

#: 1,000 × 2,000 px with 0.1 m on the ground: 100 m along the columns, 200 m along the rows.
GSD, HEIGHT = 0.1, 500.0


def camera(mount_deg: int = 0) -> CalibratedCamera:
    return CalibratedCamera(
        name="C", identity=CameraIdentity(), columns=1000, rows=2000, pixel_um=5.0, mount_deg=mount_deg
    )


def strip(name: str, offset: float, base: float, heading: float = 90.0, count: int = 6) -> pd.DataFrame:
    """A strip `offset` to the left of the line through the origin, flown along `heading`."""
    angle = np.deg2rad(heading)
    along, left = np.array([np.sin(angle), np.cos(angle)]), np.array([-np.cos(angle), np.sin(angle)])
    places = np.arange(count)[:, None] * base * along + offset * left
    return pd.DataFrame(
        {
            "level": 0,
            "flight": "1",
            "strip": name,
            "x_m": places[:, 0],
            "y_m": places[:, 1],
            "z_m": HEIGHT + 50.0,
            "ground_m": 50.0,
            "gsd_m": GSD,
        }
    )


def groups(*strips: pd.DataFrame, mount_deg: int = 0) -> tuple[StripGroup, ...]:
    return strip_groups(pd.concat(strips, ignore_index=True), camera(mount_deg))


def test_overlaps_are_those_of_base_and_spacing_on_the_side_of_the_image() -> None:
    (found,) = groups(strip("1", 0.0, 40.0), strip("2", 140.0, 40.0), strip("3", 280.0, 40.0))
    assert (found.strips, found.lines, found.images) == (3, 3, 18)
    assert found.base_m == pytest.approx(40.0)
    assert found.base_over_height == pytest.approx(0.08)
    assert found.forward_overlap == pytest.approx(0.60)
    assert found.spacing_m == pytest.approx(140.0)
    assert found.side_overlap == pytest.approx(0.30)
    assert found.axis_deg == pytest.approx(90.0)


@pytest.mark.parametrize("mount_deg", [90, 270])
def test_a_turned_camera_has_its_rows_along_the_flight(mount_deg: int) -> None:
    (found,) = groups(strip("1", 0.0, 40.0), strip("2", 60.0, 40.0), mount_deg=mount_deg)
    assert found.forward_overlap == pytest.approx(0.80)
    assert found.side_overlap == pytest.approx(0.40)


def test_forward_and_reverse_are_one_line() -> None:
    (found,) = groups(
        strip("1f", 0.0, 40.0),
        strip("1r", 4.0, 40.0).iloc[::-1],
        strip("2f", 140.0, 40.0),
        strip("2r", 144.0, 40.0).iloc[::-1],
    )
    assert (found.strips, found.lines) == (4, 2)
    assert found.spacing_m == pytest.approx(140.0)


@pytest.mark.parametrize("heading", [0.0, 1.0, 37.0, 90.0, 179.0])
def test_directions_around_north_belong_together(heading: float) -> None:
    """Strips a little to either side of one axis, 179.5° and 0.5° among them, are one group."""
    first, second = (strip(n, o, 40.0, heading + d) for n, o, d in (("1", 0.0, -0.5), ("2", 140.0, 0.5)))
    (found,) = groups(first, second)
    assert found.lines == 2
    assert found.forward_overlap == pytest.approx(0.6, abs=1e-3)
    assert found.axis_deg % 180.0 == pytest.approx(heading, abs=0.01) or heading == 0.0


def test_crossing_lines_and_single_exposures_are_kept_apart() -> None:
    first, second = groups(
        strip("1", 0.0, 40.0, 0.0), strip("2", 0.0, 40.0, 90.0), strip("3", 9.0, 40.0, count=1)
    )
    assert (first.axis_deg, second.axis_deg) == (pytest.approx(0.0), pytest.approx(90.0))
    assert (first.lines, first.spacing_m, first.side_overlap) == (1, None, None)


@pytest.mark.parametrize(
    ("heading", "words"), [(359.7, "0° and 180°"), (0.3, "0° and 180°"), (92.0, "92° and 272°")]
)
def test_the_directions_of_strips_are_less_than_a_full_turn(heading: float, words: str) -> None:
    strips = [strip("a", 0.0, 40.0, heading), strip("b", 100.0, 40.0, heading - 180.0)]
    (group,) = strip_groups(pd.concat(strips, ignore_index=True), camera())
    assert axis_words(group) == f"level 1, {words}"
