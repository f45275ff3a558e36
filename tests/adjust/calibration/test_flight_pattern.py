"""Flight directions and heights come from the exposures, whatever crab, turns and relief do to them."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.calibration.flight_pattern import FlightPattern, flight_pattern
from adjust.errors import InconsistentBlockError


def flown(*strips: tuple[float, float], exposures: int = 12, seed: int = 5) -> FlightPattern:
    """Strips (heading in degrees, height), with crab of 4° a strip, 1° an exposure, relief of 3 %."""
    random = np.random.default_rng(seed)
    crab = random.uniform(-4.0, 4.0, len(strips)) if len(strips) > 1 else np.zeros(1)
    heading = np.concatenate([np.full(exposures, strip[0] + crab[k]) for k, strip in enumerate(strips)])
    height = np.repeat([strip[1] for strip in strips], exposures).astype(float)
    heading += random.normal(0.0, 1.0, len(heading))
    height *= 1.0 + random.normal(0.0, 0.03, len(height))
    return flight_pattern(np.deg2rad(heading), height, np.repeat(np.arange(len(strips)), exposures))


def degrees(pattern: FlightPattern) -> list[int]:
    return [round(float(np.rad2deg(angle)) / 10.0) * 10 % 360 for angle in pattern.directions]


def test_the_uce_pattern_has_four_directions_and_two_heights() -> None:
    strips = [(heading, height) for height in (780.0, 2340.0) for heading in (0.0, 90.0, 180.0, 270.0) * 3]
    pattern = flown(*strips)
    assert degrees(pattern) in ([0, 90, 180, 270], [90, 180, 270, 0])
    assert pattern.height_ratio == pytest.approx(3.0, rel=0.03)
    assert len(pattern.opposite) == 2
    assert len(pattern.crossing) == 4
    np.testing.assert_array_equal(pattern.images, 36)
    np.testing.assert_array_equal(pattern.strips, 3)


def test_a_direction_is_the_median_of_its_strips_whatever_one_of_them_does() -> None:
    heading = np.deg2rad([10.0, 11.0, 9.0, 10.0, 35.0])
    pattern = flight_pattern(heading, np.full(5, 1000.0), np.arange(5))
    assert np.rad2deg(pattern.directions).tolist() == pytest.approx([10.0])


def test_exposures_are_counted_by_directions_and_heights_in_ascending_order() -> None:
    """Flown from the last direction and the highest level; a height is the median of its strips."""
    strips = [
        (270.0, 2100.0, 5),
        (270.0, 2000.0, 4),
        (90.0, 2010.0, 3),
        (90.0, 1000.0, 2),
        (270.0, 1005.0, 1),
    ]
    heading, height = (np.concatenate([np.full(strip[2], strip[k]) for strip in strips]) for k in (0, 1))
    number = np.repeat(np.arange(5), [strip[2] for strip in strips])
    pattern = flight_pattern(np.deg2rad(heading), height, number)
    assert np.rad2deg(pattern.directions).tolist() == pytest.approx([90.0, 270.0])
    assert pattern.heights.tolist() == [1002.5, 2010.0]
    assert pattern.images.tolist() == [[2, 3], [1, 9]]
    assert pattern.strips.tolist() == [[1, 1], [1, 2]]
    # One direction on both sides of north is the last one.
    across = flight_pattern(np.deg2rad([352.0, 4.0, 90.0, 90.0, 90.0]), np.full(5, 1000.0), np.arange(5))
    assert np.rad2deg(across.directions).tolist() == pytest.approx([90.0, 358.0])
    assert across.images.tolist() == [[3], [2]]


def test_directions_that_lie_close_together_all_round_are_cut_at_their_widest_gaps() -> None:
    """Seen across north: 350° to 80° in steps of 20° at most, but one of 25°."""
    heading = np.deg2rad([350.0, 0.0, 10.0, 30.0, 55.0, 60.0, 65.0, 80.0])
    pattern = flight_pattern(heading, np.full(8, 1000.0), np.arange(8))
    assert np.rad2deg(pattern.directions).tolist() == pytest.approx([5.0, 62.5])
    assert pattern.images.ravel().tolist() == [4, 4]


@pytest.mark.parametrize(
    ("headings", "directions", "opposite", "crossing"),
    [
        ((90.0, 90.0, 90.0), [90], 0, 0),
        ((90.0, 270.0, 90.0), [90, 270], 1, 0),
        ((0.0, 90.0), [0, 90], 0, 1),
        ((355.0, 2.0, 6.0), [0], 0, 0),
        ((45.0, 225.0, 135.0), [40, 140, 220], 1, 2),
        ((0.0, 135.0), [0, 140], 0, 1),
    ],
)
def test_opposite_and_crossing_are_told_apart(
    headings: tuple[float, ...], directions: list[int], opposite: int, crossing: int
) -> None:
    pattern = flown(*((heading, 1000.0) for heading in headings))
    np.testing.assert_allclose(degrees(pattern), directions, atol=10)
    assert (len(pattern.opposite), len(pattern.crossing)) == (opposite, crossing)
    assert pattern.height_ratio == 1.0


def test_relief_below_a_strip_is_no_second_height() -> None:
    """One height over mountains: height above ground from 700 to 1,300 m within each strip."""
    strip = np.repeat(np.arange(4), 10)
    height = np.tile(np.linspace(700.0, 1300.0, 10), 4)
    pattern = flight_pattern(np.deg2rad(np.where(strip % 2, 270.0, 90.0)), height, strip)
    assert len(pattern.heights) == 1
    assert pattern.images.sum() == 40


def test_a_turn_at_the_end_of_a_strip_is_no_direction() -> None:
    heading = np.deg2rad(np.array([90.0] * 10 + [140.0]))
    pattern = flight_pattern(heading, np.full(11, 900.0), np.zeros(11, dtype=np.int64))
    assert len(pattern.directions) == 1
    assert pattern.images.sum() == 10
    # A third of a strip is no turn.
    heading = np.deg2rad(np.array([90.0] * 8 + [180.0] * 4))
    pattern = flight_pattern(heading, np.full(12, 900.0), np.zeros(12, dtype=np.int64))
    assert pattern.images.ravel().tolist() == [8, 4]


def test_undeclared_strips_do_not_hide_the_pattern() -> None:
    """All exposures under one strip name: two directions and two heights nevertheless."""
    heading = np.deg2rad(np.tile([90.0, 270.0], 20))
    height = np.repeat([800.0, 2000.0], 20)
    pattern = flight_pattern(heading, height, np.zeros(40, dtype=np.int64))
    assert degrees(pattern) == [90, 270]
    assert pattern.height_ratio == 2.5
    np.testing.assert_array_equal(pattern.images, 10)


def test_a_full_circle_is_many_directions_and_a_ladder_of_heights_many_levels() -> None:
    """No gap anywhere, and yet it is not one direction and not one height."""
    heading = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    height = 1000.0 * 1.05 ** np.arange(24)
    pattern = flight_pattern(heading, height, np.arange(24))
    assert len(pattern.directions) >= 6
    assert len(pattern.opposite) >= 1
    assert pattern.height_ratio > 2.0
    assert pattern.images.sum() == 24


def test_turning_everything_turns_the_directions_and_nothing_else() -> None:
    random = np.random.default_rng(3)
    strip = np.repeat(np.arange(8), 6)
    heading = np.deg2rad(np.repeat([0.0, 180.0, 90.0, 270.0] * 2, 6) + random.normal(0.0, 2.0, 48))
    height = np.repeat([700.0, 2100.0], 24)
    here = flight_pattern(heading, height, strip)
    for turn in (0.3, 1.7, 4.0):
        there = flight_pattern(heading + turn, height, strip)
        moved = np.sort((here.directions + turn) % (2.0 * np.pi))
        np.testing.assert_allclose(there.directions, moved, atol=1e-12)
        assert sorted(map(tuple, there.images)) == sorted(map(tuple, here.images))


def test_exposures_without_heading_or_height_are_refused() -> None:
    one = np.zeros(1)
    with pytest.raises(InconsistentBlockError, match="No flight direction"):
        flight_pattern(one[:0], one[:0], np.zeros(0, dtype=np.int64))
    for heading, height in ((np.nan, 500.0), (0.0, np.nan), (0.0, -5.0)):
        with pytest.raises(InconsistentBlockError, match="missing or not positive"):
            flight_pattern(one + heading, one + height, np.zeros(1, dtype=np.int64))
