"""Atmospheric refraction of image rays.

A ray from the ground to the camera is bent; the image point lies too far from the nadir. The angle
between the measured ray and the straight line, for a ray at the angle α from the vertical, is

    dα = K tan α,    K = 2.26e-4 · [ (p(h) − p(H)) / (g (H − h)) − ρ(H) ]

with pressure p and density ρ of the standard atmosphere at the ground h and the camera H: the
flat-layer integral of the refractive index n − 1 = 2.26e-4 ρ, ρ in kg/m³.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats

_GRAVITY = 9.80665  # m/s², standard gravity (ICAO 7488)
_GAS_CONSTANT = 287.05  # J/(kg K), dry air
_REFRACTIVITY = 2.26e-4  # m³/kg, (n − 1)/ρ of visible light: n − 1 = 2.77e-4 at 1.225 kg/m³


def _pressure(height: Floats) -> Floats:
    """Pressure in Pa of the ICAO standard atmosphere below 11 km, height in metres above sea level."""
    return np.asarray(101325.0 * (1.0 - 0.0065 * height / 288.15) ** 5.25588)


def _density(height: Floats) -> Floats:
    """Density in kg/m³ of the same."""
    return np.asarray(_pressure(height) / (_GAS_CONSTANT * (288.15 - 0.0065 * height)))


def refraction_coefficient(camera_height: Floats, ground_height: Floats) -> Floats:
    """K (n,) in radians for cameras and ground at heights (n,) in metres above sea level, 0 to 11 km.

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
    return _straight(xy, interior, _down_in_camera(local_from_camera, up), coefficient)


def _down_in_camera(local_from_camera: Floats, up: Floats) -> Floats:
    """(n, 3) direction of the nadir in the camera frame."""
    return np.asarray(-np.einsum("nji,nj->ni", local_from_camera, up))


def _straight(xy: Floats, interior: Floats, down_in_camera: Floats, coefficient: Floats) -> Floats:
    """Image coordinates (n, 2) of the straight rays."""
    ray = np.stack([xy[:, 0] - interior[:, 1], xy[:, 1] - interior[:, 2], -interior[:, 0]], axis=1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    cosine = np.sum(ray * down_in_camera, axis=1)
    sideways = down_in_camera - cosine[:, None] * ray
    # A turn by dα = K tan α towards the nadir; the unit vector sideways has the length sin α.
    turned = ray + sideways * (coefficient / np.maximum(cosine, 1e-3))[:, None]
    straight = -interior[:, :1] * turned[:, :2] / turned[:, 2:]
    return np.asarray(straight + interior[:, 1:])


def refracted_image_points(
    xy: Floats, interior: Floats, local_from_camera: Floats, up: Floats, coefficient: Floats
) -> Floats:
    """Image coordinates (n, 2) as measured, from those of straight rays; inverse of the former."""
    measured, down_in_camera = xy, _down_in_camera(local_from_camera, up)
    for _ in range(3):  # a contraction by K (1 + tan² α) < 1e-3
        measured = xy + (measured - _straight(measured, interior, down_in_camera, coefficient))
    return measured
