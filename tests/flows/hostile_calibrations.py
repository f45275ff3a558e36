"""Calibrations that somebody has damaged: tables of a folder of results, and a registry with its project."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import strategies as st

from tasks.registry.registry import Registry
from tasks.settings.registry import registry_address
from tests.flows.conftest import COLUMNS, FOCAL_LENGTH_MM, PIXEL_UM, ROWS
from tests.flows.hostile_inputs import PART, REGISTERED, REGISTRY, Hostile, damage, place, tokens
from tests.flows.test_registered_calibration_use import calibration
from tests.tasks.registry.records import add, approve

#: The folder of results a check takes its calibration from, and the tables of it that it reads.
FOLDER = "calibration"
TABLES = (
    "parameters",
    "correlations",
    "control_residuals",
    "control_points",
    "cameras",
    "parameter_influences",
    "exposures",
)
#: What the project of the block has of its camera, and what one with a registry has instead.
_OF_REGISTRY = {
    'name = "two strips"': 'name = "registered"\nflown = 2024-06-01',
    'file = "camera.xml"\nformat = "ign-xml"\n': f"""columns = {COLUMNS}
rows = {ROWS}
pixel_um = {PIXEL_UM}
focal_length_mm = {FOCAL_LENGTH_MM}
principal_point_mm = [0.0, 0.0]
calibration = "registry"
calibration_use = "consider"
identity = {{ body = "B" }}
""",
    '[cameras.C.additional_parameters]\n"brown-forward:k1" = 1e-4\n': "",
    'free = ["boresight", "time_offset"]': 'free = ["time_offset"]',
}
_NUMBERS = ("nan", "inf", "-1.0", "0.0", "1e300", "1e-300", "57.3", "null")
_TEXTS = ("", "x", "\u202e", "\x00", "é" * 300, "null")


def write_registered(folder: Path) -> None:
    """A registry with an approved calibration, and the project of the block that considers it."""
    registry = Registry.at(registry_address(str(folder / REGISTRY)))
    add(registry, calibration())
    approve(registry, 1, date(2024, 5, 2))
    text = (folder / "project.toml").read_text()
    for where, instead in _OF_REGISTRY.items():
        assert where in text
        text = text.replace(where, instead)
    (folder / REGISTERED).write_text(text)


def change_table(path: Path, change: Hostile) -> None:
    """Write a table anew with one change; what stands beside its columns in the file stays."""
    table = pq.read_table(path)
    pq.write_table(TABLE_CHANGES[change.what](table, change), path)


def _with_column(table: pa.Table, column: int, values: pa.Array) -> pa.Table:
    changed = table.set_column(column, table.column_names[column], values)
    return changed.replace_schema_metadata(table.schema.metadata)


def _value_changed(table: pa.Table, change: Hostile) -> pa.Table:
    column = place(change.where, table.num_columns)
    kind = table.schema.field(column).type
    values = table.column(column).to_pylist()
    row = place(change.other, len(values))
    choice = int(change.value)
    if pa.types.is_string(kind):
        text = _TEXTS[choice % len(_TEXTS)]
        values[row] = None if text == "null" else text
    elif pa.types.is_floating(kind):
        number = _NUMBERS[choice % len(_NUMBERS)]
        values[row] = None if number == "null" else float(number)
    elif pa.types.is_integer(kind):
        values[row] = (None, -1, 0, 2**31 - 1)[choice % 4]
    else:
        values[row] = None
    return _with_column(table, column, pa.array(values, kind))


def _retyped(table: pa.Table, change: Hostile) -> pa.Table:
    column = place(change.where, table.num_columns)
    values = table.column(column).to_pylist()
    others: tuple[Callable[[Any], Any], ...] = (str, lambda _value: True, lambda _value: [1.0], _length)
    other = others[int(change.value) % len(others)]
    return _with_column(table, column, pa.array([other(value) for value in values]))


def _length(value: object) -> int:
    return len(str(value))


def _reordered(table: pa.Table, change: Hostile) -> pa.Table:
    rows = list(range(len(table)))
    one, other = place(change.where, len(rows)), place(change.other, len(rows))
    if change.what == "row lost":
        del rows[one]
    elif change.what == "row twice":
        rows.insert(other, rows[one])
    elif change.what == "rows gone":
        rows = []
    return table.take(pa.array(rows, pa.int64()))


def _column_lost(table: pa.Table, change: Hostile) -> pa.Table:
    return table.remove_column(place(change.where, table.num_columns))


def _scaled(table: pa.Table, change: Hostile) -> pa.Table:
    numbers = [i for i, field in enumerate(table.schema) if pa.types.is_floating(field.type)]
    if not numbers:
        return table
    column = numbers[place(change.where, len(numbers))]
    factor = (1.001, 10.0, -1.0, 1e-3, 1e12)[int(change.value) % 5]
    return _with_column(table, column, pa.array(pd.Series(table.column(column).to_pandas() * factor)))


#: The kinds of changes that :func:`change_table` makes.
TABLE_CHANGES = {
    "value": _value_changed,
    "type": _retyped,
    "column lost": _column_lost,
    "column scaled": _scaled,
    **dict.fromkeys(("row lost", "row twice", "rows gone"), _reordered),
}
_TABLE = st.sampled_from([f"{FOLDER}/{name}.parquet" for name in TABLES])
_CHOICE = st.integers(0, 59).map(str)

#: Changes to a calibration that a project applies: tables written anew or damaged, project and registry.
HOSTILE_CALIBRATION = st.one_of(
    st.builds(Hostile, st.sampled_from([*TABLE_CHANGES]), _TABLE, PART, PART, _CHOICE),
    st.builds(Hostile, st.sampled_from([*TABLE_CHANGES]), _TABLE, PART, PART, _CHOICE),
    damage(_TABLE),
    tokens(st.just(REGISTERED)),
    damage(st.just(REGISTRY)),
)
