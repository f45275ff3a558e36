"""Whether a map projection preserves angles, which ω, φ, κ against its grid presuppose.

In a projection that does not (equal-area ones, say) the grid axes are not at right angles on the ground,
and an attitude against them has no meaning to the accuracy of an inertial system.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError

_STEP = 1e-5
# A fifth of the standard deviation of a very good inertial system, 0.003° = 5e-5 rad.
_TOLERANCE = 1e-5
# Where in the area of use it is tried, as parts of its extent; the poles are no place to try.
_PARTS = (0.05, 0.5, 0.95)


def refuse_distorted_angles(frame: MapFrame) -> None:
    """Raise if the projection distorts angles somewhere in its area of use.

    Raises
    ------
    InputError
        Naming the CRS and the distortion.
    """
    if not frame.is_projected or frame.crs.area_of_use is None:
        return
    area = frame.crs.area_of_use
    span = np.array([area.north - area.south, (area.east - area.west) % 360.0 or 360.0])
    parts = np.array([(north, east) for north in _PARTS for east in _PARTS])
    places = np.radians([area.south, area.west] + parts * span)
    distortion = np.nanmax(angular_distortion(frame, places), initial=0.0)
    if distortion > _TOLERANCE:
        raise InputError(
            f"This projection ({frame.crs.name}) distorts angles by up to {np.degrees(distortion):.2g}°, "
            "so angles relative to its grid have no meaning.",
            "Choose a conformal projection (UTM, Gauss-Krüger, Lambert conformal conic), or angles "
            "relative to true north for this input.",
            entity=frame.name,
        )


def angular_distortion(frame: MapFrame, latitude_longitude: Floats) -> Floats:
    """Largest change (n,) of an angle in radians, at latitude and longitude (n, 2) in radians.

    Zero where the images of a meridian and a parallel are at right angles and equally scaled: with the
    scaled image vectors as columns of M, it is 2 asin((a − b)/(a + b)) of the singular values a, b of M.
    """
    e2 = frame.ellipsoid.eccentricity_squared
    latitude = latitude_longitude[:, 0]
    curvature = 1.0 - e2 * np.sin(latitude) ** 2
    along_meridian = frame.ellipsoid.semi_major_m * (1.0 - e2) / curvature**1.5
    along_parallel = frame.ellipsoid.semi_major_m * np.cos(latitude) / np.sqrt(curvature)
    columns = []
    for step, radius in (((0.0, _STEP), along_parallel), ((_STEP, 0.0), along_meridian)):
        ends = [
            np.column_stack([latitude_longitude + sign * np.array(step), np.zeros(len(latitude))])
            for sign in (1.0, -1.0)
        ]
        vector = frame.from_geodetic(ends[0])[:, :2] - frame.from_geodetic(ends[1])[:, :2]
        columns.append(vector / (2.0 * _STEP * radius)[:, None])
    matrix = np.stack(columns, axis=-1)
    result = np.full(len(matrix), np.nan)
    known = np.isfinite(matrix).all(axis=(1, 2))
    large, small = np.linalg.svd(matrix[known], compute_uv=False).T
    result[known] = 2.0 * np.arcsin((large - small) / (large + small))
    return result
