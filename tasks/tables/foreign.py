"""Tables of other runs that a project names: checked before they are taken into memory."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tasks.errors import Location
from tasks.files.delivered_file import file_limits, opened
from tasks.files.json_text import from_json
from tasks.magnitude import HUGE
from tasks.plain_text import quoted, trouble_in
from tasks.tables.arrow_columns import ARROW_TYPES
from tasks.tables.parquet import METADATA
from tasks.tables.schemas.columns import Column, TableSchema


def read_foreign_table(
    path: Path, schema: TableSchema, remedy: str, *, complete: bool = False
) -> tuple[pd.DataFrame, str]:
    """A table of other results, and the CRS of its coordinates (empty without any).

    Parameters
    ----------
    schema : the columns that are read, and no others.
    remedy : what to do if it is none.
    complete : whether columns that may be empty have to be there, too; those that results of older versions
        lack are else empty, but for coordinates.

    Raises
    ------
    InputError
        If the file is no such table, has more rows than this installation reads, names nobody can read, or
        anything that the columns of the schema may not hold.
    """
    with opened(path, "table") as stream:
        try:
            file = pq.ParquetFile(stream)
            # A page of some bytes can stand for any number of rows.
            file_limits().require_rows(path, file.metadata.num_rows)
            stored = file.schema_arrow  # made each time it is asked for
            described = from_json((stored.metadata or {}).get(METADATA, b"{}"))
            columns = [column.name for column in schema.columns if column.name in stored.names]
            table = file.read(columns=columns)
        except (OSError, pa.ArrowException, ValueError, RecursionError) as error:
            raise Location(path).error("This is not a Parquet table.", remedy) from error
    if not isinstance(described, dict) or (described.get("schema"), described.get("version")) != (
        schema.name,
        schema.version,
    ):
        raise Location(path).error(
            f"This is not a table '{schema.name}' of version {schema.version}.", remedy
        )
    for column in schema.columns:
        needed = complete or not column.nullable or column.name in schema.coordinates
        if column.name not in table.column_names and not needed:
            table = table.append_column(column.name, pa.nulls(len(table), ARROW_TYPES[column.type]))
        trouble = _trouble_in_column(table, column)
        if trouble is not None:
            raise Location(path, entity=column.name).error(trouble, remedy)
    _require_readable(table, path, remedy)
    frame = table.to_pandas()
    if frame.duplicated(list(schema.key)).any():
        row = int(frame.duplicated(list(schema.key)).to_numpy().argmax())
        raise Location(path).error(f"Row {row + 1} repeats {', '.join(schema.key)} of another row.", remedy)
    return frame, str(described.get("crs", ""))


def _trouble_in_column(table: pa.Table, column: Column) -> str | None:
    """Why a column does not conform to its schema, as a sentence; None: it does."""
    if column.name not in table.column_names:
        return f"This table has no column '{column.name}'."
    values = table.column(column.name)
    if values.type != ARROW_TYPES[column.type]:
        return f"The column '{column.name}' is {values.type}, not {column.type}."
    if values.null_count and not column.nullable:
        return f"The column '{column.name}' has empty fields."
    if column.type == "float64":
        # NaN, which stands nowhere in a table, is no less or equal.
        possible = pc.less_equal(pc.abs(values), HUGE)
        if not pc.all(possible, min_count=0).as_py():
            return f"The column '{column.name}' has a number that no quantity has."
    if column.values:
        strange = set(values.unique().drop_null().to_pylist()) - set(column.values)
        if strange:
            return f"The column '{column.name}' has {quoted(min(strange))}, which is not a permitted value."
    return None


def _require_readable(table: pa.Table, path: Path, remedy: str) -> None:
    for name in table.column_names:
        if pa.types.is_string(table.schema.field(name).type):
            for text in table.column(name).unique().to_pylist():
                trouble = None if text is None else trouble_in(text)
                if trouble is not None:
                    raise Location(path, entity=name).error(trouble, remedy)
