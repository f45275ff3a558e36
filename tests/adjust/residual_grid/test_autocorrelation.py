from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats, Ints
from adjust.residual_grid import autocorrelation as module
from adjust.residual_grid.autocorrelation import DISTANCES, Autocorrelation, autocorrelation
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import iterate_grid
from tests.adjust.calibration.camera_errors import (
    NOTHING,
    RADIAL_AND_TILES,
    SEAMS,
    CameraTest,
    cells,
    high_block,
)

HALF = (0.05, 0.03)


def _scattered(number: int, images: int, seed: int = 1) -> tuple[Ints, Floats]:
    random = np.random.default_rng(seed)
    return random.integers(0, images, number), random.uniform(-1, 1, (number, 2)) * HALF


def _of_block(test: CameraTest, residual: Floats) -> Autocorrelation:
    rays, chosen = test.observations.image_points, controlled(test.result.groups[0])
    return autocorrelation(rays.image, rays.xy, np.where(chosen, residual, np.nan))


def test_it_is_the_mean_product_of_the_pairs_of_an_image() -> None:
    image, xy = _scattered(300, 4)
    v = np.random.default_rng(2).normal(0.1, 1.0, (300, 2))
    v[::7, 0] = np.nan
    found = autocorrelation(image, xy, v)
    pairs = np.zeros((len(DISTANCES), 2), dtype=np.int64)
    total = np.zeros((len(DISTANCES), 2))
    for i in range(300):
        for j in range(i):
            distance = np.hypot(*(xy[i] - xy[j]))
            if image[i] == image[j] and distance < DISTANCES[-1]:
                k = int(np.searchsorted(DISTANCES, distance, side="right"))
                pairs[k] += np.isfinite(v[i] * v[j])
                total[k] += np.nan_to_num(v[i] * v[j])
    np.testing.assert_array_equal(found.pairs, pairs)
    square = np.nanmean(v**2, axis=0)
    np.testing.assert_allclose(found.correlation, total / pairs / square, rtol=1e-10)
    np.testing.assert_allclose(found.sigma, np.sqrt(square))
    present = np.array([np.isfinite(v[image == number]).sum(axis=0) for number in range(4)])
    in_an_image = (present**2).sum(axis=0) / present.sum(axis=0)
    np.testing.assert_allclose(found.limit, 3.0 / np.sqrt(pairs) + 6.0 / in_an_image)
    np.testing.assert_allclose(
        found.relative_sigma, np.sqrt(2 * np.maximum(1 - found.correlation, 0) * square)
    )


def test_white_residuals_are_not_correlated() -> None:
    flagged = []
    for seed in range(30):
        image, xy = _scattered(6000, 20, seed)
        found = autocorrelation(image, xy, np.random.default_rng(seed + 100).normal(size=(6000, 2)))
        assert np.all(np.abs(found.correlation) < 4.5 / np.sqrt(found.pairs))
        flagged.append(found.flagged.mean())
    assert np.mean(flagged) < 0.003


def test_residuals_of_a_block_with_white_noise_are_not_called_correlated() -> None:
    test = high_block(NOTHING)
    found = _of_block(test, test.result.groups[0].residual)
    assert found.pairs[0].min() > 100
    assert not found.flagged.any()
    assert np.all(np.abs(found.correlation[2:]) < 0.05)


def test_systematic_errors_correlate_neighbours_and_their_correction_ends_it() -> None:
    test = high_block(RADIAL_AND_TILES, gnss=True)
    before = _of_block(test, test.result.groups[0].residual)
    assert before.flagged[:4].all()
    assert np.all(before.correlation[:3] > 0.2)
    # It falls with the distance.
    assert np.all(np.diff(before.correlation[1:], axis=0) < 0.02)
    # Neighbours share their errors: their difference is better than that of independent points.
    assert np.all(before.relative_sigma[0] < 0.85 * np.sqrt(2.0) * before.sigma)
    division = cells(25, SEAMS)
    corrected = iterate_grid(test.block, test.result, (division,), test.block.camera_of_image, GridRule())
    rays = test.observations.image_points
    assert corrected.fields[0] is not None
    offset = division.interpolate(corrected.fields[0].value, rays.xy, "bilinear")
    after = _of_block(test, -(rays.misclosure(corrected.state) + offset))
    assert not after.flagged.any()
    assert np.all(np.abs(after.correlation[2:]) < 0.05)


def test_a_class_without_pairs_has_no_correlation() -> None:
    found = autocorrelation(
        np.array([0, 0, 1]), np.array([[0.0, 0.0], [0.003, 0.0], [0.0, 0.0]]), np.ones((3, 2))
    )
    np.testing.assert_array_equal(found.pairs, np.array([0, 0, 1, 0, 0, 0])[:, None] * [1, 1])
    assert np.isnan(found.correlation[0]).all()
    assert not found.flagged[0].any()
    np.testing.assert_allclose(found.correlation[2], 1.0)


def test_no_image_points_have_no_correlation() -> None:
    found = autocorrelation(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2)))
    assert found.pairs.sum() == 0
    assert not found.flagged.any()


def test_large_blocks_are_thinned_evenly_and_always_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    image, xy = _scattered(40_000, 40)
    random = np.random.default_rng(4)
    v = random.normal(size=(40_000, 2)) + 0.5 * np.sin(60.0 * xy)
    whole = autocorrelation(image, xy, v)
    monkeypatch.setattr(module, "_MOST_PAIRS", 3_000_000)
    monkeypatch.setattr(module, "_MOST_IN_IMAGE", 600)
    part = autocorrelation(image, xy, v)
    assert part.pairs[:, 0].sum() < 3_000_000
    assert part.pairs[:, 0].sum() > 300_000
    np.testing.assert_allclose(part.correlation[1:], whole.correlation[1:], atol=0.06)
    # The order in which images and points come does not matter for which images are taken.
    order = np.argsort(image, kind="stable")
    again = autocorrelation(image[order], xy[order], v[order])
    np.testing.assert_array_equal(again.correlation, part.correlation)
