"""Whether a geoid grid is as smooth as a geoid.

A grid that was damaged on its way still opens, and gives undulations that are metres wrong at some of its
nodes. A geoid is smooth: over 2.8 km its second difference is 0.1 m, in the Alps 0.3 m (RAF20). That of a
wrong node is twice its error.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.errors import Location
from tasks.files.delivered_file import opened

# Second difference that no geoid has over this distance between nodes; it grows with the distance.
_ROUGH_M, _NODES_M = 0.6, 2800.0
_RADIUS_M = 6_371_000.0
# Nodes around the block that are looked at, and the most along one side.
_MARGIN, _MOST = 4, 1000
_PIXEL_SCALE, _TIE_POINT = 33550, 33922


def refuse_damaged_geoid(frame: MapFrame, position: Floats) -> None:
    """Refuse a geoid grid that is not smooth about the positions (n, 3) of a block.

    Only grids whose nodes are told by a GeoTIFF are checked.

    Raises
    ------
    InputError
        Naming the grid, the place of its roughest node and by how much it is wrong about.
    """
    grid = frame.heights.geoid
    nodes = None if grid is None else _nodes(grid)
    if grid is None or nodes is None:
        return
    geodetic = frame.to_geodetic(np.nan_to_num(position))[np.isfinite(position[:, :2]).all(axis=1)]
    step, origin = nodes
    place = (np.rad2deg(geodetic[:, 1::-1]) - origin) / step
    place = place[np.isfinite(place).all(axis=1)]
    if not len(place):
        return
    first = np.floor(place.min(axis=0)) - _MARGIN
    count = np.minimum(np.ceil(place.max(axis=0)) + _MARGIN - first, _MOST).astype(int)
    longitude, latitude = np.meshgrid(
        *(np.deg2rad(origin[k] + step[k] * (first[k] + np.arange(count[k]))) for k in range(2))
    )
    undulation = frame.geoid_undulation(latitude.ravel(), longitude.ravel()).reshape(latitude.shape)
    spacing = np.deg2rad(abs(step)) * _RADIUS_M * np.array([np.cos(latitude.mean()), 1.0])
    for axis, apart in ((1, spacing[0]), (0, spacing[1])):
        rough = np.abs(np.diff(undulation, n=2, axis=axis))
        worst = np.unravel_index(int(np.argmax(np.nan_to_num(rough))), rough.shape)
        if rough[worst] > _ROUGH_M * max(1.0, apart / _NODES_M):
            at = tuple(index + (k == axis) for k, index in enumerate(worst))
            raise Location(grid).error(
                f"The geoid grid is damaged: at {np.rad2deg(latitude[at]):.3f}° N, "
                f"{np.rad2deg(longitude[at]):.3f}° E its undulation is {undulation[at]:.6g} m, about "
                f"{rough[worst] / 2.0:.3g} m different from its neighbours.",
                "Fetch it again, and compare its digest with that of its publisher.",
            )


def _nodes(grid: Path) -> tuple[Floats, Floats] | None:
    """Step and origin of a GeoTIFF's nodes, longitude and latitude in degrees; None: not told."""
    with opened(grid, "table") as stream:

        def unpacked(form: str, place: int) -> tuple[Any, ...]:
            stream.seek(place)
            return struct.unpack(order + form, stream.read(struct.calcsize(order + form)))

        order = {b"II": "<", b"MM": ">"}.get(stream.read(2), "=")
        try:
            (directory,) = unpacked("I", 4)
            (count,) = unpacked("H", directory)
            entries = [unpacked("HHII", directory + 2 + 12 * k) for k in range(count)]
            places = {tag: place for tag, _, _, place in entries}
            scale, tie = unpacked("3d", places[_PIXEL_SCALE]), unpacked("6d", places[_TIE_POINT])
        except (struct.error, KeyError):
            return None
    # Rows go south.
    step = np.array([scale[0], -scale[1]])
    return (step, np.array(tie[3:5]) - step * tie[:2]) if np.all(np.abs(step) > 1e-6) else None
