"""The Cartesian frame of an adjustment, and the transformation from map coordinates and back.

Points go through latitude, longitude and ellipsoidal height, so nothing is approximated: neither the scale
of the projection nor the curvature of the earth. Rotations that are counted from grid north go through the
east, north, up axes at each exposure: R_local = R_local_from_enu · R_z(−γ) · R_grid.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.earth import CartesianFrame, TopocentricFrame
from adjust.geometry.rotation import about_z
from tasks.coordinates.crs import MapFrame

AdjustmentFrame: TypeAlias = TopocentricFrame | CartesianFrame


def local_frame(map_frame: MapFrame, x_in_map: Floats) -> AdjustmentFrame:
    """The frame of the adjustment: topocentric at the middle of the points (n, 3), at ellipsoidal height 0.

    The middle is that of the smallest upright rectangle around the points in the map, so it does not depend
    on their order or on how many lie where. For a local frame it is the frame itself.
    """
    if map_frame.is_local:
        return CartesianFrame()
    plan = np.asarray(x_in_map, dtype=np.float64)[:, :2]
    middle = 0.5 * (plan.min(axis=0) + plan.max(axis=0))
    latitude, longitude, _ = map_frame.to_geodetic(np.array([[*middle, 0.0]]))[0]
    return TopocentricFrame(map_frame.ellipsoid, float(latitude), float(longitude))


def local_from_map(map_frame: MapFrame, frame: AdjustmentFrame, x_in_map: Floats) -> Floats:
    """Local coordinates (n, 3) in metres of map coordinates (n, 3)."""
    if isinstance(frame, CartesianFrame):
        return np.asarray(x_in_map, dtype=np.float64)
    return frame.from_geodetic(map_frame.to_geodetic(x_in_map))


def map_from_local(map_frame: MapFrame, frame: AdjustmentFrame, x_in_local: Floats) -> Floats:
    """Map coordinates (n, 3) of local coordinates (n, 3) in metres."""
    if isinstance(frame, CartesianFrame):
        return np.asarray(x_in_local, dtype=np.float64)
    return map_frame.from_geodetic(frame.to_geodetic(x_in_local))


def local_from_grid(map_frame: MapFrame, frame: AdjustmentFrame, x_in_map: Floats) -> Floats:
    """Rotations (n, 3, 3): local axes from the axes grid east, grid north, up at each map position (n, 3)."""
    x_in_local = local_from_map(map_frame, frame, x_in_map)
    return frame.local_from_enu(x_in_local) @ about_z(-map_frame.convergence(x_in_map))
