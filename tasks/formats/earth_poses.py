"""Orientations of programs that compute in a geocentric or topocentric frame, as geographic ones.

The way back to the frame is exact: longitude, latitude and ellipsoidal height of the projection centre, and
the rotation against east, north, up there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.earth import Ellipsoid, ecef_from_enu, ecef_from_geodetic, geodetic_from_ecef
from tasks.formats.records import FileStatement

WGS84 = Ellipsoid(6_378_137.0, 1.0 / 298.257223563)
#: What is said of exposures that come from here.
GEOGRAPHIC = FileStatement(
    crs="+proj=longlat +datum=WGS84",
    heights="ellipsoidal",
    order="omega-phi-kappa",
    reference="true-north",
)


def geographic_poses(centre: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Longitude, latitude (degrees), height (n, 3) and rotations east-north-up from camera (n, 3, 3).

    Parameters
    ----------
    centre : (n, 3) geocentric, metres.
    rotation : (n, 3, 3) geocentric from camera.
    """
    geodetic = geodetic_from_ecef(WGS84, centre)
    axes = ecef_from_enu(geodetic[:, 0], geodetic[:, 1])
    return in_degrees(geodetic), np.asarray(np.swapaxes(axes, 1, 2) @ rotation)


def geocentric_poses(place: Sequence[float], centre: Floats, rotation: Floats) -> tuple[Floats, Floats]:
    """Geocentric centres (n, 3) and rotations (n, 3, 3) of those in the frame east, north, up of a place.

    Parameters
    ----------
    place : latitude, longitude (degrees), ellipsoidal height of its origin.
    """
    latitude, longitude, height = place
    origin = np.array([np.radians(latitude), np.radians(longitude), height])
    axes = ecef_from_enu(origin[0], origin[1])
    return ecef_from_geodetic(WGS84, origin) + centre @ axes.T, np.asarray(axes @ rotation)


def in_degrees(geodetic: Floats) -> Floats:
    """Longitude, latitude in degrees and height (n, 3) of latitude, longitude in radians and height."""
    return np.column_stack([np.degrees(geodetic[:, 1]), np.degrees(geodetic[:, 0]), geodetic[:, 2]])
