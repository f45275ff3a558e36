"""σ0 and its test."""

from __future__ import annotations

import math

import pytest
from scipy import stats

from adjust.quality.global_test import global_test


def test_sigma0_is_the_root_of_the_mean_square_per_redundancy() -> None:
    assert global_test(250.0, 200).sigma0 == pytest.approx(math.sqrt(1.25))


def test_limits_are_the_tabulated_chi_square_quantiles() -> None:
    # χ² with 10 degrees of freedom: 3.247 and 20.483 at 2.5 % and 97.5 %.
    test = global_test(10.0, 10)
    assert (test.lower, test.upper) == pytest.approx((math.sqrt(0.3247), math.sqrt(2.0483)), rel=1e-4)
    assert test.passed


@pytest.mark.parametrize(("squares", "passed"), [(3.2, False), (3.3, True), (20.4, True), (20.5, False)])
def test_too_small_and_too_large_squares_fail(squares: float, passed: bool) -> None:
    assert global_test(squares, 10).passed is passed


def test_limits_hold_with_the_stated_probability() -> None:
    test = global_test(50.0, 50, confidence=0.90)
    inside = stats.chi2.cdf(50 * test.upper**2, 50) - stats.chi2.cdf(50 * test.lower**2, 50)
    assert inside == pytest.approx(0.90)


def test_without_redundancy_there_is_no_sigma0_and_nothing_passes() -> None:
    test = global_test(0.0, 0)
    assert math.isnan(test.sigma0)
    assert not test.passed
