"""The geometry column of tables with coordinates: GeoParquet 1.1, points in well-known binary."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from tasks.coordinates.crs import MapFrame
from tasks.files.json_text import from_json
from tasks.tables.schemas.columns import TableSchema

_POINT_Z = 1001
_RECORD = np.dtype([("order", "u1"), ("type", "<u4"), ("x", "<f8"), ("y", "<f8"), ("z", "<f8")])


def points_z(x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64]) -> pa.Array:
    """Binary array (n,) of Point Z; null where x or y is NaN, z = NaN where only the height is unknown."""
    records = np.empty(len(x), dtype=_RECORD)
    records["order"] = 1
    records["type"] = _POINT_Z
    records["x"], records["y"], records["z"] = x, y, z
    offsets = np.arange(len(x) + 1, dtype=np.int64) * _RECORD.itemsize
    geometry = pa.LargeBinaryArray.from_buffers(
        pa.large_binary(), len(x), [None, pa.py_buffer(offsets), pa.py_buffer(records.tobytes())]
    )
    known = np.isfinite(x) & np.isfinite(y)
    if not known.all():
        geometry = pc.if_else(pa.array(known), geometry, pa.scalar(None, pa.large_binary()))
    return geometry.cast(pa.binary()) if len(x) * _RECORD.itemsize < 2**31 else geometry


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
