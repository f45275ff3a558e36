"""Write and read the tables of `tasks.tables.schemas`: checked, sorted, with units and frame in the file.

A table is written once by one stage. What does not fit its schema is a defect of that stage and raises
ValueError: a missing column, a number that is not finite where it must be, two rows with the same key. The
bytes depend on the content only (no times, no host, no paths).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from tasks.coordinates.crs import MapFrame
from tasks.storage.artifact import Artifact, verified
from tasks.storage.installation import InstallationError
from tasks.tables.schemas import SCHEMAS, Column, TableSchema
from tasks.tables.well_known_binary import points_z

METADATA = b"aerocal"
GEOMETRY = "geometry"
_ROW_GROUP = 100_000
_ARROW = {
    "string": pa.string(),
    "float64": pa.float64(),
    "int32": pa.int32(),
    "int64": pa.int64(),
    "bool": pa.bool_(),
}


def write_table(
    path: Path,
    schema: TableSchema,
    columns: Mapping[str, Any],
    frame: MapFrame | None = None,
    extra: Mapping[str, pa.Array] | None = None,
) -> int:
    """Write a table, sorted by its key.

    Parameters
    ----------
    path : the Parquet file.
    schema : one of `tasks.tables.schemas`.
    columns : arrays (n,) for every column of the schema; nullable ones may be left out; NaN is null.
    frame : CRS and heights of the coordinates; needed when the schema has coordinates.
    extra : further text columns of an input file, kept after those of the schema.

    Returns
    -------
    rows : number of rows written.

    Raises
    ------
    ValueError
        If the columns do not fit the schema.
    """
    unknown = sorted(set(columns) - {column.name for column in schema.columns})
    if unknown:
        raise ValueError(f"{schema.name}: no such columns: {', '.join(unknown)}")
    if schema.coordinates and frame is None:
        raise ValueError(f"{schema.name}: coordinates need a CRS")
    rows = len(next(iter(columns.values())))
    table = pa.table({column.name: _array(schema, column, columns, rows) for column in schema.columns})
    for name, values in (extra or {}).items():
        if name not in table.column_names and name != GEOMETRY:
            table = table.append_column(name, values)
    table = table.take(pa.array(_order(table, schema)))
    metadata = {METADATA: json.dumps(_metadata(schema, frame), sort_keys=True, ensure_ascii=False).encode()}
    if schema.coordinates and frame is not None:
        table, geo = _with_geometry(table, schema, frame)
        metadata[b"geo"] = json.dumps(geo, sort_keys=True).encode()
    pq.write_table(
        table.replace_schema_metadata(metadata), path, compression="zstd", row_group_size=_ROW_GROUP
    )
    return rows


def read_table(artifact: Artifact) -> pd.DataFrame:
    """Read a table of the contract into pandas, without its geometry column.

    Text columns are text, a null number is NaN.

    Raises
    ------
    InstallationError
        If the file's digest differs, or it is not a table of this name in the version this program knows.
    """
    table = pq.read_table(verified(artifact))
    described = json.loads((table.schema.metadata or {}).get(METADATA, b"{}"))
    schema = SCHEMAS.get(artifact.name)
    if schema is None or (described.get("schema"), described.get("version")) != (schema.name, schema.version):
        raise InstallationError(
            f"{artifact.path} is not a table '{artifact.name}' that this version of aerocal can read.",
            "Run again with an empty output folder.",
        )
    if GEOMETRY in table.column_names:
        table = table.drop_columns([GEOMETRY])
    return cast(pd.DataFrame, table.to_pandas())


def _array(schema: TableSchema, column: Column, columns: Mapping[str, Any], rows: int) -> pa.Array:
    """One column in its type, checked against the schema."""
    name = f"{schema.name}.{column.name}"
    if column.name not in columns:
        if not column.nullable:
            raise ValueError(f"{name}: the column is missing")
        return pa.nulls(rows, _ARROW[column.type])
    values = columns[column.name]
    if isinstance(values, pa.ChunkedArray):
        values = values.combine_chunks()
    if not isinstance(values, pa.Array):
        values = pa.array(values, from_pandas=True)
    array = values if values.type == _ARROW[column.type] else values.cast(_ARROW[column.type])
    if column.type == "float64":
        array = pc.if_else(pc.is_nan(array), pa.scalar(None, pa.float64()), array)
        if bool(pc.any(pc.is_inf(array)).as_py()):
            raise ValueError(f"{name}: infinite")
    if len(array) != rows:
        raise ValueError(f"{name}: {len(array)} rows, but {rows} in the first column")
    if array.null_count and not column.nullable:
        raise ValueError(f"{name}: {array.null_count} rows are null or NaN")
    if column.values:
        strange = pc.unique(array).drop_null().to_pylist()
        if set(strange) - set(column.values):
            raise ValueError(f"{name}: {sorted(set(strange) - set(column.values))} not in {column.values}")
    return array


def _order(table: pa.Table, schema: TableSchema) -> NDArray[np.int64]:
    """Row numbers in the order of the key; two rows with the same key are refused."""
    ranks = [_rank(table[name].combine_chunks()) for name in schema.key]
    order = np.lexsort(ranks[::-1]).astype(np.int64)
    same = np.ones(max(len(order) - 1, 0), dtype=bool)
    for rank in ranks:
        same &= rank[order[1:]] == rank[order[:-1]]
    if same.any():
        row = int(order[int(np.argmax(same))])
        key = ", ".join(str(table[name][row].as_py()) for name in schema.key)
        raise ValueError(f"{schema.name}: two rows have the key ({key})")
    return order


def _rank(array: pa.Array) -> NDArray[np.int64]:
    """Rank (n,) of each text among the distinct ones; null comes last."""
    encoded = array.dictionary_encode()
    rank_of = np.empty(len(encoded.dictionary) + 1, dtype=np.int64)
    by_name = pc.sort_indices(encoded.dictionary).to_numpy(zero_copy_only=False).astype(np.int64)
    rank_of[by_name] = np.arange(len(by_name))
    rank_of[-1] = len(by_name)
    indices = encoded.indices.fill_null(len(by_name))
    return np.asarray(rank_of[indices.to_numpy(zero_copy_only=False).astype(np.int64)])


def _metadata(schema: TableSchema, frame: MapFrame | None) -> dict[str, object]:
    described: dict[str, object] = {
        "schema": schema.name,
        "version": schema.version,
        "meaning": schema.meaning,
        "key": list(schema.key),
        "columns": {
            column.name: {"unit": column.unit, "meaning": column.meaning} for column in schema.columns
        },
    }
    if frame is not None:
        described |= {"crs": frame.name, "heights": frame.heights_description}
    return described


def _with_geometry(
    table: pa.Table, schema: TableSchema, frame: MapFrame
) -> tuple[pa.Table, dict[str, object]]:
    """The table with its geometry column, and the GeoParquet 1.1 description of that."""
    x, y, z = (
        table[name].combine_chunks().to_numpy(zero_copy_only=False).astype(np.float64)
        for name in schema.coordinates
    )
    crs = frame.projjson
    column: dict[str, object] = {
        "encoding": "WKB",
        "geometry_types": ["Point Z"],
        "crs": None if crs is None else json.loads(crs),
        "edges": "planar",
    }
    known = np.isfinite(x) & np.isfinite(y)
    if known.any() and np.isfinite(z).any():
        corners = [f(values[np.isfinite(values)]) for f in (np.min, np.max) for values in (x, y, z)]
        column["bbox"] = [float(corner) for corner in corners]
    geo: dict[str, object] = {"version": "1.1.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}
    return table.append_column(GEOMETRY, points_z(x, y, z)), geo
