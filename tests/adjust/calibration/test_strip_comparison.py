"""Groups of strips against each other, and strips that stand out: definitions, limits and invariances."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import optimize, stats

from adjust.calibration.outlying_strips import extreme_deviates, outlying_strips
from adjust.calibration.strip_comparison import StripComparison, chances, least_chance, serial_increase
from adjust.calibration.strip_means import StripMeans
from tests.adjust.calibration.strips_flown import remounted, strips_flown


def rows_of(strips: StripMeans, rows: np.ndarray) -> StripMeans:
    return replace(strips, **{item.name: getattr(strips, item.name)[rows] for item in fields(strips)})


def followed() -> StripMeans:
    """Two flights whose strips share slow errors; the second with another roll and lever arm."""
    strips = strips_flown(np.random.default_rng(21), (9, 10), correlation=0.8)
    remounted(strips, strips.flight == 1, (0.001, 0.0, 0.0), (0.03, 0.0))
    return strips


def test_slow_errors_make_the_comparison_of_boresights_weaker() -> None:
    """Closed case: the t-test of two means, with a variance that the correlation ρ increases."""
    strips = followed()
    found = StripComparison.of(strips, strips.flight)
    for axis, values in enumerate(strips.mean[:, :3].T):
        left = values - np.where(strips.flight == 0, values[:9].mean(), values[9:].mean())
        increase = serial_increase(left[:, None], strips.flight)
        variance = increase * left @ left / 17.0 * (1.0 / 9.0 + 1.0 / 10.0)
        statistic = (values[9:].mean() - values[:9].mean()) / np.sqrt(variance)
        assert found.probabilities(1, 0)[axis] == pytest.approx(2.0 * stats.t.sf(abs(statistic), 17))
        assert found.differences(1, 0)[1][axis, axis] == pytest.approx(variance)
        assert axis > 0 or increase > 1.2


def test_the_order_of_strips_is_that_of_flight_and_time_and_others_take_no_part() -> None:
    strips = followed()
    expected = StripComparison.of(strips, strips.flight).probabilities(0, 1)
    order = np.random.default_rng(3).permutation(19)
    # Times of the day of two days, and strips in any order.
    mixed = rows_of(replace(strips, place=strips.place - 9.5 * strips.flight), order)
    np.testing.assert_allclose(StripComparison.of(mixed, mixed.flight).probabilities(0, 1), expected)
    kept = np.random.default_rng(4).random(19) < 0.7
    few = rows_of(strips, kept)
    np.testing.assert_allclose(
        StripComparison.of(strips, strips.flight, kept).probabilities(0, 1),
        StripComparison.of(few, few.flight).probabilities(0, 1),
    )


def test_correlations_of_neighbours_are_limited_and_those_of_two_coordinates_are_one() -> None:
    one = np.zeros(50, dtype=np.int64)
    assert serial_increase(np.zeros((50, 1)), one) == 1.0
    assert serial_increase(np.ones((50, 2)), one) == pytest.approx(1.9 / 0.1)
    line = np.cumsum(np.random.default_rng(5).normal(size=(50, 1)) / 10.0, axis=0) % 1.0 - 0.5
    alone = serial_increase(line, one)
    assert 1.5 < alone < 15.0
    assert serial_increase(np.hstack([line, -line]), one) == pytest.approx(alone)


def test_chances_are_those_of_student_and_fisher_each_with_its_own_degrees_of_freedom() -> None:
    difference, freedom = np.array([0.3, -0.5, 0.8, 0.6, -0.9]), np.array([3.0, 5.0, 8.0, 11.0])
    covariance = np.diag([0.04, 0.09, 0.16, 0.2, 0.3])
    covariance[3, 4] = covariance[4, 3] = -0.1
    in_plan = difference[3:] @ np.linalg.inv(covariance[3:, 3:]) @ difference[3:]
    t = difference[:3] / np.sqrt(np.diagonal(covariance)[:3])
    expected = [*(2.0 * stats.t.sf(np.abs(t), freedom[:3])), stats.f.sf(in_plan / 2.0, 2, 11)]
    np.testing.assert_allclose(chances(difference, covariance, freedom), expected)
    # Of the ones that exceed their limits the least; in plan it is the length, 1.08.
    for limits, best in (
        ([0.29, 0.49, 0.79, 1.08], min(expected)),
        ([0.31, 0.49, 0.81, 1.09], expected[1]),
        ([0.31, 0.51, 0.81, 1.08], expected[3]),
        ([0.29, 0.51, 0.81, 1.09], expected[0]),
        ([0.31, 0.51, 0.81, 1.09], 1.0),
    ):
        assert least_chance(difference, covariance, freedom, np.array(limits)) == pytest.approx(best)


def test_without_any_scatter_what_differs_is_certain_and_what_does_not_is_not() -> None:
    nothing, freedom = np.zeros((5, 5)), np.full(4, 6.0)
    np.testing.assert_array_equal(chances(np.zeros(5), nothing, freedom), 1.0)
    np.testing.assert_array_equal(chances(np.full(5, 1e-6), nothing, freedom), 0.0)
    assert np.isnan(chances(np.full(5, 1e-6), np.eye(5), np.zeros(4))).all()


@pytest.mark.parametrize(("of_threshold", "outlying"), [(0.99, False), (1.01, True)])
def test_the_probability_is_divided_among_the_components(of_threshold: float, outlying: bool) -> None:
    """The critical value of Grubbs for one of twenty values and a sixth of 5 %."""
    t = stats.t.isf(0.05 / 6.0 / 40.0, 18)
    critical = 19.0 * t / np.sqrt((18.0 + t**2) * 20.0)
    others = stats.norm.ppf((np.arange(19) + 0.5) / 19.0)

    def excess(value: float) -> float:
        values = np.append(others, value)
        return float((value - values.mean()) / values.std(ddof=1) - of_threshold * critical)

    values = np.tile(np.append(others, 0.0)[:, None], 6)
    values[-1, 2] = optimize.brentq(excess, 2.0, 20.0)
    assert outlying_strips(values, 0.05).any() == outlying


def test_fewer_than_half_of_the_values_are_taken_away() -> None:
    assert (
        extreme_deviates(np.array([0.0, 0.01, -0.01, 10.0, 11.0]), 0.05).tolist() == [False] * 3 + [True] * 2
    )
    assert extreme_deviates(np.array([0.0, 0.01, -0.01, 10.0, 11.0, 12.0]), 0.05).sum() <= 2


def test_what_stands_out_does_not_depend_on_the_value_of_all() -> None:
    values = np.append(np.random.default_rng(6).normal(size=15), 7.0)
    for shift in (0.0, 1e5, -1e7):
        assert np.flatnonzero(extreme_deviates(values + shift, 0.01)).tolist() == [15]
