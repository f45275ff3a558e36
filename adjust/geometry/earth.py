"""The ellipsoid and the local frame in which the adjustment is Cartesian.

Three frames meet here: *geodetic* (latitude, longitude in radians, ellipsoidal height in metres),
*ecef* (geocentric Cartesian) and *local* (topocentric east, north, up at one fixed origin; EPSG
method 9837). Collinearity needs an orthogonal, isometric frame, hence nothing is ever computed in
map coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from adjust.arrays import Floats

_MAX_LATITUDE_ITERATIONS = 10


@dataclass(frozen=True)
class Ellipsoid:
    """Ellipsoid of revolution: semi-major axis in metres and flattening."""

    semi_major_m: float
    flattening: float

    @property
    def eccentricity_squared(self) -> float:
        """First eccentricity squared, e² = f (2 − f)."""
        return self.flattening * (2.0 - self.flattening)


def ecef_from_geodetic(ellipsoid: Ellipsoid, geodetic: Floats) -> Floats:
    """Geocentric coordinates (n, 3) in metres of latitude, longitude (radians), height (metres)."""
    latitude, longitude, height = np.moveaxis(np.asarray(geodetic, dtype=np.float64), -1, 0)
    e2 = ellipsoid.eccentricity_squared
    normal = ellipsoid.semi_major_m / np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    return np.stack(
        [
            (normal + height) * np.cos(latitude) * np.cos(longitude),
            (normal + height) * np.cos(latitude) * np.sin(longitude),
            (normal * (1.0 - e2) + height) * np.sin(latitude),
        ],
        axis=-1,
    )


def geodetic_from_ecef(ellipsoid: Ellipsoid, ecef: Floats) -> Floats:
    """Latitude, longitude (radians), height (metres), shape (n, 3), of geocentric coordinates.

    Fixed-point iteration in the reduced latitude (Bowring 1976); below 1e-9 m everywhere within
    100 km of the surface.
    """
    x, y, z = np.moveaxis(np.asarray(ecef, dtype=np.float64), -1, 0)
    a, f, e2 = ellipsoid.semi_major_m, ellipsoid.flattening, ellipsoid.eccentricity_squared
    b = a * (1.0 - f)
    distance = np.hypot(x, y)
    reduced = np.arctan2(a * z, b * distance)
    latitude = reduced
    for _ in range(_MAX_LATITUDE_ITERATIONS):
        latitude = np.arctan2(
            z + e2 / (1.0 - e2) * b * np.sin(reduced) ** 3, distance - e2 * a * np.cos(reduced) ** 3
        )
        following = np.arctan2((1.0 - f) * np.sin(latitude), np.cos(latitude))
        if np.all(np.abs(following - reduced) < 1e-15):
            break
        reduced = following
    height = (
        distance * np.cos(latitude) + z * np.sin(latitude) - a * np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    )
    return np.stack([latitude, np.arctan2(y, x), height], axis=-1)


def ecef_from_enu(latitude: Floats | float, longitude: Floats | float) -> Floats:
    """Rotation (..., 3, 3) whose columns are east, north, up in geocentric axes; radians."""
    latitude = np.asarray(latitude, dtype=np.float64)
    longitude = np.asarray(longitude, dtype=np.float64)
    sine_lat, cosine_lat = np.sin(latitude), np.cos(latitude)
    sine_lon, cosine_lon = np.sin(longitude), np.cos(longitude)
    matrix = np.zeros((*sine_lat.shape, 3, 3))
    east, north, up = (matrix[..., i] for i in range(3))
    east[..., 0], east[..., 1] = -sine_lon, cosine_lon
    north[..., 0], north[..., 1], north[..., 2] = -sine_lat * cosine_lon, -sine_lat * sine_lon, cosine_lat
    up[..., 0], up[..., 1], up[..., 2] = cosine_lat * cosine_lon, cosine_lat * sine_lon, sine_lat
    return matrix


class LocalFrame(Protocol):
    """The Cartesian frame of the adjustment, as far as observations need to know it."""

    def height(self, x_in_local: Floats) -> Floats:
        """Height (n,) in metres above the reference surface of points (n, 3)."""
        ...

    def local_from_enu(self, x_in_local: Floats) -> Floats:
        """Rotations (n, 3, 3): columns are east, north, up at each point, in local axes."""
        ...

    def height_and_axes(self, x_in_local: Floats) -> tuple[Floats, Floats]:
        """Both of them, for little more than the time of one."""
        ...


@dataclass(frozen=True)
class CartesianFrame:
    """The frame of a project declared as metric Cartesian (crs = "local"): up is z everywhere."""

    def height(self, x_in_local: Floats) -> Floats:
        """Height (n,) in metres: the third coordinate."""
        return np.asarray(x_in_local, dtype=np.float64)[:, 2]

    def local_from_enu(self, x_in_local: Floats) -> Floats:
        """Identity for each of the n points, shape (n, 3, 3)."""
        return np.broadcast_to(np.eye(3), (len(x_in_local), 3, 3))

    def height_and_axes(self, x_in_local: Floats) -> tuple[Floats, Floats]:
        """Third coordinates (n,), and identities (n, 3, 3)."""
        return self.height(x_in_local), self.local_from_enu(x_in_local)


@dataclass(frozen=True)
class TopocentricFrame:
    """East, north, up at one origin on or near the ellipsoid; angles in radians, height in metres."""

    ellipsoid: Ellipsoid
    latitude: float
    longitude: float
    height_of_origin_m: float = 0.0

    @cached_property
    def _origin_and_axes(self) -> tuple[Floats, Floats]:
        origin = ecef_from_geodetic(
            self.ellipsoid, np.array([self.latitude, self.longitude, self.height_of_origin_m])
        )
        return origin, ecef_from_enu(self.latitude, self.longitude)

    def from_geodetic(self, geodetic: Floats) -> Floats:
        """Local coordinates (n, 3) of latitude, longitude (radians), ellipsoidal height (metres)."""
        origin, axes = self._origin_and_axes
        return (ecef_from_geodetic(self.ellipsoid, geodetic) - origin) @ axes

    def to_geodetic(self, x_in_local: Floats) -> Floats:
        """Latitude, longitude (radians), ellipsoidal height (metres), (n, 3), of local points."""
        origin, axes = self._origin_and_axes
        return geodetic_from_ecef(self.ellipsoid, np.asarray(x_in_local) @ axes.T + origin)

    def height(self, x_in_local: Floats) -> Floats:
        """Ellipsoidal height (n,) in metres."""
        return self.to_geodetic(x_in_local)[:, 2]

    def local_from_enu(self, x_in_local: Floats) -> Floats:
        """Rotations (n, 3, 3): columns are east, north, up at each point, in local axes."""
        return self.height_and_axes(x_in_local)[1]

    def height_and_axes(self, x_in_local: Floats) -> tuple[Floats, Floats]:
        """Ellipsoidal height (n,) in metres, and the rotations of `local_from_enu`."""
        _, axes = self._origin_and_axes
        geodetic = self.to_geodetic(x_in_local)
        return geodetic[:, 2], axes.T @ ecef_from_enu(geodetic[:, 0], geodetic[:, 1])
