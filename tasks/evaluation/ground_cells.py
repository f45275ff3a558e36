"""Cells over the ground of a block: a grid in the map, at the heights of its object points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

from adjust.arrays import Bools, Floats, Ints
from adjust.trust_map.cells import GroundCells
from tasks.coordinates.local_frame import local_from_grid, local_from_map, map_from_local
from tasks.errors import InputError
from tasks.evaluation.result_tables import AdjustedBlock

#: More cells would be a mistake of the project file: some gigabytes.
MOST_CELLS = 20_000_000
_CELLS_ALONG = 100
# Object points beyond these are averaged before they are triangulated.
_POINTS_ALONG = 300


@dataclass(frozen=True)
class MapGrid:
    """A grid of square cells in the map, row 0 in the north, column 0 in the west.

    Attributes
    ----------
    west, north : outer corner, m.
    cell : side of a cell, m.
    rows, columns : how many.
    """

    west: float
    north: float
    cell: float
    rows: int
    columns: int

    @classmethod
    def over(cls, plan: Floats, cell: float | None) -> MapGrid:
        """The grid over points (n, ≥ 2); its corner is a multiple of the cell's side.

        Raises
        ------
        InputError
            If the cells would be too many.
        """
        low, high = plan[:, :2].min(axis=0), plan[:, :2].max(axis=0)
        if cell is None:
            cell = _round_down(max(float((high - low).max()), 1e-3) / _CELLS_ALONG)
        first, last = np.floor(low / cell), np.floor(high / cell) + 1.0
        columns, rows = (int(count) for count in last - first)
        if columns * rows > MOST_CELLS:
            raise InputError(
                f"A trust map of {columns * rows:,} cells of {cell:g} m; {MOST_CELLS:,} cells are possible.",
                "Give a larger trust_map.cell_m.",
            )
        return cls(float(first[0] * cell), float(last[1] * cell), cell, rows, columns)

    @property
    def middles(self) -> Floats:
        """East and north (rows · columns, 2) of the middles, row after row."""
        x = self.west + (np.arange(self.columns) + 0.5) * self.cell
        y = self.north - (np.arange(self.rows) + 0.5) * self.cell
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _round_down(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not larger."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(factor for factor in (1.0, 2.0, 5.0) if factor * power <= value * (1.0 + 1e-9)))


@dataclass(frozen=True, eq=False)
class MapCells:
    """The cells of a grid over which the heights of the ground are known.

    Attributes
    ----------
    grid : the whole grid.
    number : (m,) row · columns + column of each cell, ascending.
    x_in_map : (m, 3) its middle.
    wanted : number of cells of the area to be mapped, known or not; None: whatever is known.
    """

    grid: MapGrid
    number: Ints
    x_in_map: Floats
    wanted: int | None = None

    def ground(self, adjusted: AdjustedBlock) -> GroundCells:
        """The cells in the frame of the adjustment, with the axes of the map."""
        row, column = np.divmod(self.number, self.grid.columns)
        next_one = np.append((row[1:] == row[:-1]) & (column[1:] == column[:-1] + 1), False)
        return GroundCells(
            local_from_map(adjusted.map_frame, adjusted.frame, self.x_in_map),
            np.ascontiguousarray(local_from_grid(adjusted.map_frame, adjusted.frame, self.x_in_map)),
            np.where(next_one, np.arange(len(row)) + 1, -1),
        )

    def spread(self, most: int) -> Ints:
        """At most so many of the cells, in every k-th row and column; at least one."""
        row, column = np.divmod(self.number, self.grid.columns)
        step = 1
        while True:
            chosen = np.flatnonzero((row % step == step // 2) & (column % step == step // 2))
            if len(chosen) <= most:
                return chosen.astype(np.int64) if len(chosen) else np.zeros(1, dtype=np.int64)
            step += 1

    def interpolated(self, chosen: Ints, values: Floats) -> Floats:
        """Values (m, d) of all cells from those (k, d) of some: linear between them, else the nearest."""
        middle = self.x_in_map[chosen, :2].mean(axis=0)
        given, wanted = self.x_in_map[chosen, :2] - middle, self.x_in_map[:, :2] - middle
        found = np.asarray(values[cKDTree(given).query(wanted)[1]], np.float64)
        if len(chosen) < 3 or np.linalg.matrix_rank(given, tol=self.grid.cell) < 2:
            return found
        between = LinearNDInterpolator(given, values)(wanted)
        return np.where(np.isfinite(between), between, found)

    def only(self, chosen: Bools) -> MapCells:
        """Some of the cells (m,)."""
        return replace(self, number=self.number[chosen], x_in_map=self.x_in_map[chosen])


def map_cells(adjusted: AdjustedBlock, cell: float | None, area: Floats | None = None) -> MapCells | None:
    """The cells between the object points of a block, in an area (k, 2) if there is one.

    Returns
    -------
    cells : None where the points span no area.

    Raises
    ------
    InputError
        If the area holds nothing of the block, or too many cells.
    """
    points = adjusted.result.state.object_point[adjusted.result.active_point]
    x_in_map = map_from_local(adjusted.map_frame, adjusted.frame, points)
    grid = MapGrid.over(x_in_map if area is None else area, cell)
    thinned = _thinned(x_in_map)
    middle = thinned.mean(axis=0)
    if len(thinned) < 3 or np.linalg.matrix_rank(thinned[:, :2] - middle[:2], tol=grid.cell) < 2:
        return None
    heights = LinearNDInterpolator(thinned[:, :2] - middle[:2], thinned[:, 2])
    plan = grid.middles
    chosen = np.arange(len(plan)) if area is None else np.flatnonzero(inside(area, plan))
    z = heights(plan[chosen] - middle[:2])
    known = np.isfinite(z)
    if area is not None and not known.any():
        raise InputError(
            f"The area of the trust map, {_extent(area)}, does not overlap the block, whose object points "
            f"extend over {_extent(x_in_map)}.",
            "Check trust_map.area_m: east and north in the CRS of the project, m.",
        )
    return MapCells(
        grid,
        chosen[known].astype(np.int64),
        np.column_stack([plan[chosen[known]], z[known]]),
        None if area is None else len(chosen),
    )


def _extent(points: Floats) -> str:
    (west, south), (east, north) = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    return f"east {west:.0f} to {east:.0f} m, north {south:.0f} to {north:.0f} m"


def inside(corners: Floats, points: Floats) -> Bools:
    """Which of the points (n, 2) lie in a polygon (k, 2)."""
    # A ray to the east crosses an odd number of its sides.
    found = np.zeros(len(points), dtype=bool)
    x, y = points.T
    for (x1, y1), (x2, y2) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y1 != y2:
            found ^= ((y1 > y) != (y2 > y)) & (x < x1 + (y - y1) * (x2 - x1) / (y2 - y1))
    return found


def _thinned(points: Floats) -> Floats:
    """Means (k, 3) of the points (n, 3) in the cells of a coarse grid."""
    low, extent = points[:, :2].min(axis=0), float(np.ptp(points[:, :2], axis=0).max())
    index = np.floor((points[:, :2] - low) / max(extent, 1e-9) * _POINTS_ALONG).astype(np.int64)
    _, place, count = np.unique(
        index[:, 1] * (_POINTS_ALONG + 1) + index[:, 0], return_inverse=True, return_counts=True
    )
    return np.stack([np.bincount(place, weights=points[:, k]) / count for k in range(3)], axis=1)
