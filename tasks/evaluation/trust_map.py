"""The trust map of an adjusted block: its cells as a table.

The cells are a grid in the map, at the heights of the object points of the block.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import ConvexHull, cKDTree

from adjust.arrays import Bools, Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.rig import Rig
from adjust.trust_map.accuracy import CellAccuracy, NewMeasurement, cell_accuracy, joint_solution
from adjust.trust_map.block_errors import BlockErrors, block_errors
from adjust.trust_map.cells import GroundCells, Sight, sight_of
from tasks.coordinates.local_frame import local_from_grid, local_from_map, map_from_local
from tasks.errors import InputError
from tasks.evaluation.result_tables import AdjustedBlock, xyz_columns
from tasks.results.figures import TrustMapGrid
from tasks.settings.trust_map import TrustMapSettings
from tasks.tables.geometry import box_around
from tasks.tables.parquet import write_row_groups
from tasks.tables.schemas.trust_map import TRUST_MAP_CELLS

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
        """At most so many of the cells: of every square of k × k of the grid the one nearest its middle."""
        row, column = np.divmod(self.number, self.grid.columns)
        side = max(int(np.sqrt(len(row) / most)), 1)
        while True:
            square = row // side * (self.grid.columns // side + 1) + column // side
            if np.count_nonzero(np.bincount(square)) <= most:
                break
            side += max(side // 16, 1)
        away = (row % side - side // 2) ** 2 + (column % side - side // 2) ** 2
        by_square = np.lexsort((away, square))
        first = np.diff(square[by_square], prepend=-1) > 0
        return np.sort(by_square[first]).astype(np.int64)

    def with_margin(self, chosen: Ints, most: int) -> Ints:
        """The chosen cells and, up to so many in all, those farthest outside of them.

        Between chosen cells values are interpolated; outside they are those of the nearest one, which may be
        seen by other images.
        """
        given, every = self._around(chosen)
        if not self._spans_an_area(given):
            return chosen
        ends, hull = self._ends_of_lines(), ConvexHull(given).equations
        outside = ends[(every[ends] @ hull[:, :2].T + hull[:, 2] > 1e-6 * self.grid.cell).any(axis=1)]
        away = np.asarray(cKDTree(given).query(every[outside])[0])
        added = list[int]()
        while len(chosen) + len(added) < most and away.max(initial=0.0) > 0.0:
            farthest = int(outside[away.argmax()])
            added.append(farthest)
            away = np.minimum(away, np.linalg.norm(every[outside] - every[farthest], axis=1))
        return np.sort(np.append(chosen, np.array(added, dtype=np.int64)))

    def _ends_of_lines(self) -> Ints:
        """The first and the last cell of every row and every column."""
        every, ends = np.arange(len(self.number)), list[Ints]()
        row, column = np.divmod(self.number, self.grid.columns)
        for line, count in ((row, self.grid.rows), (column, self.grid.columns)):
            for order in (every, every[::-1]):
                last = np.full(count, -1, dtype=np.int64)
                last[line[order]] = order
                ends.append(last[last >= 0])
        return np.unique(np.concatenate(ends))

    def _around(self, chosen: Ints) -> tuple[Floats, Floats]:
        """Places (k, 2) of some cells, and of all, from the middle of the former."""
        middle = self.x_in_map[chosen, :2].mean(axis=0)
        return self.x_in_map[chosen, :2] - middle, self.x_in_map[:, :2] - middle

    def _spans_an_area(self, given: Floats) -> bool:
        return len(given) >= 3 and int(np.linalg.matrix_rank(given, tol=self.grid.cell)) == 2

    def interpolated(self, chosen: Ints, values: Floats) -> Floats:
        """Values (m, d) of all cells from those (k, d) of some: linear between them, else the nearest."""
        given, wanted = self._around(chosen)
        found = np.full((len(wanted), values.shape[1]), np.nan)
        if self._spans_an_area(given):
            found = LinearNDInterpolator(given, values)(wanted)
        beyond = ~np.isfinite(found).all(axis=1)
        nearest = values[cKDTree(given).query(wanted[beyond])[1]]
        found[beyond] = np.where(np.isfinite(found[beyond]), found[beyond], nearest)
        return found

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
        If the area holds no cell or nothing of the block, or too many cells.
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
    if not len(chosen):
        raise InputError(
            f"No cell of {grid.cell:g} m has its middle in the area of the trust map, "
            f"{_extent(np.array(area))}.",
            "Give a smaller trust_map.cell_m.",
        )
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


_XYZ = ("x", "y", "z")
_PIECE = 50_000
# Cells for which effects of errors in the block are solved for; as parts of its σ they change slowly.
_SOLVED_FOR = 300


def write_trust_map(folder: Path, adjusted: AdjustedBlock, settings: TrustMapSettings) -> TrustMapGrid | None:
    """trust_map_cells.parquet: accuracy and reliability of a new point in every cell that two images see.

    Returns
    -------
    grid : what the cells belong to; None where there is no map and nothing is written, because object points
        span no area, or a free network leaves the datum open.
    """
    free = adjusted.result.free_network
    if free is not None and free.defect:
        return None
    area = None if settings.area_m is None else np.array(settings.area_m)
    cells = map_cells(adjusted, settings.cell_m, area)
    if cells is None:
        return None
    result = adjusted.result
    places = local_from_map(adjusted.map_frame, adjusted.frame, cells.x_in_map)
    sight = sight_of(adjusted.block, result.state, places)
    seen = _seen(sight, result.block.rig)
    if not seen.any():
        return None
    cells, sight = cells.only(seen), sight.where(seen)
    ground = cells.ground(adjusted)
    sigma = new_sigma(adjusted, settings)
    solution = joint_solution(result, sight)
    measurement = NewMeasurement(sigma, adjusted.sigma0)
    others = result.cofactor.considered, result.cofactor.corrections
    accuracy = cell_accuracy(solution, ground, sight, measurement, *others)
    chosen = cells.with_margin(cells.spread(_SOLVED_FOR), _SOLVED_FOR)
    errors = block_errors(solution, result, ground, sight, chosen)
    _write(folder, adjusted, cells, accuracy, _everywhere(cells, chosen, errors, accuracy))
    grid = cells.grid
    return TrustMapGrid(
        west_m=grid.west,
        north_m=grid.north,
        cell_m=grid.cell,
        rows=grid.rows,
        columns=grid.columns,
        sigma_image_um=1e6 * sigma,
        added_pairs=solution.added_pairs,
        cells=len(cells.number),
        area_cells=cells.wanted,
    )


def _everywhere(cells: MapCells, chosen: Ints, errors: BlockErrors, accuracy: CellAccuracy) -> BlockErrors:
    """Effects in all cells from those in some: interpolated as parts of the block's part of σ, known in all.

    Where few images see a cell, as at the margin, it follows errors of the block as much more as that is
    larger; the new measurement has no part in it.
    """
    sigma = accuracy.sigma_of_block
    scale = np.tile(np.where(sigma > 0.0, sigma, 1.0), 2)
    parts = np.hstack([errors.of_orientation, errors.of_rays]) / scale[chosen]
    both = scale * cells.interpolated(chosen, parts)
    return BlockErrors(both[:, :3], both[:, 3:])


def new_sigma(adjusted: AdjustedBlock, settings: TrustMapSettings) -> float:
    """σ of an image coordinate of a new point, m: as set, or that of the block's own, times σ0."""
    if settings.sigma_image_um is not None:
        return 1e-6 * settings.sigma_image_um
    rays = adjusted.result.groups[0].group
    assert isinstance(rays, ImagePoints)  # the first group of every result
    return float(np.median(adjusted.result.groups[0].sigma)) * adjusted.sigma0


