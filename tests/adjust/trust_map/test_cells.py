"""Which images see which cells."""

from __future__ import annotations

import numpy as np

from adjust.parameters import INTERIOR_ORIENTATION
from adjust.trust_map.cells import Sight, sight_of
from tests.adjust.scenes import two_strips
from tests.adjust.trust_map.grids import cells_over


def test_an_image_sees_what_its_own_camera_has_in_its_format() -> None:
    """One camera stands along, the other one across."""
    scene = two_strips(cameras=2, flights=2)
    place = cells_over(scene.truth.object_point, 30, 20).x_in_local
    sight, block = sight_of(scene.block, scene.truth, place), scene.block
    expected = []
    for image, camera in enumerate(block.camera_of_image):
        rotation, centre = (
            values[image] for values in (scene.truth.local_from_camera, scene.truth.projection_centre)
        )
        p = (place - centre) @ rotation
        c, x0, y0 = scene.truth.system[INTERIOR_ORIENTATION][camera]
        xy = np.array([x0, y0]) - c * p[:, :2] / p[:, 2:]
        expected.append((np.abs(xy) <= block.cameras[camera].half_format).all(axis=1) & (p[:, 2] < 0.0))
    for cell, seen in enumerate(np.array(expected).T):
        assert (
            sight.image[sight.start[cell] : sight.start[cell + 1]].tolist() == np.flatnonzero(seen).tolist()
        )


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
