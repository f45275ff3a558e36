from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.residual_grid import (
    LEAST_IN_CELL,
    ResidualGrid,
    residual_grid,
    residual_grids,
)
from adjust.result import ObservationStatus
from tests.adjust.calibration.camera_errors import NOTHING, cells, high_block

HALF = (0.05, 0.03)
MICROMETRE = 1e-6


def _places(random: np.random.Generator, number: int) -> Floats:
    return random.uniform(-1.0, 1.0, (number, 2)) * HALF


def _noise(seed: int, number: int = 15_000, side: int = 25) -> ResidualGrid:
    random = np.random.default_rng(seed)
    # Correlated coordinates of different size: Hotelling's test takes care of both.
    v = random.normal(size=(number, 2)) @ np.array([[0.7, 0.3], [0.0, 1.1]]) * MICROMETRE
    return residual_grid(FormatCells.of(HALF, side), _places(random, number), v)


def test_a_constant_field_is_recovered_exactly() -> None:
    xy = _places(np.random.default_rng(1), 3000)
    grid = residual_grid(FormatCells.of(HALF, 6), xy, np.tile([0.25, -0.5], (3000, 1)))
    np.testing.assert_array_equal(grid.mean, np.tile([0.25, -0.5], (36, 1)))
    np.testing.assert_array_equal(grid.sigma, 0.0)
    np.testing.assert_array_equal(grid.probability, 0.0)
    np.testing.assert_array_equal(grid.count.sum(axis=0), 3000)
    assert grid.largest == np.hypot(0.25, 0.5)


def test_no_residuals_at_all_are_not_significant() -> None:
    xy = _places(np.random.default_rng(1), 500)
    grid = residual_grid(FormatCells.of(HALF, 3), xy, np.zeros((500, 2)))
    np.testing.assert_array_equal(grid.probability, 1.0)
    assert not grid.jointly_significant().any()


