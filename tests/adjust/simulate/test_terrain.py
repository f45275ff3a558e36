from __future__ import annotations

import numpy as np
import pytest

from adjust.geometry.earth import CartesianFrame, TopocentricFrame
from adjust.simulate.random_streams import RandomStreams, Source
from adjust.simulate.terrain import TerrainShape, raised, terrain_of
from tests.adjust.simulate.specifications import GRS80


def test_the_relief_is_the_root_mean_square_of_the_elevations() -> None:
    shape = TerrainShape(mean=120.0, relief=25.0, shortest=200.0, longest=1500.0)
    terrain = terrain_of(shape, RandomStreams(3).of(Source.TERRAIN))
    # Over an area of many wavelengths; the mean square of a sine settles with 1 / area.
    place = np.random.default_rng(1).uniform(0.0, 1e6, (200_000, 2))
    elevation = terrain.elevation(place)
    assert elevation.mean() == pytest.approx(120.0, abs=0.3)
    assert elevation.std() == pytest.approx(25.0, rel=0.02)


def test_terrain_without_relief_is_flat() -> None:
    terrain = terrain_of(TerrainShape(mean=7.0), RandomStreams(3).of(Source.TERRAIN))
    assert np.all(terrain.elevation(np.random.default_rng(1).uniform(-1e4, 1e4, (50, 2))) == 7.0)


def test_points_are_raised_to_their_height_in_any_frame() -> None:
    place = np.random.default_rng(2).uniform(-8000.0, 8000.0, (40, 2))
    height = np.linspace(-50.0, 4000.0, 40)
    np.testing.assert_array_equal(raised(place, height, CartesianFrame())[:, 2], height)
    frame = TopocentricFrame(GRS80, 0.85, 0.15)
    x_in_local = raised(place, height, frame)
    np.testing.assert_array_equal(x_in_local[:, :2], place)
    np.testing.assert_allclose(frame.height(x_in_local), height, atol=5e-9)
    # The earth falls away by D²/2R: metres at these distances.
    assert np.abs(x_in_local[:, 2] - height).max() > 5.0
