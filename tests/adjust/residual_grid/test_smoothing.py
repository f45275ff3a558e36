from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.residual_grid import ResidualGrid, residual_grid
from adjust.residual_grid.smoothing import Smoothing, SmoothingMethod, smoothed
from tests.grids import diagonal_daily

HALF = (0.05, 0.05)
METHODS: tuple[SmoothingMethod, ...] = ("gaussian", "counts", "collocation")


def _grid(
    number: int, seed: int = 1, signal: float = 1.0, side: int = 25, seams: Seams | None = None
) -> tuple[ResidualGrid, Floats]:
    """A smooth field with noise of 0.8, and its true values in the middles of the cells."""
    random = np.random.default_rng(seed)
    division = FormatCells.of(HALF, side, seams)

    def field(xy: Floats) -> Floats:
        x, y = (xy / HALF).T
        return signal * np.stack([x * (x**2 + y**2) - 0.6 * x, 0.5 * np.sin(2.0 * x + y)], axis=1)

    xy = random.uniform(-1, 1, (number, 2)) * HALF
    v = field(xy) + random.normal(0.0, 0.8, (number, 2))
    return residual_grid(division, xy, v), field(division.middles)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def test_no_smoothing_leaves_the_means_as_they_are() -> None:
    grid, _ = _grid(8000)
    np.testing.assert_array_equal(smoothed(grid, Smoothing()), grid.mean)


@pytest.mark.parametrize("method", ["gaussian", "counts"])
def test_a_constant_field_stays(method: SmoothingMethod) -> None:
    grid, _ = _grid(9000)
    value = np.where(grid.known[:, None], [0.3, -0.7], np.nan)
    constant = ResidualGrid(grid.cells, grid.count, value, grid.sigma, grid.probability)
    found = smoothed(constant, Smoothing(method, 0.06))
    np.testing.assert_allclose(found[grid.known], np.tile([0.3, -0.7], (grid.known.sum(), 1)), rtol=1e-13)
    assert np.isnan(found[~grid.known]).all()


def _uneven_grid(seed: int = 4) -> ResidualGrid:
    """A format that is not square, with numbers of residuals of its own in x and in y."""
    random = np.random.default_rng(seed)
    division = FormatCells.of((0.05, 0.02), 4)
    count = random.integers(5, 40, (16, 2))
    sigma = 0.8 / np.sqrt(count)
    mean = np.sin(60.0 * division.middles) + sigma * random.normal(size=(16, 2))
    return ResidualGrid(division, count, mean, sigma, np.zeros(16))


@pytest.mark.parametrize("method", ["gaussian", "counts"])
def test_means_are_weighted_by_their_distance_in_parts_of_the_sides(method: SmoothingMethod) -> None:
    grid = _uneven_grid()
    place = grid.cells.middles / [0.10, 0.04]
    found = smoothed(grid, Smoothing(method, 0.2))
    for cell in range(16):
        weight = np.exp(-0.5 * (np.linalg.norm(place - place[cell], axis=1) / 0.2) ** 2)[:, None]
        weight = weight * (grid.count if method == "counts" else [1.0, 1.0])
        np.testing.assert_allclose(found[cell], np.average(grid.mean, axis=0, weights=weight), rtol=1e-12)


@pytest.mark.parametrize("seed", [4, 6, 8])
def test_collocation_filters_with_the_length_that_predicts_means_best_from_the_others(seed: int) -> None:
    grid = _uneven_grid(seed)
    middles = grid.cells.middles
    distance = np.linalg.norm(middles[:, None] - middles, axis=2) / 0.10
    found = smoothed(grid, Smoothing("collocation"))
    for k in (0, 1):
        mean, noise = grid.mean[:, k], grid.sigma[:, k] ** 2
        likelihoods, filtered = [], []
        for length in np.geomspace(0.03, 1.0, 12):
            signal = (np.mean(mean**2) - noise.mean()) * np.exp(-((distance / length) ** 2))
            whole, likelihood = signal + np.diag(noise), 0.0
            for i in range(16):
                rest = np.arange(16) != i
                gain = np.linalg.solve(whole[np.ix_(rest, rest)], whole[rest, i])
                spread = np.sqrt(whole[i, i] - gain @ whole[rest, i])
                likelihood += stats.norm.logpdf(mean[i], gain @ mean[rest], spread)
            likelihoods.append(likelihood)
            filtered.append(signal @ np.linalg.solve(whole, mean))
        np.testing.assert_allclose(found[:, k], filtered[int(np.argmax(likelihoods))], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(("method", "per_cell"), diagonal_daily(METHODS, (25, 100)))
def test_smoothing_brings_noisy_means_nearer_to_a_smooth_field(
    method: SmoothingMethod, per_cell: int
) -> None:
    most = {25: 0.6, 100: 0.7}[per_cell]
    grid, true = _grid(625 * per_cell)
    raw = _rms(grid.mean - true)
    assert raw == pytest.approx(0.8 / np.sqrt(per_cell), rel=0.1)
    assert _rms(smoothed(grid, Smoothing(method, 0.04)) - true) < most * raw


def test_collocation_finds_its_width_and_is_the_best_of_them() -> None:
    grid, true = _grid(625 * 25)
    errors = {method: _rms(smoothed(grid, Smoothing(method)) - true) for method in METHODS}
    assert min(errors, key=lambda method: errors[method]) == "collocation"
    assert errors["collocation"] < 0.35 * _rms(grid.mean - true)


def test_collocation_takes_noise_for_noise() -> None:
    grid, _ = _grid(625 * 25, signal=0.0)
    assert _rms(smoothed(grid, Smoothing("collocation"))) < 0.35 * _rms(grid.mean)


def test_weighting_by_counts_is_better_where_counts_differ() -> None:
    random = np.random.default_rng(3)
    division = FormatCells.of(HALF, 20)
    # Thinly measured stripes beside thickly measured ones.
    xy = random.uniform(-1, 1, (60_000, 2)) * HALF
    thin = division.place[division.cell_of(xy)][:, 0] % 2 == 0
    xy = xy[~thin | (random.uniform(size=len(xy)) < 0.06)]
    grid = residual_grid(division, xy, 0.2 + random.normal(0.0, 0.8, xy.shape))
    methods: tuple[SmoothingMethod, ...] = ("gaussian", "counts")
    plain, weighted = (_rms(smoothed(grid, Smoothing(method, 0.05)) - 0.2) for method in methods)
    assert weighted < 0.7 * plain


@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_smoothed_across_a_seam(method: SmoothingMethod) -> None:
    seams = Seams((-0.01, 0.02), (0.0,))
    grid, _ = _grid(40_000, side=12, seams=seams)
    tile = grid.cells.tile
    mean = grid.mean + 50.0 * (tile == 4)[:, None]
    disturbed = ResidualGrid(grid.cells, grid.count, mean, grid.sigma, grid.probability)
    others = tile != 4
    before, after = smoothed(grid, Smoothing(method, 0.15)), smoothed(disturbed, Smoothing(method, 0.15))
    np.testing.assert_array_equal(before[others], after[others])
    assert np.all(np.abs(after[~others] - before[~others]) > 5.0)


def test_means_without_any_noise_are_kept_by_collocation() -> None:
    grid, true = _grid(9000, side=15)
    exact = ResidualGrid(grid.cells, grid.count, true, np.zeros_like(true), grid.probability)
    np.testing.assert_allclose(smoothed(exact, Smoothing("collocation")), true, atol=0.01)
