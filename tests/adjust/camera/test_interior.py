"""Pixel grid and mounting of a frame camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.camera.interior import FrameCamera, nominal_mounting

EAGLE = FrameCamera("eagle", 26460, 17004, 4e-6, 0.1239, (0.0, 0.0), "corner", 90)


def test_format_centre_is_the_origin_in_both_pixel_conventions() -> None:
    corner = np.array([[13230.0, 8502.0]])
    np.testing.assert_array_equal(EAGLE.image_from_pixel(corner), [[0.0, 0.0]])
    by_centres = replace(EAGLE, pixel_origin="centre")
    np.testing.assert_array_equal(by_centres.image_from_pixel(corner - 0.5), [[0.0, 0.0]])


def test_the_two_pixel_conventions_differ_by_half_a_pixel() -> None:
    pixel = np.array([[100.0, 200.0]])
    difference = EAGLE.image_from_pixel(pixel) - replace(EAGLE, pixel_origin="centre").image_from_pixel(pixel)
    np.testing.assert_allclose(difference, [[-2e-6, 2e-6]], atol=1e-18)


def test_x_grows_with_columns_and_y_against_rows() -> None:
    moved = EAGLE.image_from_pixel(np.array([[13231.0, 8503.0]]))
    np.testing.assert_allclose(moved, [[4e-6, -4e-6]], atol=1e-18)


def test_corner_of_the_format_is_half_a_format_away() -> None:
    np.testing.assert_allclose(
        EAGLE.image_from_pixel(np.array([[26460.0, 0.0]])), [EAGLE.half_format], atol=1e-15
    )


@pytest.mark.parametrize("origin", ["corner", "centre"])
def test_pixels_return_from_image_coordinates(origin: str) -> None:
    camera = replace(EAGLE, pixel_origin=origin)
    pixel = np.random.default_rng(1).uniform(0, 17000, (50, 2))
    np.testing.assert_allclose(camera.pixel_from_image(camera.image_from_pixel(pixel)), pixel, atol=1e-9)


@pytest.mark.parametrize(
    ("mount_deg", "camera_axis_forward"),
    [(0, [1, 0, 0]), (90, [0, -1, 0]), (180, [-1, 0, 0]), (270, [0, 1, 0])],
)
def test_mounting_says_which_image_axis_points_forward(
    mount_deg: int, camera_axis_forward: list[int]
) -> None:
    mounting = nominal_mounting(mount_deg)
    np.testing.assert_array_equal(mounting @ camera_axis_forward, [1.0, 0.0, 0.0])
    # The optical axis (−z of the camera) points down in every mounting.
    np.testing.assert_array_equal(mounting @ [0, 0, -1], [0.0, 0.0, 1.0])
    assert np.linalg.det(mounting) == 1.0
    assert set(np.unique(mounting)) <= {-1.0, 0.0, 1.0}


def test_a_mounting_between_the_quarter_turns_is_refused() -> None:
    with pytest.raises(ValueError, match="mount_deg must be 0, 90, 180 or 270, not 45"):
        nominal_mounting(45)
