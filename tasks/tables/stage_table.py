"""Tables of a stage: each in the folder of the stage, under the name of its schema."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from tasks.coordinates.crs import MapFrame
from tasks.tables.parquet import write_table
from tasks.tables.schemas.columns import TableSchema


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