def _seen(sight: Sight, rig: Rig | None) -> Bools:
    """The cells (m,) that at least two images see, of a rig those of two events."""
    rays: Ints = sight.of_events(None if rig is None else rig.event_of_image).rays
    return rays >= 2


def _write(
    folder: Path, adjusted: AdjustedBlock, cells: MapCells, accuracy: CellAccuracy, errors: BlockErrors
) -> None:
    m = len(cells.number)
    pieces = [np.arange(first, min(first + _PIECE, m)) for first in range(0, m, _PIECE)]
    write_row_groups(
        folder / "trust_map_cells.parquet",
        TRUST_MAP_CELLS,
        (_columns(cells, accuracy, errors, piece) for piece in pieces),
        adjusted.map_frame,
        box_around(cells.x_in_map),
    )


def _columns(cells: MapCells, accuracy: CellAccuracy, errors: BlockErrors, piece: Ints) -> Mapping[str, Any]:
    row, column = np.divmod(cells.number[piece], cells.grid.columns)

    def of(pattern: str, values: Floats) -> dict[str, Floats]:
        return xyz_columns(pattern, _XYZ, values[piece])

    return {
        "row": row,
        "column": column,
        **xyz_columns("{}_m", _XYZ, cells.x_in_map[piece]),
        "rays": accuracy.rays[piece],
        **of("sigma_{}_m", accuracy.sigma),
        **of("pair_sigma_{}_m", accuracy.sigma_of_pair),
        **of("relative_sigma_{}_m", accuracy.sigma_relative),
        **of("external_{}_m", accuracy.external),
        **of("block_error_{}_m", errors.of_orientation),
        **of("ray_error_{}_m", errors.of_rays),
        "uncontrolled": np.maximum(accuracy.uncontrolled[piece], 0),
    }
