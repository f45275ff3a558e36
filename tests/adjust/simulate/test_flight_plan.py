from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from adjust.simulate.flight_plan import (
    START_TIME,
    TURN_TIME,
    LineGroup,
    base_of,
    centre_from_start,
    flight_plan,
    spacing_of,
)

EAST = np.pi / 2
GROUP = LineGroup("A", "1", 0, EAST, 800.0, (4, 3), 250.0, 400.0)


def test_base_and_spacing_follow_from_the_overlaps() -> None:
    camera = FrameCamera("UCE", 13080, 20010, 5.2e-6, 0.08, (0.0, 0.0), "corner", 0)
    # 40 % of 68.016 mm and of 104.052 mm at the image scale 1 : 9750.
    assert base_of(camera, 780.0, 0.6) == pytest.approx(0.4 * 0.068016 * 9750)
    assert spacing_of(camera, 780.0, 0.6) == pytest.approx(0.4 * 0.104052 * 9750)


@pytest.mark.parametrize("mount_deg", [90, 270])
def test_a_camera_turned_by_a_quarter_has_its_rows_along_the_flight(mount_deg: int) -> None:
    camera = FrameCamera("C", 20010, 13080, 5.2e-6, 0.08, (0.0, 0.0), "corner", mount_deg)
    assert base_of(camera, 780.0, 0.6) == pytest.approx(265.26, abs=0.01)


def test_lines_lie_beside_each_other_to_the_right_and_are_centred() -> None:
    plan = flight_plan((replace(GROUP, pattern="single", centre=(1000.0, 500.0)),))
    assert plan.strips == ("A01", "A02")
    first, second = (plan.plan[plan.strip == k] for k in (0, 1))
    np.testing.assert_allclose(first[:, 0], 1000.0 + 250.0 * np.array([-1.5, -0.5, 0.5, 1.5]))
    np.testing.assert_allclose(first[:, 1], 700.0)
    np.testing.assert_allclose(second[:, 0], 1000.0 + 250.0 * np.array([-1.0, 0.0, 1.0]))
    # South is to the right of east.
    np.testing.assert_allclose(second[:, 1], 300.0)


def test_every_second_line_is_flown_back() -> None:
    plan = flight_plan((GROUP,))
    second = plan.strip == 1
    np.testing.assert_allclose(np.diff(plan.plan[second][:, 0]), -250.0)
    np.testing.assert_allclose(plan.heading[second], EAST + np.pi)


def test_both_directions_give_two_strips_over_the_same_places() -> None:
    plan = flight_plan((replace(GROUP, pattern="both"),))
    assert plan.strips == ("A01f", "A01r", "A02f", "A02r")
    forward, reverse = (plan.plan[plan.strip == k] for k in (0, 1))
    np.testing.assert_allclose(forward, reverse[::-1], atol=1e-12)


def test_a_group_can_be_placed_by_its_first_exposure() -> None:
    start = (120.0, -50.0)
    centre = centre_from_start(start, 0.3, GROUP.exposures, GROUP.base, GROUP.spacing)
    plan = flight_plan((replace(GROUP, heading=0.3, centre=centre),))
    np.testing.assert_allclose(plan.plan[0], start, atol=1e-9)


def test_time_runs_with_the_speed_and_every_flight_has_its_own_clock() -> None:
    other = replace(GROUP, name="B", flight="2", speed=50.0)
    plan = flight_plan((GROUP, other))
    line = np.flatnonzero(plan.strip == 0)
    np.testing.assert_allclose(np.diff(plan.time[line]), 250.0 / 75.0)
    second = np.flatnonzero(plan.strip == 1)
    assert plan.time[second[0]] - plan.time[line[-1]] == pytest.approx(TURN_TIME)
    assert plan.time[plan.flight == 1].min() == START_TIME
    assert plan.flights == ("1", "2")


def test_image_names_are_ascending() -> None:
    plan = flight_plan((replace(GROUP, name="Z"), replace(GROUP, name="A", exposures=(12,) * 11)))
    assert list(plan.images) == sorted(plan.images)
    assert len(set(plan.images)) == 7 + 132


def test_two_groups_of_one_name_are_refused() -> None:
    with pytest.raises(InconsistentBlockError, match="same name"):
        flight_plan((GROUP, GROUP))
