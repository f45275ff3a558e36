"""Where a model is placed by less than three points: closed cases without errors."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.approximate.image_model import ImageModel
from adjust.approximate.placement import KnownPlaces, placement
from adjust.approximate.similarity import Similarity
from adjust.arrays import Floats
from adjust.geometry import rotation

#: From the true system to that of the model.
AWAY = Similarity(0.04, rotation.exp(np.array([0.7, -2.0, 1.1])), np.array([3.0, 50.0, -7.0]))


def flown(tilt: float) -> ImageModel:
    """Five images in a row, each tilted about the line of flight and turned in itself."""
    turn = rotation.exp(np.outer(np.ones(5), [tilt, 0.0, 0.0])) @ rotation.about_z(0.3 * np.arange(5.0))
    centre = np.column_stack([400.0 * np.arange(5.0), np.full(5, 70.0), np.full(5, 1000.0)])
    points = np.random.default_rng(2).uniform([0.0, -500.0, 0.0], [1600.0, 500.0, 90.0], (20, 3))
    return ImageModel(np.ones(5, dtype=bool), centre, turn, points)


def moved(model: ImageModel) -> ImageModel:
    return ImageModel(
        model.oriented,
        AWAY.points(model.projection_centre),
        AWAY.rotation @ model.local_from_camera,
        AWAY.points(model.object_point),
    )


def nothing() -> tuple[Floats, Floats, Floats]:
    return np.full((20, 3), np.nan), np.full((5, 3), np.nan), np.full((5, 3, 3), np.nan)


@pytest.mark.parametrize("order", [(0, 4), (4, 0)])
@pytest.mark.parametrize("tilt", [0.0, 0.8])
def test_two_positions_and_level_bodies_place_it_exactly(tilt: float, order: tuple[int, int]) -> None:
    true = flown(tilt)
    if order[0]:
        true = ImageModel(
            true.oriented, true.projection_centre[::-1], true.local_from_camera[::-1], true.object_point
        )
    points, centres, rotations = nothing()
    centres[[0, 4]] = true.projection_centre[[0, 4]]
    up = None if tilt == 0.0 else np.asarray(np.swapaxes(true.local_from_camera, 1, 2)[:, :, 2])
    found = placement(moved(true), KnownPlaces(points, centres, rotations, up_in_camera=up))
    assert (found.places, found.scaled, found.turned) == (2, True, False)
    placed = found.of(moved(true))
    np.testing.assert_allclose(placed.object_point, true.object_point, atol=1e-8)
    np.testing.assert_allclose(placed.local_from_camera, true.local_from_camera, atol=1e-11)


def test_attitudes_turn_it_and_a_distance_gives_the_scale_about_a_single_point() -> None:
    true = flown(0.3)
    points, centres, _ = nothing()
    points[7] = true.object_point[7]
    ends = np.array([[1, 2], [3, 4], [5, 6]])
    distance = np.linalg.norm(true.object_point[ends[:, 0]] - true.object_point[ends[:, 1]], axis=1)
    # One of them is wrong.
    distance[1] *= 10.0
    known = KnownPlaces(points, centres, true.local_from_camera, ends, distance)
    found = placement(moved(true), known)
    assert (found.places, found.scaled, found.turned) == (1, True, True)
    np.testing.assert_allclose(found.of(moved(true)).object_point, true.object_point, atol=1e-8)


def test_without_any_place_its_middle_is_the_origin_and_up_is_up() -> None:
    true = flown(0.0)
    found = placement(moved(true), KnownPlaces(*nothing()))
    assert (found.places, found.scaled, found.turned) == (0, False, False)
    placed = found.of(moved(true))
    np.testing.assert_allclose(placed.object_point.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(placed.local_from_camera[:, 2, 2], 1.0)


def test_images_that_are_not_in_the_model_do_not_say_where_up_is() -> None:
    true = flown(0.0)
    model = moved(true)
    model.oriented[3:], model.local_from_camera[3:] = False, rotation.exp(np.array([2.0, 1.0, 0.0]))
    placed = placement(model, KnownPlaces(*nothing())).of(model)
    np.testing.assert_allclose(placed.local_from_camera[:3, 2, 2], 1.0)


def test_positions_on_a_line_do_not_turn_a_model_about_it_if_one_of_them_is_inaccurate() -> None:
    """The third one is 100 m off to the side: in the model all are on one line."""
    true = flown(0.0)
    points, centres, rotations = nothing()
    centres[[0, 2, 4]] = true.projection_centre[[0, 2, 4]]
    centres[2, 2] += 100.0
    found = placement(moved(true), KnownPlaces(points, centres, rotations))
    assert (found.places, found.scaled, found.turned) == (3, True, False)
    up = found.of(moved(true)).local_from_camera[:, 2, 2]
    assert np.all(up > np.cos(0.2))
