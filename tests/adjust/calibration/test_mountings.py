"""Other mountings: found from hundredths of what was asked before, and not found where there is one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from adjust.calibration.clusters import split_in_two
from adjust.calibration.mountings import found_mountings
from adjust.calibration.strip_comparison import StripComparison, serial_increase
from tests.adjust.calibration.strips_flown import RULE, remounted, strips_flown
from tests.grids import diagonal_daily

# As good as the stated errors, and at them: what a strip's mean has of INS errors that last as long as it.
GOOD: dict[str, Any] = {}
STATED: dict[str, Any] = {"attitude_deg": (0.003, 0.003, 0.008)}
TWICE: dict[str, Any] = {"attitude_deg": (0.006, 0.006, 0.016), "position_m": 0.06}


def mountings(
    seed: int,
    flights: tuple[int, ...],
    in_strips: Any = (),
    angles_deg: Any = (0, 0, 0),
    plan_m: Any = (0, 0),
    **more: Any,
) -> np.ndarray:
    strips = strips_flown(np.random.default_rng(seed), flights, **more)
    remounted(strips, np.isin(strips.strip, in_strips), angles_deg, plan_m)
    return found_mountings(strips, RULE).mounting


@pytest.mark.parametrize(
    ("flights", "angles_deg"),
    diagonal_daily([(8, 8), (10, 6), (5, 5, 5)], [(0.004, 0.0, 0.0), (0.0, -0.004, 0.0)]),
)
def test_a_camera_remounted_by_four_millidegrees_between_two_days_is_told_apart(
    flights: tuple[int, ...], angles_deg: tuple[float, ...]
) -> None:
    """Strips scatter by 0.0005°: roll and pitch of a day are known to 0.0002°. GNSS shifts differ by day."""
    second = list(range(flights[0], flights[0] + flights[1]))
    for seed in range(5):
        found = mountings(seed, flights, second, angles_deg, (0.0, 0.0))
        expected = np.isin(np.arange(sum(flights)), second).astype(int)
        # The mounting of most strips is the first.
        np.testing.assert_array_equal(found, expected)


def test_less_than_the_certificate_has_to_keep_is_no_other_mounting() -> None:
    """0.0004° between two days with strips that scatter by 0.0001°: significant, and of no consequence."""
    quiet: dict[str, Any] = {"attitude_deg": (0.0001, 0.0001, 0.0001)}
    for seed in range(4):
        assert mountings(seed, (8, 8), list(range(8, 16)), (0.0004, 0.0, 0.0), (0, 0), **quiet).max() == 0
        assert mountings(seed, (8, 8), list(range(8, 16)), (0.0008, 0.0, 0.0), (0, 0), **quiet).max() == 1


def test_a_lever_arm_of_another_day_is_told_from_its_shift() -> None:
    """15 cm beside GNSS shifts that differ by half a metre; in one direction nothing tells them apart."""
    second = list(range(8, 16))
    found = mountings(1, (8, 8), second, (0, 0, 0), (0.15, 0.0), position_m=0.02)
    np.testing.assert_array_equal(found, [0] * 8 + [1] * 8)
    strips = strips_flown(np.random.default_rng(1), (8, 8), (10.0,))
    remounted(strips, strips.flight == 1, (0, 0, 0), (0.5, 0.0))
    one_way = found_mountings(strips, RULE)
    assert one_way.mounting.max() == 0
    assert not one_way.lever_arms_comparable


def test_a_mount_that_slips_during_a_flight_is_found_by_more_than_a_strip_s_errors() -> None:
    for size, groups in ((0.03, 2), (0.01, 1)):
        found = mountings(3, (14,), list(range(7, 14)), (0.0, size, 0.0), (0.0, 0.0), **STATED)
        assert len(np.unique(found)) == groups
    np.testing.assert_array_equal(
        mountings(3, (14,), list(range(9, 14)), (0.0, 0.03, 0.0), (0.0, 0.0)), [0] * 9 + [1] * 5
    )


def test_days_with_the_mounting_of_the_first_are_joined_again() -> None:
    found = mountings(5, (6, 7, 6), list(range(6, 13)), (0.004, 0.0, 0.004), (0.0, 0.0))
    np.testing.assert_array_equal(found, [0] * 6 + [1] * 7 + [0] * 6)


def test_a_single_strip_beside_two_days_is_found_with_them() -> None:
    strips = strips_flown(np.random.default_rng(6), (8, 10))
    remounted(strips, strips.flight == 0, (0.004, 0.0, 0.0), (0.0, 0.0))
    remounted(strips, strips.strip == 12, (0.0, 0.0, 0.0), (0.0, 0.4))
    expected = [1] * 8 + [0] * 4 + [2] + [0] * 5
    np.testing.assert_array_equal(found_mountings(strips, RULE).mounting, expected)


@pytest.mark.parametrize(("errors", "flights"), diagonal_daily((GOOD, STATED, TWICE), ((20,), (8, 8))))
def test_strips_of_one_mounting_are_called_another_no_more_often_than_stated(
    errors: dict[str, Any], flights: tuple[int, ...]
) -> None:
    """1 %, whatever the errors of the strips are; another GNSS shift is no other mounting.

    Fifteen flights find an alarm in every third; a thousand in the slow tests one in thirty.
    """
    trials = 15
    alarms = sum(mountings(seed, flights, **errors).max() > 0 for seed in range(trials))
    assert alarms <= stats.binom.ppf(0.999, trials, RULE.error_probability)


@pytest.mark.slow
@pytest.mark.parametrize("errors", [GOOD, STATED, TWICE])
@pytest.mark.parametrize("flights", [(20,), (8, 8), (6, 2), (6, 6, 6)])
def test_false_alarms_of_many_flights(errors: dict[str, Any], flights: tuple[int, ...]) -> None:
    trials = 1000
    alarms = sum(mountings(seed, flights, **errors).max() > 0 for seed in range(trials))
    assert alarms <= stats.binom.ppf(0.999, trials, RULE.error_probability)


def test_the_comparison_of_two_flights_is_the_t_test_of_their_means() -> None:
    """Closed case: roll of 4 and 6 strips that follow each other without correlation."""
    strips = strips_flown(np.random.default_rng(8), (4, 6))
    roll = np.array([1.0, -1.0, 1.0, -1.0, 3.0, 1.0, 3.0, 1.0, 3.0, 1.0])
    strips.mean[:, 0] = roll
    found = StripComparison.of(strips, strips.flight).probabilities(0, 1)
    assert found[0] == pytest.approx(stats.ttest_ind(roll[:4], roll[4:]).pvalue)


def test_errors_common_to_neighbours_increase_the_variance() -> None:
    flight = np.zeros(2000, dtype=np.int64)
    errors = np.random.default_rng(9).normal(size=2001)
    walk = (errors[1:] + errors[:-1])[:, None]
    # The correlation of a moving sum of two is one half: (1 + 0.5) / (1 − 0.5).
    assert serial_increase(walk, flight) == pytest.approx(3.0, rel=0.1)
    assert serial_increase(errors[:, None][:2000], flight) == pytest.approx(1.0, abs=0.1)
    assert serial_increase(np.array([[1.0], [-1.0]] * 4), flight[:8]) == 1.0


def test_two_days_without_names_are_told_apart_by_their_gap() -> None:
    """0.02° in every other strip of one flight, with strips that scatter by 0.0016°."""
    second = list(range(1, 20, 2))
    coarse: dict[str, Any] = {"attitude_deg": (0.0016, 0.0016, 0.003)}
    found = mountings(12, (20,), second, (0.0, 0.02, 0.0), (0.0, 0.0), **coarse)
    assert len(np.unique(found)) == 2
    assert len(set(found[second])) == 1
    # With strips three times as good a fifth of it is enough.
    found = mountings(12, (20,), second, (0.0, 0.004, 0.0), (0.0, 0.0))
    np.testing.assert_array_equal(found == found[1], np.arange(20) % 2 == 1)


def test_values_are_divided_where_the_gap_is() -> None:
    random = np.random.default_rng(13)
    values = random.permutation(np.concatenate([random.normal(0, 1, 12), random.normal(12, 1, 8)]))
    cluster = split_in_two(values, 0.01)
    assert cluster is not None
    np.testing.assert_array_equal(cluster, values > 6.0)
    assert split_in_two(np.zeros(8), 0.01) is None
    assert split_in_two(np.array([0.0, 0.0, 1.0, 1.0]), 0.5) is None


def test_values_that_belong_together_are_not_divided() -> None:
    random = np.random.default_rng(14)
    assert sum(split_in_two(random.normal(size=12), 0.05) is not None for _ in range(500)) <= 25 + 3 * 5
