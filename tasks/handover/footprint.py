"""Footprints of oriented images on the curved earth, and as rings of longitude and latitude.

GeoJSON has no longitude beyond ±180°: a polygon that crosses the antimeridian is cut there in two (RFC 7946,
3.1.9), and the west of a box is then greater than its east (5.2). KML counts longitudes on.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Bools, Floats
from tasks.handover.results import Results

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
# Least part of a ray that goes down; a flatter one meets the ground towards the horizon.
_STEEP = 0.1
_HALF_TURN = 180.0
# Of degrees, in files.
_DECIMALS = 9


def footprints(results: Results) -> tuple[Floats, Bools]:
    """Closed rings (n, 5, 3) of the corners in the map, and whether all of an image's rays meet it."""
    images = results.images
    corners = np.stack(
        [camera.ideal(_CORNERS * np.array(camera.frame.half_format)) for camera in results.cameras]
    )[images.camera]
    height = np.repeat(results.ground[:, 1:2], len(_CORNERS), axis=1)
    up = np.asarray(images.frame.local_from_enu(images.projection_centre))[:, :, 2]
    c = np.broadcast_to(images.focal_length[images.camera][:, None, None], (*corners.shape[:2], 1))
    rays = np.einsum("nij,nkj->nki", images.local_from_camera, np.concatenate([corners, -c], axis=-1))
    steep = np.einsum("ni,nki->nk", up, rays) < -_STEEP * np.linalg.norm(rays, axis=-1)
    return images.ground(corners, height), steep.all(axis=1)


def counted_on(ring: Floats) -> Floats:
    """Vertices (k, 2 or 3), whose longitudes (degrees) do not jump at the antimeridian."""
    result = ring.copy()
    result[:, 0] -= 2.0 * _HALF_TURN * np.round((ring[:, 0] - ring[0, 0]) / (2.0 * _HALF_TURN))
    return result


def counter_clockwise(ring: Floats) -> Floats:
    """A ring whose longitudes are counted on, counter-clockwise, as required of outer rings."""
    x, y = (ring[:, k] - ring[0, k] for k in (0, 1))
    return ring if float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) > 0.0 else ring[::-1]


def geojson_polygon(ring: Floats) -> dict[str, object]:
    """The geometry of a closed ring (k, 2 or 3) of longitude, latitude (degrees) and perhaps height."""
    ring = counter_clockwise(counted_on(ring))
    side = -1.0 if ring[:, 0].min() < -_HALF_TURN else 1.0
    if (side * ring[:, 0]).max() <= _HALF_TURN:
        return {"type": "Polygon", "coordinates": [ring.tolist()]}
    here, there = _clipped(ring, side, _HALF_TURN), _clipped(ring, -side, -_HALF_TURN)
    there[:, 0] = (there[:, 0] - 2.0 * side * _HALF_TURN).round(_DECIMALS)
    return {"type": "MultiPolygon", "coordinates": [[here.tolist()], [there.tolist()]]}


def box(rings: Floats) -> list[float]:
    """West, south, east, north of vertices (k, 2), degrees."""
    x, y = counted_on(rings).T
    west, east = (
        float((value + _HALF_TURN) % (2.0 * _HALF_TURN) - _HALF_TURN) for value in (x.min(), x.max())
    )
    return [west, float(y.min()), east, float(y.max())]


def _clipped(ring: Floats, sign: float, limit: float) -> Floats:
    """The part of a closed ring where sign · longitude is at most a limit."""
    over = sign * ring[:, 0] - limit
    found: list[Floats] = []
    for start, end, a, b in zip(ring[:-1], ring[1:], over[:-1], over[1:], strict=True):
        if a <= 0.0:
            found.append(start)
        if (a < 0.0 < b) or (b < 0.0 < a):
            crossing = start + (end - start) * a / (a - b)
            crossing[0] = sign * limit
            found.append(crossing.round(_DECIMALS))
    return np.array([*found, found[0]])
