from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.residual_grid.comparison import combined_grid, compare_grids
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.residual_grid import ResidualGrid, residual_grid

HALF = (0.05, 0.03)


def _field(xy: Floats) -> Floats:
    x, y = (xy / HALF).T
    return 0.4 * np.stack([np.sin(3 * x + y), 2.0 * x * y - 0.6 * x**3], axis=1)


def _grid(seed: int, per_cell: int = 25, side: int = 25, factor: float = 1.0) -> ResidualGrid:
    random = np.random.default_rng(seed)
    xy = random.uniform(-1, 1, (per_cell * side * side, 2)) * HALF
    return residual_grid(
        FormatCells.of(HALF, side), xy, factor * _field(xy) + random.normal(0, 0.8, xy.shape)
    )


def test_two_flights_with_the_same_camera_are_correlated_and_do_not_differ() -> None:
    found = compare_grids(_grid(1), _grid(2))
    assert found.freedom == 2 * found.cells
    assert all(0.5 < value < 0.9 for value in found.correlation)
    # Freed of the noise they are the same.
    assert found.correlation_of_signals == pytest.approx((1.0, 1.0), abs=0.06)
    assert found.statistic / found.freedom == pytest.approx(1.0, abs=0.2)
    assert found.differing == pytest.approx(0.05, abs=0.05)


@pytest.mark.parametrize(("per_cell", "side"), [(10, 20), (25, 20), (400, 5)])
def test_the_test_of_the_difference_keeps_its_level(per_cell: int, side: int) -> None:
    """Of few residuals in a cell their scatter is not known well: taken as known, 25 would alarm 15 times."""
    pairs = [[_grid(2 * k + one, per_cell, side, factor=0.0) for one in (0, 1)] for k in range(60)]
    found = [compare_grids(*pair) for pair in pairs]
    beyond = sum(item.probability < 0.05 for item in found)
    assert beyond <= 8
    assert np.mean([item.differing for item in found]) == pytest.approx(0.05, abs=0.01)


def test_another_camera_is_recognized() -> None:
    found = compare_grids(_grid(1), _grid(2, factor=-1.0))
    assert max(found.correlation) < -0.5
    assert found.correlation_of_signals == pytest.approx((-1.0, -1.0), abs=0.06)
    assert found.probability < 1e-6
    assert found.differing > 0.5


def test_correlation_is_that_of_the_means() -> None:
    one, other = _grid(3, 100, 4), _grid(4, 100, 4)
    found = compare_grids(one, other)
    for k in (0, 1):
        a, b = one.mean[:, k], other.mean[:, k]
        assert found.correlation[k] == pytest.approx(float(a @ b / np.sqrt((a @ a) * (b @ b))))
    student = stats.ttest_ind_from_stats(
        *(x for grid in (one, other) for x in (grid.mean, grid.sigma * np.sqrt(grid.count), grid.count)),
        equal_var=False,
    )
    squares = stats.norm.isf(0.5 * student.pvalue) ** 2
    assert found.statistic == pytest.approx(np.sum(squares))
    assert found.probability == pytest.approx(stats.chi2.sf(found.statistic, 2 * found.cells))
    assert found.differing == np.mean(stats.chi2.sf(squares.sum(axis=1), 2) < 0.05)


def test_both_flights_together_are_as_good_as_all_their_image_points() -> None:
    one, other = _grid(5, 100), _grid(6, 300)
    both = combined_grid((one, other))
    true = _field(one.cells.middles)
    expected = 0.8 / np.sqrt(400)
    np.testing.assert_array_equal(both.count, one.count + other.count)
    assert np.sqrt(np.mean(both.sigma**2)) == pytest.approx(expected, rel=0.03)
    # The field changes a little within a cell.
    assert np.sqrt(np.mean((both.mean - true) ** 2)) == pytest.approx(expected, rel=0.15)


def test_a_cell_that_only_one_flight_knows_keeps_its_mean() -> None:
    one, other = _grid(7, 12), _grid(8, 6)
    both = combined_grid((one, other))
    alone = np.isfinite(one.mean) & np.isnan(other.mean)
    assert alone.sum() > 100
    np.testing.assert_allclose(both.mean[alone], one.mean[alone], rtol=1e-12)
    np.testing.assert_allclose(both.sigma[alone], one.sigma[alone], rtol=1e-12)
    np.testing.assert_array_equal(both.known, one.known | other.known)


