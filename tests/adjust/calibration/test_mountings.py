"""Other mountings: found from hundredths of what was asked before, and not found where there is one."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import optimize, stats

from adjust.arrays import Ints
from adjust.calibration import mountings as mountings_of
from adjust.calibration.clusters import split_in_two
from adjust.calibration.mountings import MountingRule, found_mountings
from adjust.calibration.orientation_differences import SHIFT
from adjust.calibration.strip_comparison import StripComparison, serial_increase
from adjust.calibration.strip_offsets import body_fixed, map_fixed
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


def test_the_comparison_of_two_lever_arms_is_the_f_test_of_one_against_two() -> None:
    """Closed case: in both models a GNSS shift of each flight, and a variance that correlation increases."""
    strips = strips_flown(np.random.default_rng(8), (10, 10), correlation=0.8)
    remounted(strips, strips.flight == 1, (0, 0, 0), (0.02, 0.01))
    offset = strips.mean[:, SHIFT][:, :2].ravel()
    shifts, arms = map_fixed(strips.flight), body_fixed(strips.heading, strips.flight)
    squares = []
    for of_arms in (arms, arms[:, :2] + arms[:, 2:]):
        design = np.hstack([shifts, of_arms])
        residual = offset - design @ np.linalg.lstsq(design, offset, rcond=None)[0]
        squares.append(float(residual @ residual))
        if of_arms is arms:
            increase = serial_increase(residual.reshape(-1, 2), strips.flight)
    assert increase > 1.2
    statistic = (squares[1] - squares[0]) / 2.0 / (squares[0] / 32.0 * increase)
    found = StripComparison.of(strips, strips.flight).probabilities(0, 1)
    assert found[3] == pytest.approx(stats.f.sf(statistic, 2, 32))


@pytest.mark.parametrize(("of_threshold", "mountings"), [(0.9, 2), (1.1, 1)])
def test_flights_are_told_apart_at_their_part_of_the_error_probability(
    of_threshold: float, mountings: int
) -> None:
    """A quarter of it is for the comparison of flights, a quarter of that for roll."""
    strips = strips_flown(np.random.default_rng(16), (8, 8))
    roll = strips.mean[:, 0]

    def excess(move: float) -> float:
        found = stats.ttest_ind(roll[:8], roll[8:] + move).pvalue
        return float(found - of_threshold * RULE.error_probability / 16.0)

    move = optimize.brentq(excess, roll[:8].mean() - roll[8:].mean(), 0.1)
    strips.mean[8:, 0] += move
    anything = MountingRule(RULE.error_probability, np.zeros(4), RULE.strip_sigma)
    assert found_mountings(strips, anything).mounting.max() == mountings - 1


@pytest.mark.parametrize(("of_threshold", "mountings"), [(0.9, 2), (1.1, 1)])
def test_a_flight_is_cut_at_its_part_of_the_error_probability(of_threshold: float, mountings: int) -> None:
    """The same for 13 places between 14 strips, which are not alike because they follow each other."""
    strips = strips_flown(np.random.default_rng(17), (14,))
    place = np.arange(14)
    strips.mean[:, 0] = roll = np.abs(strips.mean[:, 0]) * (-1.0) ** place
    behind = place >= 7

    def least(move: float) -> float:
        return min(float(stats.ttest_ind(*np.split(roll + move * behind, [k])).pvalue) for k in range(1, 14))

    threshold = of_threshold * RULE.error_probability / (16.0 * 13.0)
    move = optimize.brentq(lambda move: np.log(least(move) / threshold), 1e-5, 1e-3)
    strips.mean[:, 0] = roll + move * behind
    anything = MountingRule(RULE.error_probability, np.zeros(4), 1e-3 * RULE.strip_sigma)
    assert found_mountings(strips, anything).mounting.max() == mountings - 1


def test_none_of_the_strips_exceeds_its_limits_but_with_the_error_probability() -> None:
    """Roll, pitch, yaw and two coordinates of forty strips, to both sides."""
    exceeded = stats.norm.sf(RULE.beyond_chance(40) / RULE.strip_sigma)
    np.testing.assert_allclose(2.0 * 5.0 * 40.0 * exceeded, RULE.error_probability)


@pytest.mark.parametrize(("apart", "mountings"), [(1.3, 1), (1.5, 2)])
def test_single_strips_are_of_one_mounting_if_two_strips_may_differ_by_as_much(
    apart: float, mountings: int
) -> None:
    """√2 of what one strip may deviate by, for both have errors; here in roll and in pitch."""
    strips = strips_flown(np.random.default_rng(18), (16,))
    move = apart * RULE.beyond_chance(16)
    strips.mean[4, 0], strips.mean[11, 1] = move[:2]
    found = found_mountings(strips, RULE).mounting
    assert found[4] == 1
    assert found[11] == mountings
    assert not np.delete(found, [4, 11]).any()


def test_errors_common_to_neighbours_increase_the_variance() -> None:
    flight = np.zeros(2000, dtype=np.int64)
    errors = np.random.default_rng(9).normal(size=2001)
    walk = (errors[1:] + errors[:-1])[:, None]
    # The correlation of a moving sum of two is one half: (1 + 0.5) / (1 − 0.5).
    assert serial_increase(walk, flight) == pytest.approx(3.0, rel=0.1)
    assert serial_increase(errors[:, None][:2000], flight) == pytest.approx(1.0, abs=0.1)
    assert serial_increase(np.array([[1.0], [-1.0]] * 4), flight[:8]) == 1.0
    # Two pairs within flights: a correlation of (2 + 1) / 2 over 15 / 4 is 0.4.
    two_flights = serial_increase(np.array([[2.0], [1.0], [1.0], [3.0]]), np.array([0, 0, 0, 1]))
    assert two_flights == pytest.approx(1.4 / 0.6)


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


def test_a_division_has_the_chance_of_students_t_times_the_number_of_divisions() -> None:
    one, other = np.array([0.1, -0.2, 0.0, 0.3]), np.array([1.1, 0.8, 1.3])
    chance = stats.ttest_ind(other, one, alternative="greater").pvalue * 2.0**7
    values = np.concatenate([one, other])
    assert chance < 1.0
    assert split_in_two(values, 0.999 * chance) is None
    cluster = split_in_two(values, 1.001 * chance)
    assert cluster is not None
    np.testing.assert_array_equal(cluster, np.arange(7) > 3)


def test_values_that_belong_together_are_not_divided() -> None:
    random = np.random.default_rng(14)
    assert sum(split_in_two(random.normal(size=12), 0.05) is not None for _ in range(500)) <= 25 + 3 * 5


def test_mountings_that_do_not_differ_are_given_up_the_most_alike_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By chances of the mountings of strips 2, 3, 4 and 5; each of 4 tests of 4 searches has a sixteenth."""
    chances, asked = {2: 1e-9, 3: 0.4, 4: 0.01, 5: 1e-4}, list[int]()

    def of(_strips: Any, mounting: Ints, _errors: Any, _sigma: Any) -> Any:
        def differing(number: int, other: int, _limits: Any) -> float:
            assert other == 0
            asked.append(number)
            return chances[int(np.flatnonzero(mounting == number)[0])]

        return SimpleNamespace(mountings=np.unique(mounting), differing=differing)

    monkeypatch.setattr(mountings_of, "JointStrips", SimpleNamespace(of=of))
    rule = replace(RULE, error_probability=0.05)
    found, joint = mountings_of._confirmed(None, np.array([0, 0, 1, 2, 3, 4]), None, rule)  # type: ignore[arg-type]
    assert found.tolist() == [0, 0, 1, 0, 0, 2]
    assert joint.mountings.tolist() == [0, 1, 2]
    assert asked == [1, 2, 3, 4, 1, 2, 3, 1, 2]


