"""Ground cells."""

from __future__ import annotations

import numpy as np

from adjust.trust_map.cells import GroundCells


def test_cells_that_are_left_keep_their_neighbours_among_them() -> None:
    x = np.arange(15.0).reshape(5, 3)
    axes = np.arange(45.0).reshape(5, 3, 3)
    of_row = GroundCells(x, axes, np.array([1, 2, -1, 4, -1]))
    chosen = np.array([False, True, True, True, False])
    left = of_row.only(chosen)
    assert left.neighbour.tolist() == [1, -1, -1]
    np.testing.assert_array_equal(left.x_in_local, x[1:4])
    np.testing.assert_array_equal(left.local_from_axes, axes[1:4])
