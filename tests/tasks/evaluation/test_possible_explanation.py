"""What would have to be larger than it can be is no explanation of a contradiction."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.quality.model_alternatives import AlternativeTests
from tasks.evaluation.model_test_tables import possible_explanation

CRITICAL = np.array([4.0, 4.0, 4.0])
UNLIMITED = np.full(3, np.inf)


def with_joint_sizes(sizes: list[float]) -> AlternativeTests:
    """Three alternatives of these joint sizes: the first two nearly alike, σ of each alone 0.1."""
    correlation = np.array([[1.0, 0.999, 0.0], [0.999, 1.0, 0.0], [0.0, 0.0, 1.0]])
    normal = correlation / 0.1**2
    return AlternativeTests(normal @ np.array(sizes), normal, np.zeros((0, 3)))


def test_of_two_that_are_nearly_alike_the_impossible_one_is_left_out() -> None:
    tests = with_joint_sizes([30.0, -29.0, 1.0])
    assert set(possible_explanation(tests, CRITICAL, UNLIMITED, 1.0)) == {0, 1, 2}
    most = np.array([3.0, np.inf, np.inf])
    assert set(possible_explanation(tests, CRITICAL, most, 1.0)) == {1, 2}


@pytest.mark.parametrize(("size", "found"), [(1.0, True), (-2.0, True), (3.2, True), (3.4, False)])
def test_a_possible_size_is_an_explanation_within_three_sigma(size: float, found: bool) -> None:
    order = possible_explanation(with_joint_sizes([0.0, 0.0, size]), CRITICAL, np.full(3, 3.0), 1.0)
    assert order == ((2,) if found else ())


def test_a_larger_scale_of_all_sigmas_makes_the_limit_wider() -> None:
    order = possible_explanation(with_joint_sizes([0.0, 0.0, 3.4]), 2.0 * CRITICAL, np.full(3, 3.0), 2.0)
    assert order == (2,)
