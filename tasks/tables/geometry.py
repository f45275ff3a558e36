"""The geometry column of tables with coordinates: GeoParquet 1.1, points in well-known binary."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tasks.coordinates.crs import MapFrame
from tasks.files.json_text import from_json
from tasks.tables.schemas import TableSchema
from tasks.tables.well_known_binary import points_z

GEOMETRY = "geometry"

#: Smallest x, y, z and largest x, y, z.
Box = tuple[float, float, float, float, float, float]


def box_of(table: pa.Table, schema: TableSchema) -> Box | None:
    """The box around the coordinates of a table; None where there are none."""
    return None if not schema.coordinates else box_around(np.column_stack(_coordinates(table, schema)))


def box_around(coordinates: NDArray[np.float64]) -> Box | None:
    """The box around points (n, 3); NaN is unknown; None without any point in plan or any height."""
    known = np.isfinite(coordinates)
    if not (known[:, 0] & known[:, 1]).any() or not known[:, 2].any():
        return None
    least, largest = ([float(limit) for limit in f(coordinates, axis=0)] for f in (np.nanmin, np.nanmax))
    return (least[0], least[1], least[2], largest[0], largest[1], largest[2])


def with_geometry(table: pa.Table, schema: TableSchema) -> pa.Table:
    """The table with its geometry column."""
    return table.append_column(GEOMETRY, points_z(*_coordinates(table, schema)))


def description(frame: MapFrame, box: Box | None) -> dict[str, object]:
    """The GeoParquet description of the geometry column."""
    crs = frame.projjson
    column: dict[str, object] = {
        "encoding": "WKB",
        "geometry_types": ["Point Z"],
        "crs": None if crs is None else from_json(crs),
        "edges": "planar",
    }
    if box is not None:
        column["bbox"] = list(box)
    return {"version": "1.1.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}


def _coordinates(table: pa.Table, schema: TableSchema) -> list[NDArray[np.float64]]:
    """x, y, z (n,) of a table, NaN where null."""
    return [
        table[name].combine_chunks().to_numpy(zero_copy_only=False).astype(np.float64)
        for name in schema.coordinates
    ]
