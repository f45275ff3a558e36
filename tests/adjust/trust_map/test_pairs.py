"""Pairs of rays side by side, from derivatives that are given, against matrices of each."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.trust_map import gains_kernel, pairs_kernel
from adjust.trust_map.lane_kernel import LANES

CELLS, RAYS = 8, 4


def rows_of(values: Floats) -> Floats:
    """The rows of all cells (m, n, …) one after the other, as kernels want them."""
    flat = np.zeros((values[0].size, LANES))
    flat[:, : len(values)] = values.reshape(len(values), -1).T
    return flat.ravel()


def of_rays(rows: Floats, count: int) -> Floats:
    """The other way round: (m, count)."""
    return rows.reshape(-1, LANES)[:count, :CELLS].T


def rays_meeting_under(angle: float, seed: int = 3) -> Floats:
    """Derivatives (m, k, 2, 3) of rays of m points, each turned against the next one by an angle."""
    random, jacobians = np.random.default_rng(seed), []
    for _ in range(CELLS):
        axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
        along = angle * np.arange(RAYS)
        x = np.cos(along)[:, None] * axes[0] + np.sin(along)[:, None] * axes[2]
        jacobians.append(np.stack([x, np.broadcast_to(axes[1], x.shape)], axis=1))
    return 1e3 * np.array(jacobians)


def gained(jacobian: Floats) -> tuple[Floats, Floats, Floats]:
    """Normals of each ray, rows of the cells and gains of all rays."""
    normals, of_cell = np.zeros(6 * RAYS * LANES), np.zeros(gains_kernel.ROWS_OF_CELL * LANES)
    gain = np.zeros(6 * RAYS * LANES)
    gains_kernel.gains(RAYS, CELLS, rows_of(jacobian), normals, of_cell, gain)
    return normals, of_cell, gain


@pytest.mark.parametrize(("angle", "there"), [(0.5, True), (1e-3, True), (1e-5, True), (0.0, False)])
def test_rays_under_the_smallest_angle_make_a_point_and_parallel_ones_none(
    angle: float, *, there: bool
) -> None:
    jacobian = rays_meeting_under(angle)
    normals, of_cell, gain = gained(jacobian)
    is_there = of_rays(of_cell[gains_kernel.THERE * LANES :], 1)[:, 0]
    assert is_there.tolist() == [float(there)] * CELLS
    rows = np.zeros(11 * LANES)
    pairs_kernel.inverses_of_pair(CELLS, 0, 2, normals, rows)
    assert of_rays(rows, 7)[:, 6].tolist() == [0.0 if there else np.inf] * CELLS
    if angle < 1e-4:  # which leave few digits
        return
    upper = np.triu_indices(3)
    for cell in range(CELLS):
        matrix = jacobian[cell].reshape(-1, 3)
        inverse = np.linalg.inv(matrix.T @ matrix)
        np.testing.assert_allclose(of_rays(of_cell, 6)[cell], inverse[upper], rtol=1e-4, atol=1e-9)
        np.testing.assert_allclose(
            of_rays(gain, 6 * RAYS)[cell].reshape(-1, 3), matrix @ inverse, rtol=1e-4, atol=1e-6
        )
        pair = jacobian[cell][[0, 2]].reshape(-1, 3)
        own = np.linalg.inv(pair.T @ pair)
        np.testing.assert_allclose(of_rays(rows, 6)[cell], own[upper], rtol=1e-4, atol=1e-9)


def test_the_bound_of_a_pair_is_its_height_with_exact_orientations() -> None:
    jacobian, variance = np.random.default_rng(5).normal(size=(CELLS, RAYS, 2, 3)), 2.5
    normals, _, _ = gained(jacobian)
    bounds = np.full(RAYS * RAYS * LANES, np.nan)
    pairs_kernel.height_bounds(RAYS, CELLS, normals, variance, bounds)
    found = of_rays(bounds, RAYS * RAYS).reshape(CELLS, RAYS, RAYS)
    for a in range(RAYS):
        for b in range(a + 1, RAYS):
            pair = jacobian[:, [a, b]].reshape(CELLS, 4, 3)
            expected = variance * np.linalg.inv(np.swapaxes(pair, 1, 2) @ pair)[:, 2, 2]
            np.testing.assert_allclose(found[:, a, b], expected, rtol=1e-9)
