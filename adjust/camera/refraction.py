"""Atmospheric refraction of image rays.

A ray from the ground to the camera is bent; the image point lies too far from the nadir. The angle
between the measured ray and the straight line, for a ray at the angle α from the vertical, is

    dα = K tan α,    K = 2.26e-4 · [ (p(h) − p(H)) / (g (H − h)) − ρ(H) ]

with pressure p and density ρ of the standard atmosphere at the ground h and the camera H: the
flat-layer integral of the refractive index n − 1 = 2.26e-4 ρ, ρ in kg/m³.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adjust.arrays import Floats

_GRAVITY = 9.80665  # m/s², standard gravity (ICAO 7488)
_GAS_CONSTANT = 287.05  # J/(kg K), dry air
_TROPOPAUSE = 11_000.0  # m; above it the temperature is the same up to 20 km
# Nearer to the horizon nothing is known of refraction.
_LEAST_COSINE = 1e-3
_REFRACTIVITY = 2.26e-4  # m³/kg, (n − 1)/ρ of visible light: n − 1 = 2.77e-4 at 1.225 kg/m³


def _temperature(height: Floats) -> Floats:
    """Temperature in K of the ICAO standard atmosphere up to 20 km, height in metres above sea level."""
    return 288.15 - 0.0065 * np.minimum(height, _TROPOPAUSE)


def _pressure(height: Floats) -> Floats:
    """Pressure in Pa of the same."""
    isothermal = np.maximum(height - _TROPOPAUSE, 0.0)
    below = 101325.0 * (_temperature(height) / 288.15) ** 5.25588
    return np.asarray(below * np.exp(-_GRAVITY * isothermal / (_GAS_CONSTANT * _temperature(height))))


def _density(height: Floats) -> Floats:
    """Density in kg/m³ of the same."""
    return np.asarray(_pressure(height) / (_GAS_CONSTANT * _temperature(height)))


def refraction_coefficient(camera_height: Floats, ground_height: Floats) -> Floats:
    """K (n,) in radians for cameras and ground at heights (n,) in metres above sea level, 0 to 20 km.

    Ellipsoidal heights serve as well: 50 m change K by less than 1 %.
    """
    upper = np.asarray(camera_height, dtype=np.float64)
    lower = np.minimum(np.asarray(ground_height, dtype=np.float64), upper - 1.0)
    mean = (_pressure(lower) - _pressure(upper)) / (_GRAVITY * (upper - lower))
    return np.asarray(_REFRACTIVITY * (mean - _density(upper)))


def straight_image_points(
    xy: Floats, interior: Floats, local_from_camera: Floats, up: Floats, coefficient: Floats
) -> Floats:
    """Image coordinates (n, 2) of the straight rays, from measured ones: turned by dα towards the nadir.

    Parameters
    ----------
    xy : (n, 2) measured, metres, image system.
    interior : (n, 3) c, x0, y0.
    local_from_camera : (n, 3, 3).
    up : (n, 3) vertical at each camera, local frame.
    coefficient : (n,) K in radians.
    """
    # A ray of length 1 and K / cos α of the vertical, less what of that lies along the ray.
    return _turned(
        xy, interior, local_from_camera, up, lambda t2: (1.0 - coefficient) / (1.0 + coefficient * t2)
    )


def refracted_image_points(
    xy: Floats, interior: Floats, local_from_camera: Floats, up: Floats, coefficient: Floats
) -> Floats:
    """Image coordinates (n, 2) as measured, from those of straight rays; exact inverse of the former."""

    # With T = tan α of the straight ray and t of the measured one, T (1 + K t²) = t (1 − K).
    def factor(t2: Floats) -> Floats:
        own = 1.0 - coefficient
        return np.asarray(2.0 / (own + np.sqrt(np.maximum(own**2 - 4.0 * coefficient * t2, 0.0))))

    return _turned(xy, interior, local_from_camera, up, factor)


def _turned(
    xy: Floats,
    interior: Floats,
    local_from_camera: Floats,
    up: Floats,
    factor: Callable[[Floats], Floats],
) -> Floats:
    """Image coordinates (n, 2) of rays whose tan α is multiplied by a factor, a function of tan² α (n,)."""
    ray = (xy[:, 0] - interior[:, 1], xy[:, 1] - interior[:, 2], -interior[:, 0])
    down = [-np.einsum("ni,ni->n", local_from_camera[:, :, axis], up) for axis in range(3)]
    along = ray[0] * down[0] + ray[1] * down[1] + ray[2] * down[2]
    square = ray[0] ** 2 + ray[1] ** 2 + ray[2] ** 2
    sideways = factor(square / np.maximum(along**2, _LEAST_COSINE**2 * square) - 1.0)
    along *= 1.0 - sideways
    x, y, z = (sideways * own + along * axis for own, axis in zip(ray, down, strict=True))
    return np.stack([interior[:, 1] + ray[2] * x / z, interior[:, 2] + ray[2] * y / z], axis=1)