@pytest.mark.parametrize("number", [4, 40, 700])
def test_means_sigmas_and_probabilities_are_those_of_the_residuals_in_the_cell(number: int) -> None:
    random = np.random.default_rng(number)
    division = FormatCells.of(HALF, 5)
    xy, v = _places(random, number), random.normal(0.1, 0.8, (number, 2))
    grid = residual_grid(division, xy, v)
    x_edges, y_edges = np.linspace(-0.05, 0.05, 6), np.linspace(-0.03, 0.03, 6)
    for cell in range(25):
        row, column = divmod(cell, 5)
        inside = (xy[:, 0] >= x_edges[column]) & (xy[:, 0] < x_edges[column + 1])
        inside &= (xy[:, 1] >= y_edges[row]) & (xy[:, 1] < y_edges[row + 1])
        own, n = v[inside], int(inside.sum())
        np.testing.assert_array_equal(grid.count[cell], n)
        assert grid.known[cell] == (n >= LEAST_IN_CELL)
        if n < LEAST_IN_CELL:
            assert np.isnan(grid.mean[cell]).all()
            assert np.isnan(grid.probability[cell])
            continue
        np.testing.assert_allclose(grid.mean[cell], own.mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(grid.sigma[cell], own.std(axis=0, ddof=1) / np.sqrt(n), rtol=1e-12)
        m = own.mean(axis=0)
        square = n * m @ np.linalg.solve(np.cov(own.T), m)
        expected = stats.f.sf((n - 2) / (2 * (n - 1)) * square, 2, n - 2)
        assert grid.probability[cell] == pytest.approx(expected, rel=1e-9)


def test_each_coordinate_has_its_own_residuals_and_the_common_ones_their_covariance() -> None:
    random = np.random.default_rng(6)
    division = FormatCells.of(HALF, 2)
    xy, chosen = _places(random, 400), random.uniform(size=(400, 2)) < [0.4, 0.9]
    v = random.normal(size=(400, 2)) @ np.array([[1.0, 0.8], [0.0, 0.6]]) + 0.2
    grid = residual_grid(division, xy, v, chosen)
    cell = division.cell_of(xy)
    for number in range(4):
        masks = [chosen[:, k] & (cell == number) for k in (0, 1)]
        counts = [int(mask.sum()) for mask in masks]
        assert grid.count[number].tolist() == counts
        mean = np.array([v[mask, k].mean() for k, mask in enumerate(masks)])
        np.testing.assert_allclose(grid.mean[number], mean)
        covariance = np.diag([v[mask, k].var(ddof=1) / mask.sum() for k, mask in enumerate(masks)])
        common = masks[0] & masks[1]
        mixed = np.sum(np.prod(v[common] - mean, axis=1)) / (common.sum() - 1)
        covariance[0, 1] = covariance[1, 0] = mixed * common.sum() / (counts[0] * counts[1])
        square, n = mean @ np.linalg.solve(covariance, mean), stats.hmean(counts)
        expected = stats.f.sf((n - 2) / (2 * (n - 1)) * square, 2, n - 2)
        assert grid.probability[number] == pytest.approx(expected, rel=1e-9)


def test_where_one_coordinate_is_not_controlled_the_other_is_tested_alone() -> None:
    random = np.random.default_rng(8)
    xy, v = _places(random, 60), random.normal(0.4, 1.0, (60, 2))
    only_y = np.tile([False, True], (60, 1))
    grid = residual_grid(FormatCells.of(HALF, 1), xy, v, only_y)
    assert np.isnan(grid.mean[0, 0])
    assert grid.known.all()
    assert grid.probability[0] == pytest.approx(stats.ttest_1samp(v[:, 1], 0.0).pvalue, rel=1e-9)
    assert grid.largest == pytest.approx(abs(v[:, 1].mean()))
    nothing = residual_grid(FormatCells.of(HALF, 1), xy, v, np.zeros((60, 2), dtype=bool))
    assert not nothing.known.any()
    assert np.isnan(nothing.largest)


def test_different_numbers_in_both_coordinates_keep_the_level_of_the_test() -> None:
    shares = []
    for seed in range(30):
        random = np.random.default_rng(seed)
        v = random.normal(size=(15_000, 2)) @ np.array([[1.0, 0.5], [0.0, 1.0]])
        chosen = random.uniform(size=(15_000, 2)) < [0.5, 1.0]
        grid = residual_grid(FormatCells.of(HALF, 25), _places(random, 15_000), v, chosen)
        shares.append(grid.significant()[grid.known].mean())
    assert np.mean(shares) == pytest.approx(0.05, abs=0.008)


def test_chance_alone_makes_as_many_cells_significant_as_the_confidence_says() -> None:
    grids = [_noise(seed) for seed in range(40)]
    for confidence in (0.95, 0.99):
        share = np.mean([grid.significant(confidence)[grid.known] for grid in grids])
        expected = grids[0].expected_by_chance(confidence) / grids[0].known.sum()
        # 25,000 cells: four standard deviations.
        assert share == pytest.approx(1 - confidence, abs=4 * np.sqrt(confidence * (1 - confidence) / 25_000))
        assert expected == pytest.approx(1 - confidence)


def test_with_few_residuals_in_a_cell_the_level_still_holds() -> None:
    found = [_noise(seed, number=4000) for seed in range(60)]
    share = np.mean(np.concatenate([grid.significant()[grid.known] for grid in found]))
    assert np.median(found[0].count) < 8
    assert share == pytest.approx(0.05, abs=0.006)


def test_among_all_cells_together_chance_finds_hardly_any() -> None:
    # By Benjamini and Hochberg at most 5 % of the grids have one at all.
    with_any = sum(_noise(seed).jointly_significant().any() for seed in range(60))
    assert with_any <= 8


@pytest.mark.parametrize(
    "given",
    [
        [0.001, 0.008, 0.039, 0.041, 0.042, 0.06, 0.074, 0.205, 0.212, 0.216, np.nan] + [0.9] * 5,
        # Cells that are not tested count for nothing.
        [0.001, 0.015, 0.02, 0.5, 0.6] + [np.nan] * 11,
    ],
)
def test_joint_significance_is_the_rule_of_benjamini_and_hochberg(given: list[float]) -> None:
    grid, probability = _noise(3, side=4), np.array(given)
    mean = np.where(np.isnan(probability)[:, None], np.nan, grid.mean)
    judged = ResidualGrid(grid.cells, grid.count, mean, grid.sigma, probability)
    adjusted = stats.false_discovery_control(probability[judged.known])
    np.testing.assert_array_equal(judged.jointly_significant()[judged.known], adjusted <= 0.05)


def test_the_signal_is_freed_of_the_noise() -> None:
    random = np.random.default_rng(5)
    xy = _places(random, 20_000)
    true = np.stack([0.3 * np.sin(xy[:, 0] / 0.05 * 3), 0.2 * np.cos(xy[:, 1] / 0.03 * 3)], axis=1)
    grid = residual_grid(FormatCells.of(HALF, 25), xy, true + random.normal(0, 0.8, true.shape))
    expected = np.sqrt(np.mean(true**2, axis=0))
    assert grid.signal == pytest.approx(expected, rel=0.08)
    assert np.all(grid.rms > 1.1 * expected)
    # 32 points in a cell.
    assert grid.noise == pytest.approx(0.8 / np.sqrt(32), rel=0.05)


def test_every_set_of_images_has_the_means_of_its_own_image_points() -> None:
    random = np.random.default_rng(7)
    division = FormatCells.of(HALF, 3)
    image, xy = random.integers(0, 6, 4000), _places(random, 4000)
    v, chosen = random.normal(size=(4000, 2)), random.uniform(size=(4000, 2)) < 0.8
    grid_of_image = np.array([0, 2, 0, 2, 2, 0])
    grids = residual_grids((division, None, division), grid_of_image, image, xy, v, chosen)
    assert grids[1] is None
    for number in (0, 2):
        own = np.isin(image, np.flatnonzero(grid_of_image == number))
        alone = residual_grid(division, xy[own], v[own], chosen[own])
        found = grids[number]
        assert found is not None
        np.testing.assert_array_equal(found.mean, alone.mean)


def test_a_simulated_block_without_errors_of_the_camera_has_five_percent_of_significant_cells() -> None:
    test = high_block(NOTHING)
    rays = test.result.groups[0]
    chosen = controlled(rays)
    shares = []
    for seed in range(6):
        other = test if seed == 0 else high_block(NOTHING, seed=100 + seed)
        v, xy = other.result.groups[0].residual, test.observations.image_points.xy
        grid = residual_grid(cells(25), xy, v, chosen)
        shares.append(grid.significant()[grid.known].mean())
        assert grid.rms == pytest.approx(grid.noise, rel=0.1)
    # 3,700 cells; the residuals of a block are not quite independent.
    assert np.mean(shares) == pytest.approx(0.05, abs=0.015)


def test_only_residuals_that_show_errors_count() -> None:
    rays = high_block(NOTHING).result.groups[0]
    chosen = controlled(rays)
    assert np.all(chosen.mean(axis=0) > 0.5)
    assert not chosen.all()
    assert np.all(rays.redundancy[chosen] > 0.2)
    assert np.all(rays.status[chosen] == ObservationStatus.USED)
