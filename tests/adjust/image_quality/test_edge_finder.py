"""Gradients of tiles and edges of windows against plain sums over pixels."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.image_quality.edge_finder import tile_sums, window_edges

TILE, TILES = 8, 3
THRESHOLD = 3.0


@pytest.fixture(scope="module")
def image() -> Floats:
    """(48, 64) a soft edge from corner to corner, steeper than a diagonal, and some noise."""
    row, column = np.mgrid[:48, :64]
    away = (column - 30.0) * np.cos(0.4) + (row - 20.0) * np.sin(0.4)
    noise = np.random.default_rng(3).normal(0.0, 0.5, away.shape)
    return np.asarray(100.0 + 40.0 * np.tanh(away) + noise)


def gradients(image: Floats) -> Floats:
    """Columns, rows, and the gradients along both (n, 4) of the pixels whose gradient is strong."""
    along_columns, along_rows = np.zeros_like(image), np.zeros_like(image)
    along_columns[1:-1, 1:-1] = 0.5 * (image[1:-1, 2:] - image[1:-1, :-2])
    along_rows[1:-1, 1:-1] = 0.5 * (image[2:, 1:-1] - image[:-2, 1:-1])
    row, column = np.nonzero(np.hypot(along_columns, along_rows) >= THRESHOLD)
    return np.column_stack([column, row, along_columns[row, column], along_rows[row, column]])


def test_the_sums_of_a_tile_are_those_of_its_strong_gradients(image: Floats) -> None:
    found, strong = tile_sums(image, TILE, THRESHOLD), gradients(image)
    assert found.shape == (6, 8, 10)
    for i in range(6):
        for j in range(8):
            own = strong[(strong[:, 0] // TILE == j) & (strong[:, 1] // TILE == i)]
            c, r, gc, gr = own.T - np.array([[j * TILE], [i * TILE], [0], [0]])
            w = gc**2 + gr**2
            sums = [w, w * c, w * r, w * c * c, w * c * r, w * r * r, gc * gc, gc * gr, gr * gr]
            expected = [*(part.sum() for part in sums), w.max(initial=0.0)]
            np.testing.assert_allclose(found[i, j], expected, rtol=1e-5, atol=1e-3)


def test_an_edge_of_a_window_is_that_of_its_pixels(image: Floats) -> None:
    sums, strong = tile_sums(image, TILE, THRESHOLD), gradients(image)
    limits = {"coherent": 0.9, "thin": 1.5, "long": 4.0, "weakest": 10.0}
    found, edges = window_edges(sums, TILES, TILE, *limits.values()), 0
    for i, j in np.ndindex(*found.shape[:2]):
        first = np.array([j, i]) * TILE
        own = strong[np.all((strong[:, :2] >= first) & (strong[:, :2] < first + TILES * TILE), axis=1)]
        place, gradient = own[:, :2], own[:, 2:]
        weight = np.sum(gradient**2, axis=1)
        if len(own) < 3 or weight.max() <= limits["weakest"] ** 2:
            assert found[i, j, 3] == 0.0
            continue
        turned = np.linalg.eigvalsh(gradient.T @ gradient)
        across, along = np.sqrt(np.linalg.eigvalsh(np.cov(place.T, aweights=weight, ddof=0)))
        is_edge = (turned[1] - turned[0]) > limits["coherent"] * turned.sum()
        is_edge &= across < limits["thin"] and along > limits["long"]
        assert (found[i, j, 3] > 0.0) == is_edge
        if is_edge:
            middle = np.average(place, axis=0, weights=weight)
            np.testing.assert_allclose(found[i, j, :2], middle, atol=1e-3)
            direction = np.array([np.cos(found[i, j, 2]), np.sin(found[i, j, 2])])
            strongest = np.linalg.eigh(gradient.T @ gradient)[1][:, 1]
            assert abs(direction @ strongest) == pytest.approx(1.0, abs=1e-6)
            assert found[i, j, 3] == pytest.approx(np.sqrt(weight.max()), rel=1e-5)
            edges += 1
    assert edges > 5
