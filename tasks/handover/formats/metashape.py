"""Metashape: orientations as its OPK text and as its reference table; angles from grid north.

The rotation of the OPK text is object → image. The reference table has positions and angles, and their
standard deviations where they are known, for the import of reference data: columns ``nxyzXYZabcABC`` of
Metashape, with ω, φ, κ as the rotation angles of the chunk.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adjust.arrays import Floats
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import ANGLES, METRES, ROTATION, fixed, orientations, table

_HEAD = "# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33"


_REFERENCE = [
    "#Label", "X/Easting", "Y/Northing", "Z/Altitude", "Accuracy_X_(m)", "Accuracy_Y_(m)", "Accuracy_Z_(m)",
    "Omega", "Phi", "Kappa", "Accuracy_Omega_(deg)", "Accuracy_Phi_(deg)", "Accuracy_Kappa_(deg)",
]  # fmt: skip


def write_metashape(delivery: Delivery) -> Files:
    """``metashape_opk.txt``, separated by tabs, and ``metashape_reference.csv``."""
    cells = orientations(delivery)
    rows = [
        "\t".join([name, *cells[k], *fixed(delivery.handed.pose.map_from_camera[k].T.ravel(), ROTATION)])
        for k, name in enumerate(delivery.names)
    ]
    opk = "\n".join([f"# Cameras ({len(rows)})", _HEAD, *rows]) + "\n"
    return {"metashape_opk.txt": opk, "metashape_reference.csv": _reference(delivery, cells)}


def _reference(delivery: Delivery, cells: Sequence[Sequence[str]]) -> str:
    """Label, position, its accuracy, angles, their accuracy; degrees."""
    known = delivery.sigmas
    sigma = np.full((len(cells), 6), np.nan) if known.empty else known.to_numpy(np.float64)[:, :6]
    rows = [
        [name, *own[:3], *_or_empty(of[:3], METRES), *own[3:], *_or_empty(of[3:], ANGLES)]
        for name, own, of in zip(delivery.names, cells, sigma, strict=True)
    ]
    return table(_REFERENCE, rows)


def _or_empty(values: Floats, decimals: int) -> list[str]:
    return fixed(values, decimals) if np.isfinite(values).all() else [""] * len(values)
