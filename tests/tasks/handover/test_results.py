"""What is read from results: the ground below images, and how much cameras are corrected."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.handover.results import ground_heights
from tests.tasks.handover.flown_block import camera


def test_the_ground_of_an_image_is_that_of_nine_tenths_of_its_points_and_their_median() -> None:
    points = pd.DataFrame({"point": [f"P{k}" for k in range(42)], "z_m": [*map(float, range(41)), 1000.0]})
    seen = points["point"][:41].sample(frac=1.0, random_state=3)
    measured = pd.DataFrame({"image": ["A"] * 41, "point": seen})
    found = ground_heights(points, measured, ["none", "A"])
    np.testing.assert_allclose(found[1], [2.0, 20.0, 38.0])
    # An image without points stands above all of them.
    np.testing.assert_allclose(found[0], np.quantile(points["z_m"], [0.05, 0.5, 0.95]))


def test_the_largest_distortion_is_that_at_the_corner_farthest_from_the_principal_point() -> None:
    one = camera("A", False, 1, True)
    x, y = one.frame.half_format
    corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    reduced = corners - np.array(one.frame.principal_point)
    away = np.linalg.norm(one.ideal(corners) - reduced, axis=1)
    assert one.largest_distortion == pytest.approx(away.max())
    assert away.max() > 40e-6
