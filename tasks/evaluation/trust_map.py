"""The trust map of an adjusted block: its cells as a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.rig import Rig
from adjust.trust_map.accuracy import CellAccuracy, NewMeasurement, cell_accuracy, joint_solution
from adjust.trust_map.block_errors import BlockErrors, block_errors
from adjust.trust_map.cells import Sight, sight_of
from tasks.evaluation.ground_cells import MapCells, map_cells
from tasks.evaluation.result_tables import AdjustedBlock, xyz_columns
from tasks.results.figures import TrustMapGrid
from tasks.settings.trust_map import TrustMapSettings
from tasks.tables.geometry import box_around
from tasks.tables.parquet import write_row_groups
from tasks.tables.schemas.trust_map import TRUST_MAP_CELLS

_XYZ = ("x", "y", "z")
_PIECE = 50_000
# Cells for which effects of errors in the block are solved for; they change slowly over the ground.
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
    sight = sight_of(adjusted.block, result.state, cells.ground(adjusted))
    cells, sight = _seen(cells, sight, result.block.rig)
    if not len(cells.number):
        return None
    ground = cells.ground(adjusted)
    sigma = new_sigma(adjusted, settings)
    solution = joint_solution(result, sight)
    measurement = NewMeasurement(sigma, adjusted.sigma0)
    accuracy = cell_accuracy(solution, ground, sight, measurement, result.cofactor.considered)
    chosen = cells.spread(_SOLVED_FOR)
    errors = block_errors(solution, result, ground, sight, chosen)
    everywhere = BlockErrors(
        cells.interpolated(chosen, errors.of_orientation), cells.interpolated(chosen, errors.of_rays)
    )
    _write(folder, adjusted, cells, accuracy, everywhere)
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


def new_sigma(adjusted: AdjustedBlock, settings: TrustMapSettings) -> float:
    """σ of an image coordinate of a new point, m: as set, or that of the block's own, times σ0."""
    if settings.sigma_image_um is not None:
        return 1e-6 * settings.sigma_image_um
    rays = adjusted.result.groups[0].group
    assert isinstance(rays, ImagePoints)  # the first group of every result
    return float(np.median(adjusted.result.groups[0].sigma)) * adjusted.sigma0


def _seen(cells: MapCells, sight: Sight, rig: Rig | None) -> tuple[MapCells, Sight]:
    """The cells that at least two images see, of a rig those of two events."""
    kept = sight.of_events(None if rig is None else rig.event_of_image).rays >= 2
    return cells.only(kept), sight.only(np.flatnonzero(kept))


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
