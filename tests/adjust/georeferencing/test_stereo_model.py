"""Models of consecutive images and the points they share."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.georeferencing.y_parallax import common_points, consecutive_images
from adjust.observations.image_point import ImagePoints
from tests.adjust.georeferencing.flights import Flight, fly, simulated


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(simulated())


def test_images_that_follow_each_other_in_a_strip_form_models() -> None:
    strip = np.array([0, 1, 0, 1, 0, -1, 2, -1])
    time = np.array([3.0, 1.0, 1.0, 2.0, 2.0, 0.0, 5.0, 1.0])
    models = consecutive_images(strip, time)
    assert list(zip(models.left.tolist(), models.right.tolist(), strict=True)) == [(2, 4), (4, 0), (1, 3)]


def test_a_flight_without_strips_has_no_models() -> None:
    assert consecutive_images(np.full(4, -1), np.arange(4.0)).count == 0


@given(st.permutations(range(12)))
def test_the_order_of_the_images_does_not_matter(order: list[int]) -> None:
    strip, time = np.arange(12) // 4, np.arange(12.0)
    permuted = np.array(order)
    models = consecutive_images(strip[permuted], time[permuted])
    pairs = {(int(permuted[i]), int(permuted[j])) for i, j in zip(models.left, models.right, strict=True)}
    assert pairs == {(i, i + 1) for i in range(11) if i % 4 != 3}


def test_common_points_are_those_measured_in_both_images(flight: Flight) -> None:
    truth, rays = flight.simulated.truth, flight.rays
    models = consecutive_images(truth.plan.strip, truth.trajectory.time)
    common = common_points(rays, models)
    np.testing.assert_array_equal(rays.point[common.left], rays.point[common.right])
    np.testing.assert_array_equal(rays.image[common.left], models.left[common.model])
    np.testing.assert_array_equal(rays.image[common.right], models.right[common.model])
    assert np.all(np.diff(common.model) >= 0)
    for model in range(models.count):
        seen = [set(rays.point[rays.image == i].tolist()) for i in (models.left[model], models.right[model])]
        assert set(rays.point[common.left[common.model == model]].tolist()) == seen[0] & seen[1]


def test_image_points_in_any_order_within_a_point_are_found() -> None:
    rays = ImagePoints(
        np.array([1, 0, 2, 0]),
        np.array([0, 0, 1, 1]),
        np.zeros(3, dtype=np.int64),
        np.zeros((4, 2)),
        np.ones((4, 2)),
        np.ones(4, dtype=bool),
    )
    common = common_points(rays, consecutive_images(np.array([0, 0, 0]), np.array([0.0, 1.0, 2.0])))
    assert (common.left.tolist(), common.right.tolist(), common.model.tolist()) == ([1], [0], [0])
