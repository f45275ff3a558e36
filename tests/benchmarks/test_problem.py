"""The arrays both sides start from, and the function that judges both."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from benchmarks.problem import Problem, Solution, block_of, cost, solution_of
from benchmarks.workload import GROWTH, WORKLOADS, Workload, simulated

TINY = Workload("tiny", 3, 6)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return simulated(TINY)


def test_the_operational_block_has_the_size_it_is_known_for() -> None:
    (operational,) = (item for item in WORKLOADS if item.name == "dmc2-230")
    assert operational.images == 2448
    assert "points.count=188000" in operational.overrides
    assert [item.images for item in GROWTH] == [500, 2448, 10_000, 25_000, 50_000]
    assert [item.large for item in GROWTH] == [False, False, False, True, True]


def test_a_workload_has_its_images_and_the_noise_it_is_weighted_with(problem: Problem) -> None:
    assert len(problem.projection_centre) == TINY.images
    np.testing.assert_allclose(problem.sigma_image, 1.5e-6)
    np.testing.assert_allclose(problem.position_sigma, 0.05)


def test_it_comes_back_from_its_file_bit_by_bit(problem: Problem, tmp_path: Path) -> None:
    problem.write(tmp_path / "problem.npz")
    problem.start.write(tmp_path / "solution.npz")
    again = Problem.read(tmp_path / "problem.npz")
    for name in ("xy", "image", "point", "position", "local_from_enu", "object_point", "interior"):
        np.testing.assert_array_equal(getattr(again, name), getattr(problem, name))
    start = Solution.read(tmp_path / "solution.npz")
    np.testing.assert_array_equal(start.local_from_camera, problem.local_from_camera)


def test_the_cost_is_that_of_the_adjustment(problem: Problem) -> None:
    result = adjust_block(*block_of(problem))
    adjusted = solution_of(result.state)
    assert cost(problem, adjusted) == pytest.approx(result.test.weighted_squares, rel=1e-10)
    assert cost(problem, problem.start) == pytest.approx(result.iterations[0][0].weighted_squares, rel=1e-10)
    assert cost(problem, adjusted) < cost(problem, problem.start)


def test_the_cost_counts_positions_in_the_axes_of_their_sigmas(problem: Problem) -> None:
    sigma = np.tile([0.01, 0.05, 0.2], (TINY.images, 1))
    weighted = replace(problem, position_sigma=sigma)
    moved = replace(problem.start, projection_centre=problem.position + 0.2 * problem.local_from_enu[:, :, 2])
    unmoved = replace(weighted, position=moved.projection_centre)
    assert cost(weighted, moved) - cost(unmoved, moved) == pytest.approx(TINY.images)
    expected = problem.local_from_enu[0] @ np.diag(sigma[0] ** 2) @ problem.local_from_enu[0].T
    np.testing.assert_allclose(weighted.position_covariance[0], expected)
