"""Metashape: orientations as its OPK text and as its reference table; angles from grid north.

The rotation of the OPK text is object → image. The reference table has positions and angles, and their
standard deviations where they are known, for the import of reference data: columns ``nxyzXYZabcABC`` of
Metashape, with ω, φ, κ as the rotation angles of the chunk.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.numbers import ANGLES, METRES, ROTATION, fixed, in_angles, table

_HEAD = "# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33"


_REFERENCE = [
    "#Label", "X/Easting", "Y/Northing", "Z/Altitude", "Accuracy_X_(m)", "Accuracy_Y_(m)", "Accuracy_Z_(m)",
    "Omega", "Phi", "Kappa", "Accuracy_Omega_(deg)", "Accuracy_Phi_(deg)", "Accuracy_Kappa_(deg)",
]  # fmt: skip


def write_metashape(delivery: Delivery) -> Files:
    """``metashape_opk.txt``, separated by tabs, and ``metashape_reference.csv``."""
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
    opk = "\n".join([f"# Cameras ({len(rows)})", _HEAD, *rows]) + "\n"
    return {"metashape_opk.txt": opk, "metashape_reference.csv": _reference(delivery, angles)}


def _reference(delivery: Delivery, angles: Floats) -> str:
    """Label, position, its accuracy, angles, their accuracy; degrees."""
    known = delivery.sigmas
    sigma = np.full((len(angles), 6), np.nan) if known.empty else known.to_numpy(np.float64)[:, :6]
    rows = [
        [
            name,
            *fixed(delivery.handed.pose.centre[k], METRES),
            *_or_empty(sigma[k, :3], METRES),
            *fixed(angles[k], ANGLES),
            *_or_empty(sigma[k, 3:], ANGLES),
        ]
        for k, name in enumerate(delivery.names)
    ]
    return table(_REFERENCE, rows)


def _or_empty(values: Floats, decimals: int) -> list[str]:
    return fixed(values, decimals) if np.isfinite(values).all() else [""] * len(values)
