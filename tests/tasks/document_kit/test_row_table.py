"""Tables of records: cells of data frames and of objects, digits of another value, keys, omitted rows."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from tasks.document_kit.row_table import flag_of, number_of, numbers_of, omitted, table_of, text_of


@dataclass(frozen=True)
class Measured:
    """A value with its σ."""

    name: str
    value: float | None
    sigma: float | None
    good: bool


SHOWN = (
    text_of("name", "name"),
    number_of("value", "value", "mm", "sigma", plus=True, factor=1e3),
    number_of("sigma", "σ", "mm", "sigma", factor=1e3),
    flag_of("good", "verdict", "kept", "missed"),
)
RECORDS = (Measured("a", 0.01234, 0.0005, True), Measured("b", None, None, False))


def texts(records: object) -> list[tuple[str, list[str]]]:
    """Key and cells of each row as they are shown."""
    table = table_of("t", "T", SHOWN, records, "{name}:{good}")  # type: ignore[arg-type]
    return [(row.key, [str(cell) for cell in row.cells]) for row in table.rows]


def test_objects_and_rows_of_a_frame_give_the_same_cells() -> None:
    expected = [("a:True", ["a", "+12.34", "0.50", "kept"]), ("b:False", ["b", "–", "–", "missed"])]
    assert texts(RECORDS) == expected
    assert texts(pd.DataFrame([vars(one) for one in RECORDS])) == expected


def test_a_table_without_rows_has_its_columns() -> None:
    table = table_of("t", "T", SHOWN, (), "")
    assert [column.name for column in table.columns] == ["name", "value", "sigma", "good"]
    assert [column.numeric for column in table.columns] == [False, True, True, False]
    assert table.rows == ()


def test_components_may_have_other_names_in_the_records() -> None:
    shown = numbers_of("d{}_m", ("east", "north"), "m", "xy", 2, of="left_out_{}")
    table = table_of("t", "T", shown, [{"left_out_x": 1.0, "left_out_y": 2.5}], "{left_out_x}")
    assert [column.name for column in table.columns] == ["dx_m", "dy_m"]
    assert [str(cell) for cell in table.rows[0].cells] == ["1.00", "2.50"]


def test_a_note_says_what_is_omitted() -> None:
    assert omitted(range(3), range(3), "a.parquet") == ""
    assert omitted(range(3), range(1200), "a.parquet") == "The first 3 of 1,200; all in a.parquet."
    assert omitted(range(3), range(4), "a.parquet", largest=True) == "The 3 largest of 4; all in a.parquet."
