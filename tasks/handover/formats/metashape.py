"""Metashape: orientations as its OPK text, angles from grid north, rotation object → image."""

from __future__ import annotations

from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.numbers import ANGLES, METRES, ROTATION, fixed, in_angles

_HEAD = "# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33"


def write_metashape(delivery: Delivery) -> Files:
    """``metashape_opk.txt``, separated by tabs."""
    pose = delivery.handed.pose
    angles = in_angles(pose.map_from_camera, Angles())
    rows = [
        "\t".join(
            [
                name,
                *fixed(pose.centre[k], METRES),
                *fixed(angles[k], ANGLES),
                *fixed(pose.map_from_camera[k].T.ravel(), ROTATION),
            ]
        )
        for k, name in enumerate(delivery.names)
    ]
    return {"metashape_opk.txt": "\n".join([f"# Cameras ({len(rows)})", _HEAD, *rows]) + "\n"}
