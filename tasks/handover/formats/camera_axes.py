"""Orientations in the axes of computer vision: x right, y down, z forward, camera from world."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import log
from tasks.formats.plain_records import CV_AXES
from tasks.handover.delivery import Delivery

#: Digits of quaternions, rotation vectors and translations: 1e-15 of a rotation are nothing at 4 km.
DIGITS = 15


def camera_from_world(delivery: Delivery) -> tuple[Floats, Floats]:
    """Rotations (n, 3, 3) and translations (n, 3): X_camera = R X + t."""
    pose = delivery.handed.pose
    rotation = np.swapaxes(pose.map_from_camera @ CV_AXES, 1, 2)
    return rotation, -np.einsum("nij,nj->ni", rotation, pose.centre)


def quaternions(rotation: Floats) -> Floats:
    """w, x, y, z (n, 4) of rotations (n, 3, 3), w not negative; also of half turns."""
    vector = log(rotation)
    half = 0.5 * np.linalg.norm(vector, axis=1, keepdims=True)
    # sin(a/2) / a, which is 1/2 at a = 0.
    return np.hstack([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector])


def pixels(delivery: Delivery) -> Floats:
    """(m, 2) image points as column, row in pixels from the corner of the first one."""
    points, images = delivery.points, delivery.results.images
    camera = images.camera[points.image]
    half, size = images.half_format[camera], images.pixel_size[camera, None]
    return np.asarray((points.xy * [1.0, -1.0] + half) / size)


def exact(value: float) -> str:
    """A number with `DIGITS` digits."""
    return f"{value + 0.0:.{DIGITS}g}"
