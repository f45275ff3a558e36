"""Tables of records: each column states its heading and the cell it shows of a record, in one place.

A record is a row of a data frame or an object with attributes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence, Sized
from dataclasses import dataclass
from typing import Any, TypeAlias

import pandas as pd

from tasks.document_kit.table import Cell, Column, Number, Row, Table, decimals_for, text_column

#: Reads something of a record: the name of its value, or a function of the record.
Reading: TypeAlias = str | Callable[[Any], Any]


@dataclass(frozen=True)
class Shown:
    """A column, and its cell of a record."""

    column: Column
    cell: Callable[[Any], Cell]


def text_of(name: str, heading: str, of: Reading | None = None) -> Shown:
    """A column of texts: the value of this name, or what `of` reads; None is shown as nothing."""
    read = _reading(name if of is None else of)

    def cell(record: Any) -> str:
        value = read(record)
        return "" if value is None else str(value)

    return Shown(text_column(name, heading), cell)


def flag_of(name: str, heading: str, yes: str = "yes", no: str = "no") -> Shown:
    """A column of yes and no, in these words."""
    read = _reading(name)
    return Shown(text_column(name, heading), lambda record: yes if read(record) else no)


def number_of(
    name: str,
    heading: str,
    unit: str = "",
    decimals: int | Reading = 0,
    *,
    plus: bool = False,
    factor: float = 1.0,
    of: Reading | None = None,
) -> Shown:
    """A column of numbers.

    Parameters
    ----------
    name : of the column, and of the value unless `of` is given.
    decimals : as many, those that show two digits of another value (its name), or a function of the record.
    plus : whether positive numbers show their sign.
    factor : of the value, which makes it one in `unit`.
    of : what is read instead of the value called `name`.
    """
    read = _reading(name if of is None else of)
    places = _places(decimals, factor)

    def cell(record: Any) -> Number:
        value = read(record)
        return Number(None if value is None else float(value) * factor, places(record), plus)

    return Shown(Column(name, heading, unit), cell)


def numbers_of(
    pattern: str,
    headings: Sequence[str],
    unit: str,
    names: Sequence[str],
    decimals: int = 0,
    *,
    plus: bool = False,
    of: str | None = None,
) -> tuple[Shown, ...]:
    """Columns for the components of a vector.

    Parameters
    ----------
    pattern : of the names of the columns, with a place for each of `names`.
    of : the same for the names of the values, where they differ.
    """
    read = pattern if of is None else of
    return tuple(
        number_of(pattern.format(name), heading, unit, decimals, plus=plus, of=read.format(name))
        for name, heading in zip(names, headings, strict=True)
    )


def table_of(
    name: str,
    caption: str,
    shown: Sequence[Shown],
    records: pd.DataFrame | Iterable[object],
    key: str | Callable[[Any], str],
    note: str = "",
) -> Table:
    """A table of records.

    Parameters
    ----------
    key : of a row: a pattern with names of values, such as ``{point}:{other_point}``, or a function.
    """
    rows = _records(records) if isinstance(records, pd.DataFrame) else tuple(records)
    key_of = _pattern(key) if isinstance(key, str) else key
    made = tuple(Row(key_of(row), tuple(one.cell(row) for one in shown)) for row in rows)
    return Table(name, caption, tuple(one.column for one in shown), made, note)


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows by names of columns, as ``to_dict`` of pandas gives them in three times the time."""
    columns = {str(name): column.tolist() for name, column in table.items()}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def omitted(listed: Sized, total: Sized, file: str, *, largest: bool = False) -> str:
    """A note on what a table of the first rows, or of the largest, omits; empty if it omits nothing."""
    few = f"{len(listed):,} largest" if largest else f"first {len(listed):,}"
    return "" if len(listed) == len(total) else f"The {few} of {len(total):,}; all in {file}."


def _reading(of: Reading) -> Callable[[Any], Any]:
    if callable(of):
        return of
    return lambda record: record[of] if isinstance(record, dict) else getattr(record, of)


def _places(decimals: int | Reading, factor: float) -> Callable[[Any], int]:
    if isinstance(decimals, int):
        return lambda _: decimals
    read = _reading(decimals)
    if callable(decimals):
        return read

    def places(record: Any) -> int:
        value = read(record)
        return decimals_for(None if value is None else float(value) * factor)

    return places


def _pattern(pattern: str) -> Callable[[Any], str]:
    return lambda record: pattern.format_map(record if isinstance(record, dict) else vars(record))
