"""Write and read the tables of `tasks.tables.schemas`: checked, sorted, with units and frame in the file.

A table is written once by one stage, at once or row group by row group, into the folder of the stage under
the name of its schema. What does not fit its schema is a defect of that stage and raises ValueError: a
missing column, a number that is not finite where it must be, two rows with the same key. The bytes depend on
the content only: not on times, host, paths, or the pieces a table came in.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tasks.coordinates.crs import MapFrame
from tasks.files.in_turn import in_turn
from tasks.files.installation import InstallationError
from tasks.files.json_text import from_json
from tasks.store.artifact import Artifact, verified
from tasks.tables.arrow_columns import arrow_schema, typed_table
from tasks.tables.geometry import GEOMETRY, Box, box_of, description, with_geometry
from tasks.tables.key_order import ascending, order_of
from tasks.tables.schemas.columns import TableSchema
from tasks.tables.schemas.register import SCHEMAS

METADATA = b"aerocal"
ROW_GROUP = 100_000


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
    _require_frame(schema, frame)
    table = typed_table(schema, columns)
    for name, values in (extra or {}).items():
        if name not in table.column_names and name != GEOMETRY:
            table = table.append_column(name, values)
    table = table.take(pa.array(order_of(table, schema)))
    return _write(path, schema, table.schema, [table], frame, box_of(table, schema))


def write_row_groups(
    path: Path,
    schema: TableSchema,
    chunks: Iterable[Mapping[str, Any]],
    frame: MapFrame | None = None,
    box: Box | None = None,
    extra: Sequence[str] = (),
) -> int:
    """Write a table that is never in memory as a whole, with the same bytes as :func:`write_table`.

    Parameters
    ----------
    chunks : the columns of consecutive rows, as for :func:`write_table`; any number of rows in each, all in
        the order of the key.
    box : of all coordinates; needed beforehand, because it is in the description of the geometry.
    extra : further text columns in all of `chunks`, which are none of the schema; kept after those of it.

    Returns
    -------
    rows : number of rows written.

    Raises
    ------
    ValueError
        If the columns do not fit the schema, or the rows are not in the order of its key.
    """
    _require_frame(schema, frame)
    fields = pa.schema([*arrow_schema(schema), *(pa.field(name, pa.string()) for name in extra)])
    tables = ascending((_chunk(schema, columns, extra) for columns in chunks), schema)
    return _write(path, schema, fields, tables, frame, box)


def _chunk(schema: TableSchema, columns: Mapping[str, Any], extra: Sequence[str]) -> pa.Table:
    """Rows in the types of the schema, and the further text columns."""
    table = typed_table(schema, {name: values for name, values in columns.items() if name not in extra})
    for name in extra:
        table = table.append_column(name, columns[name])
    return table


def _require_frame(schema: TableSchema, frame: MapFrame | None) -> None:
    if schema.coordinates and frame is None:
        raise ValueError(f"{schema.name}: coordinates need a CRS")


def _write(
    path: Path,
    schema: TableSchema,
    fields: pa.Schema,
    tables: Iterable[pa.Table],
    frame: MapFrame | None,
    box: Box | None,
) -> int:
    """Write sorted tables one after the other; returns the number of rows."""
    metadata = {METADATA: json.dumps(_metadata(schema, frame), sort_keys=True, ensure_ascii=False).encode()}
    if schema.coordinates and frame is not None:
        fields = fields.append(pa.field(GEOMETRY, pa.binary()))
        metadata[b"geo"] = json.dumps(description(frame, box), sort_keys=True).encode()
    # Numbers hardly ever repeat: dictionaries of them take most of the time, and a fifth of the space.
    texts = [field.name for field in fields if pa.types.is_string(field.type)]
    with pq.ParquetWriter(
        path, fields.with_metadata(metadata), compression="zstd", use_dictionary=texts
    ) as writer:

        def write(group: pa.Table) -> int:
            writer.write_table(group.replace_schema_metadata(metadata), row_group_size=ROW_GROUP)
            return len(group)

        groups = _row_groups(tables)
        if schema.coordinates:
            groups = (with_geometry(group, schema) for group in groups)
        # While a group is encoded and compressed, the next one is made.
        rows = sum(in_turn(write, groups, threads=1))
        if rows == 0:
            # Not every reader takes a file without any row group.
            writer.write_table(writer.schema.empty_table())
    return rows


def _row_groups(tables: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """The rows of all tables in groups of the same size but the last, each in one piece."""
    pieces: list[pa.Table] = []
    waiting = 0
    for table in tables:
        pieces.append(table)
        waiting += len(table)
        if waiting >= ROW_GROUP:
            joined = pa.concat_tables(pieces)
            full = waiting - waiting % ROW_GROUP
            for start in range(0, full, ROW_GROUP):
                yield joined.slice(start, ROW_GROUP).combine_chunks()
            pieces, waiting = [joined.slice(full)], waiting - full
    if waiting:
        yield pa.concat_tables(pieces).combine_chunks()


def read_table(
    artifact: Artifact, categories: bool = False, columns: Sequence[str] | None = None
) -> pd.DataFrame:
    """Read a table of the contract into pandas, without its geometry column.

    Text columns are text, a null number is NaN.

    Parameters
    ----------
    categories : text columns are categories in the order of their code points: a million names that repeat
        are compared and grouped as integers.
    columns : names of those to be read; None: all.

    Raises
    ------
    InstallationError
        If the file's digest differs, or it is not a table of this name in the version this program knows.
    """
    verified(artifact)
    if categories:
        return _last_long_table(artifact, None if columns is None else tuple(columns)).copy(deep=False)
    return _read(artifact, categories, columns)


@lru_cache(maxsize=1)
def _last_long_table(artifact: Artifact, columns: tuple[str, ...] | None) -> pd.DataFrame:
    """A table with categories, which the next stage often reads again; a copy shares its memory."""
    return _read(artifact, True, columns)


def _read(artifact: Artifact, categories: bool, columns: Sequence[str] | None) -> pd.DataFrame:
    path, schema = artifact.path, SCHEMAS.get(artifact.name)
    texts = [column.name for column in schema.columns if column.type == "string"] if schema else []
    with pq.ParquetFile(path, read_dictionary=texts if categories else None) as file:
        # Threads cost more than they save where a table is small.
        threads = file.metadata.num_rows > ROW_GROUP
        described = from_json((file.schema_arrow.metadata or {}).get(METADATA, b"{}"))
        if schema is None or (described.get("schema"), described.get("version")) != (
            schema.name,
            schema.version,
        ):
            raise InstallationError(
                f"{artifact.path} is not a table '{artifact.name}' that this version of aerocal can read.",
                "Run again with an empty output folder.",
            )
        names = [name for name in columns or file.schema_arrow.names if name != GEOMETRY]
        table = file.read(columns=names, use_threads=threads)
    if not categories:
        return cast(pd.DataFrame, table.to_pandas(use_threads=threads))
    of_text = [name for name in names if name in texts]
    numbers = table.drop_columns(of_text).to_pandas(use_threads=threads, split_blocks=True)
    table = table.select(of_text).unify_dictionaries()
    return pd.DataFrame(
        {name: _in_order(table[name]) if name in of_text else numbers[name] for name in names}, copy=False
    )


def _in_order(texts: pa.ChunkedArray) -> pd.Series:
    """The same texts as categories in order; as they are read, those of the first row come first."""
    if len(texts) == 0:
        return pd.Series(pd.Categorical([], categories=pd.Index([], dtype="str")))
    found = texts.chunk(0).dictionary
    order = pc.sort_indices(found)
    rank = np.full(len(found) + 1, -1)  # the last is that of null
    rank[order.to_numpy()] = np.arange(len(found))
    codes = pa.chunked_array([chunk.indices for chunk in texts.chunks]).fill_null(len(found)).to_numpy()
    names = pd.Index(found.take(order).to_pandas())
    return pd.Series(pd.Categorical.from_codes(rank[codes], dtype=pd.CategoricalDtype(names)))


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


def write_stage_table(
    folder: Path,
    schema: TableSchema,
    content: pd.DataFrame | Mapping[str, Any],
    frame: MapFrame | None = None,
    extra: Mapping[str, pa.Array] | None = None,
) -> None:
    """Write FOLDER/NAME.parquet from its columns; parameters and errors as of `write_table`."""
    if isinstance(content, pd.DataFrame):
        content = {str(name): column.to_numpy() for name, column in content.items()}
    write_table(folder / f"{schema.name}.parquet", schema, content, frame, extra)


def of_schema(table: pd.DataFrame, schema: TableSchema) -> pd.DataFrame:
    """The columns of a schema, of a table that has others besides."""
    return table[[column.name for column in schema.columns]]
