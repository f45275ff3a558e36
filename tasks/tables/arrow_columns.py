"""Columns of a table in the types of its schema, checked against it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from tasks.tables.schemas.columns import Column, TableSchema

#: Arrow's types of those of a schema.
ARROW_TYPES = {
    "string": pa.string(),
    "float64": pa.float64(),
    "int32": pa.int32(),
    "int64": pa.int64(),
    "bool": pa.bool_(),
}


def arrow_schema(schema: TableSchema) -> pa.Schema:
    """The columns of a schema and their Arrow types."""
    return pa.schema([(column.name, ARROW_TYPES[column.type]) for column in schema.columns])


def typed_table(schema: TableSchema, columns: Mapping[str, Any]) -> pa.Table:
    """A table of columns (n,) as `tasks.tables.parquet.write_table` takes them.

    Raises
    ------
    ValueError
        If the columns do not fit the schema.
    """
    unknown = sorted(set(columns) - {column.name for column in schema.columns})
    if unknown:
        raise ValueError(f"{schema.name}: no such columns: {', '.join(unknown)}")
    rows = len(next(iter(columns.values())))
    return pa.table({column.name: _array(schema, column, columns, rows) for column in schema.columns})


def _array(schema: TableSchema, column: Column, columns: Mapping[str, Any], rows: int) -> pa.Array:
    """One column in its type, checked against the schema."""
    name = f"{schema.name}.{column.name}"
    if column.name not in columns:
        if not column.nullable:
            raise ValueError(f"{name}: the column is missing")
        return pa.nulls(rows, ARROW_TYPES[column.type])
    values = columns[column.name]
    if isinstance(values, pa.ChunkedArray):
        values = values.combine_chunks()
    of_arrow = isinstance(values, pa.Array)
    if not of_arrow:
        values = pa.array(values, from_pandas=True)  # NaN is null
    array = values if values.type == ARROW_TYPES[column.type] else values.cast(ARROW_TYPES[column.type])
    if column.type == "float64":
        if of_arrow:
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
