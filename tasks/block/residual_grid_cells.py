"""The sub-areas of a camera's image, from residual_grid.parquet."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.residual_grid.format_cells import Division, FormatCells

_MM = 1e-3


def residual_grid_cells(table: pd.DataFrame) -> FormatCells:
    """The sub-areas in the rows of one camera of residual_grid.parquet."""
    along_x = table[table["row"] == 0].sort_values("column")
    along_y = table[table["column"] == 0].sort_values("row")
    return FormatCells(
        Division(_edges(along_x["x_mm"], along_x["width_mm"]), along_x["tile_x"].to_numpy(np.int64)),
        Division(_edges(along_y["y_mm"], along_y["height_mm"]), along_y["tile_y"].to_numpy(np.int64)),
    )


def _edges(middle: pd.Series, width: pd.Series) -> Floats:
    middles, widths = middle.to_numpy(np.float64), width.to_numpy(np.float64)
    edges = np.append(middles - 0.5 * widths, middles[-1] + 0.5 * widths[-1])
    return np.asarray(edges * _MM)
