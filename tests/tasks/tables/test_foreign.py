"""Tables of other results are what their schema says, or refused with file, column and reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tasks.errors import InputError
from tasks.tables.foreign import read_foreign_table
from tasks.tables.parquet import write_table
from tasks.tables.schemas.parameters import PARAMETERS

ROWS = {
    "parameter": ["focal_length", "boresight_roll"],
    "entity": ["C", "C"],
    "value": [50.0, 0.01],
    "unit": ["mm", "deg"],
    "status": ["significant", "fixed"],
    "change": [0.0, 0.0],
}


def without(name: str) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.drop_columns([name])


def having(name: str, values: pa.Array) -> Callable[[pa.Table], pa.Table]:
    def changed(table: pa.Table) -> pa.Table:
        found = table.set_column(table.column_names.index(name), name, values)
        return found.replace_schema_metadata(table.schema.metadata)

    return changed


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_table(tmp_path / "parameters.parquet", PARAMETERS, ROWS)
    return tmp_path / "parameters.parquet"


def test_a_table_comes_back_and_columns_added_since_are_empty(file: Path) -> None:
    pq.write_table(without("sigma_prior")(pq.read_table(file)), file)
    table, crs = read_foreign_table(file, PARAMETERS, "Repeat it.")
    assert sorted(table["value"]) == [0.01, 50.0]
    assert table["sigma_prior"].isna().all()
    assert crs == ""
    with pytest.raises(InputError, match="no column 'sigma_prior'"):
        read_foreign_table(file, PARAMETERS, "Repeat it.", complete=True)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (without("value"), "no column 'value'"),
        (having("value", pa.array(["50", "0"])), "'value' is string, not float64"),
        (having("value", pa.array([[50.0], [0.0]])), "'value' is list"),
        (having("value", pa.array([50.0, None])), "'value' has empty fields"),
        (having("value", pa.array([50.0, float("nan")])), "number that no quantity has"),
        (having("value", pa.array([50.0, -1e300])), "number that no quantity has"),
        (having("status", pa.array(["significant", "fine"])), "'fine', which is not a permitted value"),
        (having("parameter", pa.array(["focal_length"] * 2)), "Row 2 repeats parameter, entity"),
        (having("entity", pa.array(["C", "a\u202eb"])), "invisible character"),
    ],
)
def test_what_a_column_may_not_hold_is_named(
    file: Path, change: Callable[[pa.Table], pa.Table], said: str
) -> None:
    pq.write_table(change(pq.read_table(file)), file)
    with pytest.raises(InputError, match=said) as raised:
        read_foreign_table(file, PARAMETERS, "Repeat it.")
    assert (raised.value.file, raised.value.remedy) == (file, "Repeat it.")
