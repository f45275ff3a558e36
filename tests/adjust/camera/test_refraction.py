"""Refraction: published coefficients, the direction of the correction, and its inverse."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.refraction import (
    refracted_image_points,
    refraction_coefficient,
    straight_image_points,
)
from adjust.geometry import rotation

MICRORADIAN = 1e-6
MICROMETRE = 1e-6


@pytest.mark.parametrize(
    ("camera_m", "ground_m", "expected"),
    [(780, 0, 9.97), (2340, 0, 27.69), (2340, 300, 23.95), (4000, 500, 37.57), (7000, 0, 65.2)],
)
def test_coefficient_agrees_with_ray_tracing_through_the_standard_atmosphere(
    camera_m: float, ground_m: float, expected: float
) -> None:
    """Values of the reference page, which agree with ray tracing to 0.02 %."""
    found = refraction_coefficient(np.array([camera_m]), np.array([ground_m]))
    assert found[0] == pytest.approx(expected * MICRORADIAN, rel=5e-4)


@pytest.mark.parametrize(
    ("camera_m", "pressure", "density"), [(12000, 19330, 0.31083), (15000, 12045, 0.19367)]
)
def test_above_11_km_the_atmosphere_is_isothermal(camera_m: float, pressure: float, density: float) -> None:
    """Pressure in Pa and density in kg/m³ of the tables of ICAO 7488."""
    found = refraction_coefficient(np.array([camera_m]), np.array([0.0]))
    mean = (101325 - pressure) / (9.80665 * camera_m)
    assert found[0] == pytest.approx(2.26e-4 * (mean - density), rel=5e-4)


def test_a_vertical_image_is_corrected_radially_by_k_r_and_r_cubed() -> None:
    c, radius, k = 0.080, 0.062, 27.69 * MICRORADIAN
    direction = np.array([np.cos(0.7), np.sin(0.7)])
    straight = straight_image_points(
        radius * direction[None],
        np.array([[c, 0.0, 0.0]]),
        np.eye(3)[None],
        np.array([[0.0, 0.0, 1.0]]),
        np.array([k]),
    )[0]
    expected = k * radius * (1.0 + radius**2 / c**2)
    assert radius - np.linalg.norm(straight) == pytest.approx(expected, rel=1e-4)
    np.testing.assert_allclose(straight / np.linalg.norm(straight), direction, atol=1e-12)
    assert expected == pytest.approx(2.75 * MICROMETRE, abs=0.01 * MICROMETRE)


def test_the_nadir_of_a_tilted_image_stays_where_it_is() -> None:
    c = 0.1
    local_from_camera = rotation.from_omega_phi_kappa(np.array([[0.05, -0.08, 1.2]]))
    down_in_camera = -local_from_camera[0].T @ np.array([0.0, 0.0, 1.0])
    nadir = -c * down_in_camera[:2] / down_in_camera[2]
    interior = np.array([[c, 1e-5, -2e-5]])
    measured = nadir[None] + interior[:, 1:]
    straight = straight_image_points(
        measured, interior, local_from_camera, np.array([[0.0, 0.0, 1.0]]), np.array([5e-5])
    )
    np.testing.assert_allclose(straight, measured, atol=1e-15)


@pytest.mark.parametrize("tilt_deg", [0.0, 45.0])
def test_bending_and_straightening_are_inverse(tilt_deg: float) -> None:
    rng = np.random.default_rng(7)
    n = 200
    xy = rng.uniform(-0.05, 0.05, (n, 2))
    interior = np.tile([0.1, 2e-5, -1e-5], (n, 1))
    angles = rng.normal([np.deg2rad(tilt_deg), 0.0, 0.0], [0.05, 0.05, 3.0], (n, 3))
    local_from_camera = rotation.from_omega_phi_kappa(angles)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    k = np.full(n, 6e-5)
    measured = refracted_image_points(xy, interior, local_from_camera, up, k)
    assert np.abs(measured - xy).max() > 1 * MICROMETRE
    back = straight_image_points(measured, interior, local_from_camera, up, k)
    np.testing.assert_allclose(back, xy, atol=1e-15)
