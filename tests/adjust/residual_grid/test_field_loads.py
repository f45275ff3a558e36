"""Fields as columns of image points: loads and what unknowns imitate, of full matrices, part by part."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION
from adjust.residual_grid import field_loads
from adjust.residual_grid.field_loads import FieldLoads, Sparse
from adjust.solve.design_matrix import design_matrix, full_cofactor
from tests.adjust.scenes import two_strips


def test_loads_of_many_image_points_and_columns_are_those_of_full_matrices(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    free = {INTERIOR_ORIENTATION: True, BORESIGHT: True}
    scene = two_strips(noise_seed=3, cameras=2, free=free, additional=True, distances=2)
    result, random = adjust_block(scene.block, scene.observations), np.random.default_rng(4)
    n = len(scene.observations.image_points.image)
    rows = np.flatnonzero(random.random(n) < 0.7)
    columns = random.normal(size=(2 * len(rows), 9)) * (random.random((2 * len(rows), 9)) < 0.2)
    monkeypatch.setattr(field_loads, "_AT_ONCE", len(rows) // 3)
    monkeypatch.setattr(field_loads, "_TOGETHER", 4)
    loads = FieldLoads.of(result.system, result.solution, rows, Sparse(columns))

    design = design_matrix(result.system, result.solution.linearization)
    of_rays = design.matrix[: 2 * n].toarray().reshape(n, 2, -1)[rows]
    expected = of_rays.reshape(2 * len(rows), -1).T @ columns
    found = loads.times(np.eye(9))
    np.testing.assert_allclose(found.of_exposures, expected[design.exposure_columns], rtol=1e-9, atol=1e-9)
    border = found.of_border[: len(design.border_columns)]
    np.testing.assert_allclose(border, expected[design.border_columns], rtol=1e-9, atol=1e-9)
    used = design.point_columns[:, 0] >= 0
    np.testing.assert_allclose(
        found.of_points[used], expected[design.point_columns[used]], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(
        loads.imitated(), expected.T @ full_cofactor(design) @ expected, rtol=1e-6, atol=1e-7
    )
