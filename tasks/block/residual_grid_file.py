"""Residual grids of cameras in residual_grid.parquet: written by every adjustment, read as a correction.

The file is complete in itself: sub-areas with their borders and the CCD image each lies in, means with
their standard deviations, and what had been added to the image coordinates when the means were taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from adjust.residual_grid.comparison import combined_grid
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.residual_grid import ResidualGrid
from tasks.block.residual_grid_cells import residual_grid_cells
from tasks.errors import Location
from tasks.nearest_name import did_you_mean
from tasks.tables.foreign import read_foreign_table
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.residual_grid import RESIDUAL_GRID

_MM = 1e-3
_UM = 1e-6
# Formats that differ by less are the same.
_SAME_FORMAT = 1e-6


def write_residual_grid(
    folder: Path,
    cameras: Sequence[FrameCamera],
    grids: Sequence[ResidualGrid | None],
    fields: Sequence[CorrectionField | None],
    confidence: float,
) -> None:
    """residual_grid.parquet: mean residuals in the sub-areas of every camera that has image points."""
    parts = [
        _rows(camera.name, grid, field, confidence)
        for camera, grid, field in zip(cameras, grids, fields, strict=True)
        if grid is not None
    ]
    table = pd.concat(parts, ignore_index=True)
    write_stage_table(folder, RESIDUAL_GRID, table)


def _rows(camera: str, grid: ResidualGrid, field: CorrectionField | None, confidence: float) -> pd.DataFrame:
    cells = grid.cells
    column, row = cells.place.T
    value = np.full((cells.count, 2), np.nan) if field is None else field.value
    return pd.DataFrame(
        {
            "camera": camera,
            "column": column,
            "row": row,
            "x_mm": cells.middles[:, 0] / _MM,
            "y_mm": cells.middles[:, 1] / _MM,
            "width_mm": np.diff(cells.along_x.edges)[column] / _MM,
            "height_mm": np.diff(cells.along_y.edges)[row] / _MM,
            "tile_x": cells.along_x.tile[column],
            "tile_y": cells.along_y.tile[row],
            "count": grid.count.max(axis=1),
            "count_vx": grid.count[:, 0],
            "count_vy": grid.count[:, 1],
            "mean_vx_um": grid.mean[:, 0] / _UM,
            "mean_vy_um": grid.mean[:, 1] / _UM,
            "sigma": _sigma(grid) / _UM,
            "sigma_vx_um": grid.sigma[:, 0] / _UM,
            "sigma_vy_um": grid.sigma[:, 1] / _UM,
            "p_value": grid.probability,
            "significant": grid.significant(confidence),
            "correction_x_um": value[:, 0] / _UM,
            "correction_y_um": value[:, 1] / _UM,
        }
    )


def _sigma(grid: ResidualGrid) -> Floats:
    """Root mean square (k,) of the standard deviations of the means in x and y, of those that are there."""
    present = np.isfinite(grid.sigma)
    total = np.sum(np.where(present, grid.sigma, 0.0) ** 2, axis=1)
    number = present.sum(axis=1)
    return np.where(number > 0, np.sqrt(total / np.maximum(number, 1)), np.nan)


def read_corrections(
    files: Sequence[Path], cameras: Sequence[FrameCamera], used: Bools
) -> tuple[CorrectionField | None, ...]:
    """The corrections of the cameras that have image points, from the residual grids of other runs.

    Several files are averaged as by ``combined_grid``.

    Parameters
    ----------
    used : (cameras,) which have image points; the others need no correction.

    Raises
    ------
    InputError
        If a file is not a residual grid, lacks a camera, or was made for another image format.
    """
    tables = [(file, _read(file)) for file in files]
    return tuple(
        _correction(camera, tables) if is_used else None
        for camera, is_used in zip(cameras, used, strict=True)
    )


def _read(file: Path) -> pd.DataFrame:
    remedy = "Name the residual_grid.parquet of a finished run."
    return read_foreign_table(file, RESIDUAL_GRID, remedy)[0]


def _correction(camera: FrameCamera, tables: Sequence[tuple[Path, pd.DataFrame]]) -> CorrectionField:
    grids = [_grid_of(camera, file, table) for file, table in tables]
    try:
        mean = grids[0] if len(grids) == 1 else combined_grid(grids)
    except InconsistentBlockError as error:
        raise Location(tables[-1][0], entity=f"camera {camera.name}").error(
            "The files divide the image into different sub-areas.",
            "Compute them with the same `cells`, or name only one.",
        ) from error
    return CorrectionField(mean.cells, mean.mean)


def _grid_of(camera: FrameCamera, file: Path, table: pd.DataFrame) -> ResidualGrid:
    """The correction of one camera in the form of a grid: with the standard deviations of its means."""
    own = table[table["camera"] == camera.name].sort_values(["row", "column"])
    if len(own) == 0:
        known = [str(name) for name in table["camera"].unique()]
        raise Location(file, entity=f"camera {camera.name}").error(
            f"The table of mean residuals has no camera '{camera.name}'.", did_you_mean(camera.name, known)
        )
    cells, x, y = residual_grid_cells(own), *camera.half_format
    for half, division in ((x, cells.along_x), (y, cells.along_y)):
        if np.abs(division.edges[[0, -1]] - np.array([-half, half])).max() > _SAME_FORMAT:
            raise Location(file, entity=f"camera {camera.name}").error(
                "The mean residuals were computed for another image format.",
                f"Take those of a camera of {camera.columns} × {camera.rows} pixels of "
                f"{camera.pixel_size / _UM:g} µm.",
            )
    means, applied = (
        own[list(names)].to_numpy(np.float64) * _UM
        for names in (("mean_vx_um", "mean_vy_um"), ("correction_x_um", "correction_y_um"))
    )
    sigma = own[["sigma_vx_um", "sigma_vy_um"]].to_numpy(np.float64) * _UM
    value = np.where(np.isfinite(sigma), applied, np.nan) if np.isfinite(applied).any() else means
    count = own[["count_vx", "count_vy"]].to_numpy(np.int64)
    return ResidualGrid(cells, count, value, sigma, own["p_value"].to_numpy(np.float64))