def test_the_mounting_of_most_strips_is_the_first_whatever_single_strips_agree() -> None:
    single = np.arange(7) >= 3
    part, alike = np.array([0, 0, 0, 1, 1, 1, 1]), np.zeros((7, 5))
    assert mountings_of._numbered(part, single, alike).tolist() == [0, 0, 0, 1, 1, 1, 1]


def test_a_strip_stands_out_against_the_median_of_all() -> None:
    """Of two that are far off the mean would make outliers of all others."""
    most = RULE.beyond_chance(9)[0]
    left = np.zeros((9, 6))
    left[:2, 0] = 9.0 * most
    found = mountings_of._of_themselves(left, np.ones((9, 6), dtype=bool), RULE)
    assert found.tolist() == [True, True] + [False] * 7


def test_a_mount_that_slips_is_found_in_whatever_order_the_strips_are_numbered() -> None:
    strips = strips_flown(np.random.default_rng(7), (12,))
    remounted(strips, strips.place >= np.sort(strips.place)[6], (0.03, 0.0, 0.0), (0.0, 0.0))
    order = np.random.default_rng(8).permutation(12)
    mixed = replace(
        strips,
        **{item.name: getattr(strips, item.name)[order] for item in fields(strips) if item.name != "strip"},
    )
    found, again = found_mountings(strips, RULE).mounting, found_mountings(mixed, RULE).mounting
    assert len(np.unique(found)) == 2
    np.testing.assert_array_equal(np.equal.outer(again, again), np.equal.outer(found[order], found[order]))


def test_single_strips_that_are_linked_by_others_are_one_cluster() -> None:
    points = np.zeros((5, 5))
    points[:, 2] = [2.7, 0.9, 0.0, 1.8, 9.0]
    assert mountings_of._linked(points).tolist() == [0, 0, 0, 0, 1]


def test_parts_that_do_not_differ_are_joined_the_most_alike_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two flights, the second of which has slipped; a single strip; and one of which none is kept."""
    flight, part = np.array([0, 0, 1, 1, 1, 1, 2, 3]), np.array([0, 0, 1, 1, 2, 2, 3, 4])
    kept = np.arange(8) < 7
    chances = {(0, 2): 1e-9, (0, 4): 0.5, (0, 6): 0.01, (2, 4): 0.9, (2, 6): 1e-9, (4, 6): 1e-9}
    within = np.sqrt(2.0) * RULE.beyond_chance(8)
    limits_of = {pair: RULE.limits if pair in ((0, 2), (0, 4)) else within for pair in chances}

    def of(_strips: Any, present: Ints, given: Any) -> Any:
        np.testing.assert_array_equal(given, kept)

        def differing(one: int, other: int, limits: Any) -> float:
            pair = tuple(int(np.flatnonzero((present == name) & kept)[0]) for name in (one, other))
            np.testing.assert_array_equal(limits, limits_of[pair])
            return chances[pair]

        return SimpleNamespace(differing=differing)

    monkeypatch.setattr(mountings_of, "StripComparison", SimpleNamespace(of=of))
    strips: Any = SimpleNamespace(flight=flight)
    found = mountings_of._joined(strips, part, kept, RULE, 0.05)
    assert found.tolist() == [0, 0, 1, 1, 1, 1, 0, 0]
