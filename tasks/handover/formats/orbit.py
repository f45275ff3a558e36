"""Orbit: one line an image, ω, φ, κ in degrees; it requires undistorted images."""

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import orientations, table


def write_orbit(delivery: Delivery) -> Files:
    """``orbit.csv``."""
    rows = [[image, *cells] for image, cells in zip(delivery.names, orientations(delivery), strict=True)]
    return {"orbit.csv": table(["Filename", "X/Long", "Y/Lat", "Z", "Omega", "Phi", "Kappa"], rows)}
