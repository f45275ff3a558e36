"""Tables of other runs that a project names: checked before they are taken into memory."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from tasks.errors import InputError
from tasks.plain_text import trouble_in
from tasks.storage.delivered_file import file_limits, opened
from tasks.storage.json_text import from_json
from tasks.tables.parquet import METADATA
from tasks.tables.schemas import TableSchema


def read_foreign_table(path: Path, schema: TableSchema, remedy: str) -> tuple[pd.DataFrame, str]:
    """A table of other results, and the CRS of its coordinates (empty without any).

    Parameters
    ----------
    schema : the columns that are read, and no others.
    remedy : what to do if it is none.

    Raises
    ------
    InputError
        If the file is no such table, has more rows than this installation reads, or names nobody can read.
    """
    with opened(path, "table") as stream:
        try:
            file = pq.ParquetFile(stream)
            # A page of some bytes can stand for any number of rows.
            file_limits().require_rows(path, file.metadata.num_rows)
            described = from_json((file.schema_arrow.metadata or {}).get(METADATA, b"{}"))
            columns = [column.name for column in schema.columns if column.name in file.schema_arrow.names]
            table = file.read(columns=columns)
        except (OSError, pa.ArrowException, ValueError, RecursionError) as error:
            raise InputError("This is not a Parquet table.", remedy, file=path) from error
    if not isinstance(described, dict) or (described.get("schema"), described.get("version")) != (
        schema.name,
        schema.version,
    ):
        raise InputError(
            f"This is not a table '{schema.name}' of version {schema.version}.", remedy, file=path
        )
    _require_readable(table, path, remedy)
    return table.to_pandas(), str(described.get("crs", ""))


def _require_readable(table: pa.Table, path: Path, remedy: str) -> None:
    for name in table.column_names:
        if pa.types.is_string(table.schema.field(name).type):
            for text in table.column(name).unique().to_pylist():
                trouble = None if text is None else trouble_in(text)
                if trouble is not None:
                    raise InputError(trouble, remedy, file=path, entity=name)
