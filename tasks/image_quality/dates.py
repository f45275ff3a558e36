"""Compare an examination with that of an earlier date, and write what has changed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from tasks.errors import InputError
from tasks.files.json_text import JSON
from tasks.image_quality.drift import drift_remarks, drift_table
from tasks.image_quality.sensor_drift import quality_drift_remarks, quality_drift_table
from tasks.store.notes import Notes, write_notes
from tasks.tables.parquet import write_table
from tasks.tables.schemas import EDGE_DRIFT, QUALITY_DRIFT


def write_drift(folder: Path, tables: Mapping[str, pd.DataFrame], earlier: Path) -> None:
    """Write edge_drift.parquet, quality_drift.parquet and the remarks.

    Parameters
    ----------
    tables : of the examination of now, by name.
    earlier : folder of the earlier results.

    Raises
    ------
    InputError
        If a table there is none, or there is nothing to compare.
    """
    means = earlier / "edge_means.parquet"
    edges = pd.DataFrame(columns=[column.name for column in EDGE_DRIFT.columns])
    if "edge_means" in tables and means.is_file():
        edges = drift_table(tables["edge_means"], means)
    others = quality_drift_table(tables, earlier)
    if edges.empty and others.empty:
        raise InputError(
            "The earlier results and these have nothing in common.",
            "Name the folder of an examination of the same camera, likewise of scenes or of its sensor.",
            file=earlier,
        )
    for schema, table in ((EDGE_DRIFT, edges), (QUALITY_DRIFT, others)):
        columns = {column.name: table[column.name].to_numpy() for column in schema.columns}
        write_table(folder / f"{schema.name}.parquet", schema, columns)
    remarks = (*drift_remarks(edges), *quality_drift_remarks(others))
    figures: dict[str, JSON] = {
        "drift": {
            "drifted": len(remarks),
            "edge_means": len(edges),
            "drifted_edge_means": int(edges["drifted"].sum()),
            "quantities": len(others),
            "drifted_quantities": int(others["drifted"].sum()),
        }
    }
    write_notes(folder, Notes(remarks, figures))
