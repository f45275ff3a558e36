"""Atmospheric refraction."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.refraction import (
    refracted_image_points,
    refraction_coefficient,
    straight_image_points,
)
from adjust.geometry import rotation

VERTICAL = np.eye(3)[None]
UP = np.array([[0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("camera_m", "ground_m", "expected_urad"),
    [(780, 0, 9.97), (2340, 0, 27.69), (2340, 300, 23.95), (4000, 500, 37.57), (7000, 0, 65.2)],
)
def test_coefficients_are_those_computed_independently(
    camera_m: float, ground_m: float, expected_urad: float
) -> None:
    found = refraction_coefficient(np.array([float(camera_m)]), np.array([float(ground_m)]))
    assert found[0] * 1e6 == pytest.approx(expected_urad, rel=1e-3)


def test_a_vertical_image_is_corrected_radially_by_k_r_of_one_plus_tangent_squared() -> None:
    c, r, k = 0.080, 0.062, 27.69e-6
    interior = np.array([[c, 0.0, 0.0]])
    measured = np.array([[0.6 * r, 0.8 * r]])
    straight = straight_image_points(measured, interior, VERTICAL, UP, np.array([k]))
    inwards = np.linalg.norm(measured) - np.linalg.norm(straight)
    assert inwards == pytest.approx(k * r * (1.0 + (r / c) ** 2), rel=1e-3)
    # 2.8 µm at r = 62 mm from 2340 m.
    assert inwards == pytest.approx(2.75e-6, rel=0.01)
    np.testing.assert_allclose(straight / np.linalg.norm(straight), measured / r, atol=1e-12)


def test_the_nadir_of_a_tilted_image_stays_where_it_is() -> None:
    tilted = rotation.about_x(0.1)[None]
    # The ray straight down, in the camera: Rᵀ (0, 0, −1).
    ray = tilted[0].T @ [0.0, 0.0, -1.0]
    nadir = -0.1 * ray[:2] / ray[2]
    found = straight_image_points(nadir[None], np.array([[0.1, 0.0, 0.0]]), tilted, UP, np.array([50e-6]))
    np.testing.assert_allclose(found[0], nadir, atol=1e-15)


def test_measured_and_straight_image_points_are_inverse_to_each_other() -> None:
    generator = np.random.default_rng(7)
    xy = generator.uniform(-0.05, 0.05, (40, 2))
    interior = np.tile([0.08, 1e-5, -2e-5], (40, 1))
    attitude = rotation.from_omega_phi_kappa(generator.uniform(-0.1, 0.1, (40, 3)))
    up, k = np.tile([0.0, 0.0, 1.0], (40, 1)), np.full(40, 65e-6)
    measured = refracted_image_points(xy, interior, attitude, up, k)
    np.testing.assert_allclose(straight_image_points(measured, interior, attitude, up, k), xy, atol=1e-15)
    assert np.abs(measured - xy).max() > 1e-6
