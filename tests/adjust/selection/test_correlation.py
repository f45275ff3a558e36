from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.selection.correlation import (
    correlated_groups,
    correlation_matrix,
    total_correlation,
    total_correlation_in_block,
    total_correlation_within,
    variance_inflation,
)
from adjust.selection.linear_estimate import LinearEstimate
from tests.adjust.calibration.designs import random_design


def test_of_two_parameters_the_total_correlation_is_the_pairwise_one() -> None:
    cofactor = np.array([[4.0, -3.0], [-3.0, 9.0]])
    assert correlation_matrix(cofactor)[0, 1] == pytest.approx(-0.5)
    assert total_correlation(cofactor) == pytest.approx([0.5, 0.5])
    assert variance_inflation(total_correlation(cofactor)) == pytest.approx([4.0 / 3.0] * 2)


def test_no_parameters_have_no_correlations() -> None:
    assert total_correlation(np.zeros((0, 0))).shape == (0,)


@given(st.integers(0, 10_000))
def test_the_total_correlation_is_that_with_the_best_combination_of_the_others(seed: int) -> None:
    cofactor = LinearEstimate.of(random_design(seed).normals).cofactor
    total = total_correlation(cofactor)
    for i in range(len(cofactor)):
        others = np.arange(len(cofactor)) != i
        scale = np.sqrt(np.diagonal(cofactor))
        scaled = cofactor / np.outer(scale, scale)
        explained = scaled[i, others] @ np.linalg.solve(scaled[np.ix_(others, others)], scaled[others, i])
        assert total[i] ** 2 == pytest.approx(explained, abs=1e-7)
    assert np.all(total >= np.abs(correlation_matrix(cofactor) - np.eye(len(total))).max(axis=1) - 1e-7)


@given(st.integers(0, 10_000), st.sets(st.integers(0, 7), min_size=1, max_size=5))
def test_the_more_others_are_counted_the_larger_the_total_correlation(seed: int, left: set[int]) -> None:
    estimate = LinearEstimate.of(random_design(seed).normals).without(0)
    members = np.isin(np.arange(8), list(left))
    some = total_correlation_within(estimate, members)
    everything = total_correlation_within(estimate, np.ones(8, dtype=bool))
    in_block = total_correlation_in_block(estimate)
    known = members & estimate.free
    assert np.isnan(some[~known]).all()
    assert np.isnan(in_block[0])
    assert np.isnan(everything[0])
    assert np.all(some[known] <= everything[known] + 1e-7)
    assert np.all(everything[1:] <= in_block[1:] + 1e-7)


def test_parameters_are_in_one_group_if_a_chain_of_correlations_links_them() -> None:
    correlation = np.eye(6)
    for a, b, value in ((0, 3, 0.97), (3, 4, -0.99), (1, 5, 0.995), (2, 5, 0.9)):
        correlation[a, b] = correlation[b, a] = value
    assert list(correlated_groups(correlation, 0.95).items()) == [((1, 5), 0.995), ((0, 3, 4), -0.99)]
    assert correlated_groups(correlation, 0.98) == {(1, 5): 0.995, (3, 4): -0.99}
    assert correlated_groups(np.full((2, 2), np.nan), 0.95) == {}
    assert correlated_groups(np.zeros((0, 0)), 0.95) == {}
