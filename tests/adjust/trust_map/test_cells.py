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


def test_of_a_rig_an_event_sees_a_cell_once_whatever_number_of_its_images_do() -> None:
    sight = Sight(np.array([0, 3, 3, 4]), np.array([0, 1, 3, 2]))
    assert sight.of_events(None) is sight
    of_events = sight.of_events(np.array([0, 0, 1, 1]))
    assert of_events.start.tolist() == [0, 2, 2, 3]
    assert of_events.image.tolist() == [0, 1, 1]
