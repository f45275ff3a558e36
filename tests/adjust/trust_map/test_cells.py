"""Which images see which cells."""

from __future__ import annotations

import numpy as np

from adjust.trust_map.cells import Sight


def test_cells_that_are_left_keep_their_images() -> None:
    sight = Sight(np.array([0, 2, 2, 5, 6]), np.array([3, 4, 0, 1, 2, 7]))
    left = sight.where(np.array([True, True, False, True]))
    assert left.start.tolist() == [0, 2, 2, 3]
    assert left.image.tolist() == [3, 4, 7]
    same = sight.only(np.array([0, 1, 3]))
    np.testing.assert_array_equal(left.start, same.start)
    np.testing.assert_array_equal(left.image, same.image)
