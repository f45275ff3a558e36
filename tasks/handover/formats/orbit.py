"""Orbit: one line an image, ω, φ, κ in degrees; it requires undistorted images."""

from __future__ import annotations

from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.numbers import ANGLES, METRES, fixed, in_angles, table


def write_orbit(delivery: Delivery) -> Files:
    """``orbit.csv``."""
    pose = delivery.handed.pose
    rotation = in_angles(pose.map_from_camera, Angles())
    rows = [
        [image, *fixed(pose.centre[k], METRES), *fixed(rotation[k], ANGLES)]
        for k, image in enumerate(delivery.names)
    ]
    return {"orbit.csv": table(["Filename", "X/Long", "Y/Lat", "Z", "Omega", "Phi", "Kappa"], rows)}
