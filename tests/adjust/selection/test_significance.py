from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from adjust.selection.linear_estimate import LinearEstimate
from adjust.selection.significance import (
    difference_test,
    entering_t_values,
    group_test,
    limit_of_t,
    t_values,
)
from tests.adjust.calibration.designs import Design, random_design

NO_PRIOR = np.array([np.nan, np.nan])


def two_means(first: list[float], second: list[float]) -> LinearEstimate:
    """Two parameters observed directly, some times each."""
    n, m = len(first), len(second)
    matrix = np.zeros((n + m, 2))
    matrix[:n, 0] = matrix[n:, 1] = 1.0
    design = Design(matrix, np.zeros((n + m, 0)), np.array(first + second), NO_PRIOR, np.zeros(2))
    return LinearEstimate.of(design.normals)


FIRST, SECOND = [1.0, 2.0, 1.5, 0.5, 1.2], [0.2, 0.7, -0.4, 0.9]


def test_limits_are_those_of_the_tables() -> None:
    assert limit_of_t(0.05, None) == pytest.approx(1.960, abs=5e-4)
    assert limit_of_t(0.01, None) == pytest.approx(2.576, abs=5e-4)
    assert limit_of_t(0.05, 10) == pytest.approx(2.228, abs=5e-4)
    assert limit_of_t(0.01, 5) == pytest.approx(4.032, abs=5e-4)


def test_the_difference_of_two_sets_is_the_two_sample_t_test() -> None:
    estimate = two_means(FIRST, SECOND)
    found = difference_test(estimate, np.array([0]), np.array([1]), 0.05)
    expected = stats.ttest_ind(FIRST, SECOND)
    assert found.t[0] == pytest.approx(expected.statistic)
    assert found.joint.statistic == pytest.approx(expected.statistic**2)
    assert found.joint.probability == pytest.approx(expected.pvalue)
    assert found.joint.critical == pytest.approx(stats.f.ppf(0.95, 1, 7))
    assert found.joint.is_significant == (expected.pvalue < 0.05)


def test_with_a_known_sigma0_the_tests_are_normal_and_chi_square() -> None:
    estimate = two_means(FIRST, SECOND)
    t = t_values(estimate, sigma0=0.5)
    assert t[0] == pytest.approx(np.mean(FIRST) * np.sqrt(5) / 0.5)
    group = group_test(estimate, np.array([True, True]), 0.01, sigma0=0.5)
    assert group.statistic == pytest.approx(float(t @ t) / 2)
    assert group.probability == pytest.approx(stats.chi2.sf(float(t @ t), 2), rel=1e-6)
    assert group.critical == pytest.approx(stats.chi2.ppf(0.99, 2) / 2)


def test_correlated_sets_are_compared_with_the_covariance_of_their_differences() -> None:
    estimate = LinearEstimate.of(random_design(2, priors=False).normals)
    first, second = np.array([0, 1, 2]), np.array([4, 5, 6])
    contrast = np.eye(8)[first] - np.eye(8)[second]
    covariance = estimate.sigma0**2 * contrast @ estimate.cofactor @ contrast.T
    difference = contrast @ estimate.change
    found = difference_test(estimate, first, second, 0.05)
    np.testing.assert_allclose(found.sigma, np.sqrt(np.diagonal(covariance)))
    assert found.joint.statistic == pytest.approx(difference @ np.linalg.solve(covariance, difference) / 3)


@given(st.integers(0, 10_000), st.sets(st.integers(0, 7), min_size=1))
def test_the_f_of_a_group_is_the_rise_of_the_squares_without_it(seed: int, chosen: set[int]) -> None:
    design = random_design(seed, priors=False)
    estimate = LinearEstimate.of(design.normals)
    members = np.isin(np.arange(8), list(chosen))
    *_, squares, redundancy = design.solved(np.ones(8, dtype=bool))
    *_, without, _ = design.solved(~members)
    expected = (without - squares) / len(chosen) / (squares / redundancy)
    found = group_test(estimate, members, 0.05)
    assert found.statistic == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert found.probability == pytest.approx(
        stats.f.sf(expected, len(chosen), redundancy), rel=1e-4, abs=1e-12
    )


def test_the_f_of_one_parameter_is_the_square_of_its_t() -> None:
    estimate = LinearEstimate.of(random_design(1).normals)
    t = t_values(estimate)
    for k in range(8):
        assert group_test(estimate, np.arange(8) == k, 0.05).statistic == pytest.approx(t[k] ** 2)


@given(st.integers(0, 10_000), st.permutations(range(8)))
def test_what_a_dropped_parameter_would_show_is_what_it_shows_once_it_is_back(
    seed: int, order: list[int]
) -> None:
    estimate = LinearEstimate.of(random_design(seed).normals)
    for d in order[:4]:
        estimate = estimate.without(d)
    for sigma0 in (None, 0.7):
        foreseen = entering_t_values(estimate, sigma0)
        assert np.isnan(foreseen[order[4:]]).all()
        for d in order[:4]:
            t = t_values(estimate.with_free(d), sigma0)[d]
            assert foreseen[d] == pytest.approx(t, rel=1e-6, abs=1e-9)


def test_parameters_held_in_both_sets_are_not_compared() -> None:
    estimate = LinearEstimate.of(random_design(2, priors=False).normals).without(1).without(5).without(2)
    found = difference_test(estimate, np.array([0, 1, 2]), np.array([4, 5, 6]), 0.05)
    assert found.compared.tolist() == [0, 2]
    assert found.difference[1] == pytest.approx(-estimate.change[6])
    with pytest.raises(ValueError, match="none of the parameters"):
        difference_test(estimate, np.array([1]), np.array([5]), 0.05)


def test_equal_sets_are_found_different_as_rarely_as_promised() -> None:
    generator = np.random.default_rng(8)
    matrix = generator.normal(size=(40, 6))
    nothing = np.full(6, np.nan)
    alarms = 0
    for _ in range(1000):
        observed = matrix @ np.tile([1.0, -2.0, 0.5], 2) + 0.3 * generator.normal(size=40)
        design = Design(matrix, np.zeros((40, 0)), observed, nothing, np.zeros(6))
        found = difference_test(LinearEstimate.of(design.normals), np.arange(3), np.arange(3, 6), 0.05)
        alarms += found.joint.is_significant
    # 50 expected; three standard deviations of the binomial distribution are 21.
    assert abs(alarms - 50) <= 21