def test_a_grid_with_itself_has_the_same_means_and_a_smaller_sigma() -> None:
    one = _grid(9, 50)
    both = combined_grid((one, one))
    np.testing.assert_allclose(both.mean, one.mean, rtol=1e-12)
    np.testing.assert_allclose(both.sigma, one.sigma / np.sqrt(2.0), rtol=1e-12)


def test_the_probability_of_a_mean_of_grids_is_that_of_welch_also_where_one_coordinate_is_unknown() -> None:
    one, other = _grid(1, 40, 4, factor=0.2), _grid(2, 16, 4, factor=0.2)
    hidden = np.where(np.arange(16)[:, None] < [5, 0], np.nan, 1.0)
    grids = [replace(grid, mean=grid.mean * hidden, sigma=grid.sigma * hidden) for grid in (one, other)]
    both = combined_grid(grids)
    scatter = [np.nanmean(grid.count * grid.sigma**2, axis=0) for grid in grids]
    weight = np.array([grid.count / spread for grid, spread in zip(grids, scatter, strict=True)])
    parts = np.array([grid.sigma**2 for grid in grids]) * (weight / weight.sum(axis=0)) ** 2
    freedom = parts.sum(axis=0) ** 2 / sum(p**2 / (g.count - 1) for p, g in zip(parts, grids, strict=True))
    np.testing.assert_allclose(both.sigma, np.sqrt(parts.sum(axis=0)), rtol=1e-12)
    tail = stats.t.sf(np.abs(both.mean) / both.sigma, freedom)
    known = np.isfinite(both.mean)
    square = np.nansum(stats.norm.isf(tail) ** 2, axis=1)
    # Where neither is known there is no probability.
    expected = stats.chi2.sf(square, known.sum(axis=1))
    there = known.any(axis=1)
    assert {1, 2} <= set(known.sum(axis=1).tolist())
    np.testing.assert_allclose(both.probability[there], expected[there], rtol=1e-9)


@pytest.mark.parametrize("per_cell", [10, 25])
def test_the_mean_of_grids_is_significant_as_often_as_chance_says(per_cell: int) -> None:
    """Taken as known, the σ of 10 residuals in a cell would call 12 % of the sub-areas significant."""
    found = [
        combined_grid([_grid(3 * k + one, per_cell, 20, factor=0.0) for one in (0, 1, 2)]) for k in range(10)
    ]
    called = np.mean([np.mean(grid.significant()[grid.known]) for grid in found])
    assert called == pytest.approx(0.05, abs=0.015)


def test_a_grid_with_three_times_the_scatter_has_a_ninth_of_the_weight_in_every_cell() -> None:
    one = _grid(3, 10, 20)
    rough = replace(one, mean=0.0 * one.mean, sigma=3.0 * one.sigma)
    both, known = combined_grid((one, rough)), np.isfinite(one.mean)
    np.testing.assert_allclose(both.mean[known], 0.9 * one.mean[known], rtol=1e-12)
    np.testing.assert_allclose(both.sigma[known], np.sqrt(0.9) * one.sigma[known], rtol=1e-12)


def test_means_without_any_scatter_are_known_exactly() -> None:
    one, other = _grid(3, 20, 5), _grid(4, 20, 5)
    exact = replace(one, sigma=np.zeros_like(one.sigma))
    both = combined_grid((exact, other))
    np.testing.assert_allclose(both.mean, one.mean, rtol=1e-12)
    assert np.all(both.sigma < 1e-12)
    assert compare_grids(exact, exact).statistic == 0.0
    assert compare_grids(exact, replace(exact, mean=exact.mean + 1e-9)).probability < 1e-6


def test_grids_with_other_sub_areas_are_refused() -> None:
    for call in (lambda a, b: compare_grids(a, b), lambda a, b: combined_grid((a, b))):
        with pytest.raises(InconsistentBlockError, match="different sub-areas"):
            call(_grid(1, 10, 5), _grid(2, 10, 6))


def test_grids_without_a_common_cell_are_refused() -> None:
    one = _grid(1, 10, 5)
    nowhere = ResidualGrid(one.cells, one.count, np.full_like(one.mean, np.nan), one.sigma, one.probability)
    with pytest.raises(InconsistentBlockError, match="fewer than two sub-areas"):
        compare_grids(one, nowhere)
