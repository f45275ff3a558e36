"""Cells over the ground of small blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.trust_map.cells import GroundCells


def cells_over(points: Floats, columns: int, rows: int) -> GroundCells:
    """Cells at the mean height of object points (m, 3), in the axes of the frame."""
    low, high = points.min(axis=0), points.max(axis=0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(low[1], high[1], rows))
    count = columns * rows
    place = np.stack([x.ravel(), y.ravel(), np.full(count, points[:, 2].mean())], axis=1)
    index = np.arange(count)
    neighbour = np.where(index % columns < columns - 1, index + 1, -1)
    return GroundCells(place, np.broadcast_to(np.eye(3), (count, 3, 3)).copy(), neighbour)


def turned(cells: GroundCells) -> GroundCells:
    """The same cells, each with axes of its own."""
    count = len(cells.x_in_local)
    vectors = 0.3 * np.sin(np.arange(3 * count)).reshape(count, 3)
    return replace(cells, local_from_axes=np.ascontiguousarray(rotation.exp(vectors)))
