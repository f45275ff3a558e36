"""A program that treats map coordinates (E, N, H) as Cartesian.

Its collinearity equations hold in the map: p = Rᵀ(X − X0), q = (p_x, p_y)/p_z, and the ideal image point is

    u = −c q (1 + k1 t² − H t²/(2R)),    t = |q|,    H = Z0 − Z,

the last term only where it corrects the curvature of the earth (radius R; measured coordinates times
1 + H t²/(2R) are those of a flat world), k1 where it takes a radial term of the camera. Refraction, where it
has a model of its own, is left to it: the rays here are straight.

The world of a map is none: the scale of the projection differs from that of heights, and the ground is flat.
What a wrong world does to orientations and ground: Ressl (2002), Legat (2006).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import cross_matrix

#: Radius programs correct the curvature of the earth with.
EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True)
class CartesianMap:
    """How a program projects map coordinates.

    Attributes
    ----------
    earth_radius_m : of its curvature correction; None: it has none.
    """

    earth_radius_m: float | None = None

    @property
    def bend(self) -> float:
        """1/(2R) of the correction, 1/m; 0 without."""
        return 0.0 if self.earth_radius_m is None else 0.5 / self.earth_radius_m


@dataclass(frozen=True, eq=False)
class Pose:
    """Orientations of n images in map axes, and their camera.

    Attributes
    ----------
    centre : (n, 3) E, N, H in metres.
    map_from_camera : (n, 3, 3).
    focal_length : (n,) metres.
    radial : (n,) k1, forward (ideal → measured), for image coordinates over the focal length.
    """

    centre: Floats
    map_from_camera: Floats
    focal_length: Floats
    radial: Floats


def projected(world: CartesianMap, pose: Pose, ground: Floats) -> Floats:
    """Ideal image points (n, k, 2), metres from the principal point, of ground points (n, k, 3)."""
    p = _in_camera(pose, ground)
    q = p[..., :2] / p[..., 2:]
    return np.asarray(-pose.focal_length[:, None, None] * q * _stretch(world, pose, q, ground)[..., None])


def derivatives(world: CartesianMap, pose: Pose, ground: Floats) -> tuple[Floats, Floats]:
    """Derivatives of :func:`projected`.

    Returns
    -------
    by the orientation (n, k, 2, 6): centre, then a small rotation in the camera frame, R ← R exp(δ); by focal
    length and k1 (n, k, 2, 2).
    """
    p = _in_camera(pose, ground)
    z = p[..., 2:]
    q = p[..., :2] / z
    c = pose.focal_length[:, None, None]
    stretch = _stretch(world, pose, q, ground)[..., None]
    drop = (pose.centre[:, None, 2] - ground[..., 2])[..., None]
    slope = pose.radial[:, None, None] - world.bend * drop
    t2 = np.sum(q**2, axis=-1, keepdims=True)
    by_q = -c[..., None] * (
        stretch[..., None] * np.eye(2) + 2.0 * slope[..., None] * q[..., :, None] * q[..., None, :]
    )
    q_by_p = np.zeros((*q.shape, 3))
    q_by_p[..., 0, 0] = q_by_p[..., 1, 1] = 1.0 / z[..., 0]
    q_by_p[..., :, 2] = -q / z
    by_p = by_q @ q_by_p
    camera_from_map = np.swapaxes(pose.map_from_camera, 1, 2)[:, None]
    by_orientation = np.concatenate([-by_p @ camera_from_map, by_p @ cross_matrix(p)], axis=-1)
    by_orientation[..., 2] += c * q * world.bend * t2
    by_camera = np.stack([-q * stretch, -c * q * t2], axis=-1)
    return by_orientation, by_camera


def on_ground(world: CartesianMap, pose: Pose, ideal: Floats, height: Floats) -> Floats:
    """Where the program sees ideal image points (n, k, 2) at heights (n, k): (n, k, 3) map coordinates."""
    measured = -ideal / pose.focal_length[:, None, None]
    drop = (pose.centre[:, None, 2] - height)[..., None]
    slope = pose.radial[:, None, None] - world.bend * drop
    q = measured
    for _ in range(8):  # a contraction by some 1e-3
        q = measured / (1.0 + slope * np.sum(q**2, axis=-1, keepdims=True))
    ray = np.concatenate([-q, -np.ones_like(q[..., :1])], axis=-1)
    ray = np.einsum("nij,nkj->nki", pose.map_from_camera, ray)
    return np.asarray(pose.centre[:, None] - ray * (drop / ray[..., 2:]))


def _in_camera(pose: Pose, ground: Floats) -> Floats:
    return np.asarray(np.einsum("nji,nkj->nki", pose.map_from_camera, ground - pose.centre[:, None]))


def _stretch(world: CartesianMap, pose: Pose, q: Floats, ground: Floats) -> Floats:
    """(n, k) factor of curvature and k1."""
    drop = pose.centre[:, None, 2] - ground[..., 2]
    return np.asarray(1.0 + (pose.radial[:, None] - world.bend * drop) * np.sum(q**2, axis=-1))
