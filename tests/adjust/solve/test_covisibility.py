"""The pattern of the reduced normal equations, and how correlation over time adds to it."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.parameters import BORESIGHT
from adjust.quality.cofactor import cofactor
from adjust.quality.redundancy import group_residuals
from adjust.solve.covisibility import covisibility
from adjust.solve.design_matrix import design_matrix, full_cofactor, redundancy_numbers
from adjust.solve.factorization import factorize
from adjust.solve.gauss_newton import Solution
from adjust.solve.normal_equations import reduced_normals
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips, with_rejected_positions

# Five positions in a row: those on either side are 1,700 m apart, the images 700 m long.
IN_A_ROW = (3, 4, 5, 6, 7)


def one_long_strip() -> Scene:
    return two_strips(
        strips=1,
        images_per_strip=12,
        points_along=26,
        free={BORESIGHT: True},
        noise_seed=3,
        gnss_correlation_s=40.0,
    )


def test_blocks_are_found_whichever_image_comes_first() -> None:
    scene = one_long_strip()
    pattern = covisibility(scene.observations.image_points, 12, len(scene.block.points))
    for position, (i, j) in enumerate(zip(pattern.row, pattern.column, strict=True)):
        assert pattern.find(np.array([i, j]), np.array([j, i])).tolist() == [position, position]
    assert pattern.find(np.array([0, 11]), np.array([11, 0])).tolist() == [-1, -1]


def test_pairs_are_added_in_their_place_and_only_once() -> None:
    scene = one_long_strip()
    pattern = covisibility(scene.observations.image_points, 12, len(scene.block.points))
    assert pattern.with_pairs(pattern.row, pattern.column) is pattern
    larger = pattern.with_pairs(np.array([11, 0, 3]), np.array([0, 11, 3]))
    assert len(larger.column) == len(pattern.column) + 1
    assert larger.find(np.array([0]), np.array([11]))[0] >= 0
    np.testing.assert_array_equal(larger.column[larger.diagonal], np.arange(12))
    for i in range(12):
        row = larger.column[larger.row_start[i] : larger.row_start[i + 1]]
        assert (np.diff(row) > 0).all()


def test_rejection_joins_what_stood_on_either_side() -> None:
    scene = one_long_strip()
    left = with_rejected_positions(scene, IN_A_ROW)
    before = System.of(scene.block, scene.observations)
    assert before.pattern.find(np.array([2]), np.array([8]))[0] < 0
    system = before.remaining(left.observations)
    assert system.pattern.find(np.array([2]), np.array([8]))[0] >= 0
    # What is rejected is tested between the neighbours it would have.
    assert (system.pattern.find(np.array([5, 5]), np.array([2, 8])) >= 0).all()
    white = two_strips(strips=1, images_per_strip=12, points_along=26)
    unchanged = System.of(white.block, white.observations)
    assert unchanged.remaining(white.observations).blocking is unchanged.blocking

    state = scene.block.approximate_state()
    normals = reduced_normals(system, state)
    found = group_residuals(system, state, cofactor(system, Solution(state, normals, factorize(normals), ())))
    design = design_matrix(system, state)
    for ours, theirs in zip(found, redundancy_numbers(system, design, full_cofactor(design)), strict=True):
        np.testing.assert_allclose(ours.redundancy, theirs, atol=1e-9)
    total = sum(float(np.nansum(item.redundancy)) for item in found)
    assert total == pytest.approx(system.redundancy, abs=1e-6)


def test_an_adjustment_that_starts_without_them_is_the_same() -> None:
    scene = one_long_strip()
    left = with_rejected_positions(scene, IN_A_ROW)
    result = adjust_block(left.block, left.observations)
    system = System.of(scene.block, scene.observations).remaining(left.observations)
    again = reduced_normals(system, result.state)
    solved, _ = factorize(again).solve()
    assert np.abs(solved).max() < 1e-6
