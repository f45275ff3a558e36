"""What would have to be larger or smaller than it can be is no explanation of a contradiction."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.quality.model_alternatives import AlternativeTests
from tasks.evaluation.model_test_tables import possible_explanation

CRITICAL = np.array([4.0, 4.0, 4.0])
UNLIMITED, ANY = np.full(3, np.inf), np.zeros(3)


def with_joint_sizes(sizes: list[float]) -> AlternativeTests:
    """Three alternatives of these joint sizes: the first two nearly alike, σ of each alone 0.1."""
    correlation = np.array([[1.0, 0.999, 0.0], [0.999, 1.0, 0.0], [0.0, 0.0, 1.0]])
    normal = correlation / 0.1**2
    return AlternativeTests(normal @ np.array(sizes), normal, np.zeros((0, 3)), np.ones(3, dtype=bool))


def test_of_two_that_are_nearly_alike_the_impossible_one_is_left_out() -> None:
    tests = with_joint_sizes([30.0, -29.0, 1.0])
    assert set(possible_explanation(tests, CRITICAL, ANY, UNLIMITED, 1.0)) == {0, 1, 2}
    most = np.array([3.0, np.inf, np.inf])
    assert set(possible_explanation(tests, CRITICAL, ANY, most, 1.0)) == {1, 2}


@pytest.mark.parametrize("size", [1.0, -2.0, 3.4, 500.0])
def test_what_is_significant_by_itself_stays_whatever_its_size(size: float) -> None:
    tests = with_joint_sizes([0.0, 0.0, size])
    assert possible_explanation(tests, CRITICAL, ANY, np.full(3, 3.0), 1.0) == (2,)


def test_what_is_too_large_by_itself_gives_way_to_one_that_is_nearly_alike_and_possible() -> None:
    """Refraction thirty times as large as it is looks like a distortion."""
    tests = with_joint_sizes([31.7, 0.0, 0.0])
    assert possible_explanation(tests, CRITICAL, ANY, UNLIMITED, 1.0) == (0,)
    assert possible_explanation(tests, CRITICAL, ANY, np.array([3.0, np.inf, 3.0]), 1.0) == (1,)
    assert possible_explanation(tests, CRITICAL, ANY, np.full(3, 3.0), 1.0) == (0,)


def test_a_contradiction_that_nothing_else_explains_stays() -> None:
    """Without the impossible one the other is not significant."""
    tests = with_joint_sizes([300.0, -299.7, 0.0])
    most = np.array([3.0, np.inf, np.inf])
    assert (
        set(tests.explanation(CRITICAL))
        == set(possible_explanation(tests, CRITICAL, ANY, most, 1.0))
        != set()
    )


@pytest.mark.parametrize(("scale", "found"), [(1.0, {1}), (50.0, {0, 1})])
def test_three_sigma_of_the_joint_size_are_allowed(scale: float, found: set[int]) -> None:
    tests = with_joint_sizes([20.0, -19.0, 0.0])
    most = np.array([3.0, np.inf, np.inf])
    assert set(possible_explanation(tests, CRITICAL, ANY, most, scale)) == found


def test_a_small_part_of_what_is_wrong_as_a_whole_or_not_at_all_gives_way_to_one_that_is_nearly_alike() -> (
    None
):
    """A yaw of 0.01° looks like 1 % of the other north, sometimes a little more than like itself."""
    tests = with_joint_sizes([1.0, 0.0, 0.0])
    for least, found in ((ANY, 0), (np.array([1.4, 0.0, 0.0]), 1), (np.array([1.2, 0.0, 0.0]), 0)):
        assert possible_explanation(tests, CRITICAL, least, UNLIMITED, 1.0) == (found,)
    # Nothing else explains it.
    least = np.array([1.4, 1.4, 0.0])
    assert possible_explanation(tests, CRITICAL, least, UNLIMITED, 1.0) == (0,)
