from __future__ import annotations

import numpy as np
import pytest

from adjust.block import Block
from adjust.camera.interior import FrameCamera
from adjust.camera.refraction import refracted_image_points, refraction_coefficient
from adjust.geometry.earth import CartesianFrame
from adjust.observations.image_point import ImagePoints
from adjust.parameters import FAMILIES, INTERIOR_ORIENTATION, SystemParameters
from tasks.block.refracted_rays import without_refraction

HEIGHT = 3000.0


def corner(relief: float) -> tuple[np.ndarray, np.ndarray]:
    """Images in one corner of a point in the plain and one above it: of straight rays, and corrected."""
    lens = FrameCamera("C", 13080, 20010, 5.2e-6, 0.08, (0.0, 0.0), "corner", 0)
    straight = np.array([[0.033, 0.051], [0.033, 0.051]])
    ray = np.column_stack([straight / lens.focal_length, -np.ones(2)])
    ground = np.array([0.0, relief])
    object_point = np.array([0.0, 0.0, HEIGHT]) + (HEIGHT - ground)[:, None] * ray
    system = SystemParameters(
        FAMILIES[INTERIOR_ORIENTATION], ("C",), np.array([[0.08, 0.0, 0.0]]), np.zeros((1, 3), dtype=bool)
    )
    none = np.zeros(1, dtype=np.int64)
    centre, turn = np.array([[0.0, 0.0, HEIGHT]]), np.eye(3)[None]
    block = Block(
        CartesianFrame(),
        (lens,),
        ("I",),
        none,
        ("1",),
        none,
        ("plain", "hill"),
        (system,),
        centre,
        turn,
        object_point,
    )
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    coefficient = refraction_coefficient(np.full(2, HEIGHT), ground)
    interior = np.tile(system.values, (2, 1))
    measured = refracted_image_points(straight, interior, np.tile(turn, (2, 1, 1)), up, coefficient)
    rays = ImagePoints(
        np.zeros(2, dtype=np.int64),
        np.arange(2),
        none,
        measured,
        np.full((2, 2), 1e-6),
        np.ones(2, dtype=bool),
    )
    assert np.abs(measured - straight).max() > 1e-6
    return straight, without_refraction(rays, block).xy


@pytest.mark.parametrize("relief", [0.0, 300.0, 800.0])
def test_each_ray_is_corrected_for_the_height_of_its_own_point(relief: float) -> None:
    """To a nanometre; one height for the image would leave 0.4 to 0.9 µm."""
    straight, corrected = corner(relief)
    np.testing.assert_allclose(corrected, straight, atol=1e-9)
