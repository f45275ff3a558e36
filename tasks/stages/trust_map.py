"""The trust map: ``trust_map.tif`` and its figures, which the gates test."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame
from tasks.handover.geotiff import GridPlace, Grids, write_geotiff
from tasks.results.figures import TrustMapFigure, TrustMapGrid, figures_of
from tasks.settings.project import ProjectSettings
from tasks.settings.trust_map import TrustMapSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, read_notes, write_notes
from tasks.tables.parquet import read_table
from tasks.tables.schemas.trust_map import TRUST_MAP_CELLS

_XYZ = ("x", "y", "z")
#: Columns of the table that are not values of a cell.
_PLACES = ("row", "column", "x_m", "y_m", "z_m")


def write_trust_map_raster(
    folder: Path, cells: Artifact, notes: Artifact, project: ProjectSettings, settings: TrustMapSettings
) -> None:
    """Write trust_map.tif and its figures; see `tasks.stages.trust_map_stage`."""
    table, grid = read_table(cells), figures_of(read_notes(notes).figures).trust_map_grid
    assert grid is not None  # written together with the cells
    write_geotiff(
        folder / "trust_map.tif",
        _bands(table, grid),
        GridPlace(grid.west_m, grid.north_m, grid.cell_m),
        MapFrame.of(project.crs, project.heights),
        TRUST_MAP_CELLS.meaning,
    )
    figure = trust_map_figure(table, grid, settings.share)
    plan = [value for value in figure.sigma_m[:2] if value is not None]
    external = figure.external_m
    largest = None if None in external else max(value for value in external if value is not None)
    figures = {
        "trust_map": figure.to_json(),
        "trust_map_plan_m": max(plan, default=None),
        "trust_map_height_m": figure.sigma_m[2],
        "trust_map_external_m": largest,
    }
    write_notes(folder, Notes((), figures))


def _bands(table: pd.DataFrame, grid: TrustMapGrid) -> Mapping[str, Grids]:
    """One grid (rows, columns) for each value, by the column's name; NaN where there is no cell."""
    place = table["row"].to_numpy(np.int64) * grid.columns + table["column"].to_numpy(np.int64)
    bands = {}
    for column in TRUST_MAP_CELLS.columns:
        if column.name not in _PLACES:
            values = np.full(grid.rows * grid.columns, np.nan, np.float32)
            values[place] = table[column.name].to_numpy(np.float32)
            bands[column.name] = values.reshape(grid.rows, grid.columns)
    return bands


def trust_map_figure(table: pd.DataFrame, grid: TrustMapGrid, share: float) -> TrustMapFigure:
    """The figures of a map from its cells."""
    uncontrolled = table["uncontrolled"].to_numpy(np.int64) > 0
    patterns = ("external_{}_m", "block_error_{}_m", "ray_error_{}_m")
    of_new, of_block, of_rays = (_columns(table, pattern) for pattern in patterns)
    external = np.where(uncontrolled[:, None], np.inf, np.fmax(np.fmax(of_new, of_block), of_rays))
    cells = len(table) + grid.unmapped

    def not_exceeded(values: Floats) -> tuple[float | None, ...]:
        return _at(values, max(int(np.ceil(share * cells)) - 1, 0))

    relative = _known(_columns(table, "relative_sigma_{}_m"))
    return TrustMapFigure(
        cells=len(table),
        unmapped=grid.unmapped / cells,
        cell_m=grid.cell_m,
        share=share,
        sigma_image_um=grid.sigma_image_um,
        median_rays=float(table["rays"].median()),
        median_sigma_m=_at(_columns(table, "sigma_{}_m"), (len(table) - 1) // 2),
        sigma_m=not_exceeded(_columns(table, "sigma_{}_m")),
        pair_sigma_m=not_exceeded(_columns(table, "pair_sigma_{}_m")),
        relative_sigma_m=_at(relative, (len(relative) - 1) // 2),
        external_m=not_exceeded(external),
        block_error_m=not_exceeded(of_block),
        ray_error_m=not_exceeded(of_rays),
        uncontrolled=float(uncontrolled.mean()),
    )


def _columns(table: pd.DataFrame, pattern: str) -> Floats:
    return table[[pattern.format(axis) for axis in _XYZ]].to_numpy(np.float64)


def _known(values: Floats) -> Floats:
    return values[np.isfinite(values).all(axis=1)]


def _at(values: Floats, place: int) -> tuple[float | None, ...]:
    """The values (n, 3) at a place of each sorted column, unknown ones last; null where nothing limits it."""
    if not 0 <= place < len(values):
        return (None, None, None)
    ascending = np.sort(np.where(np.isfinite(values), values, np.inf), axis=0)
    return tuple(float(value) if np.isfinite(value) else None for value in ascending[place])
