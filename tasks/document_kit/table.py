"""Tables of the report: every number has its full value in addition to the digits shown.

The page writes the full value into ``data-value``, so that a program (and the tests) can compare the report
with the artifacts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple, TypeAlias

from markupsafe import Markup, escape

#: Shown where a number does not exist.
NONE = "–"
# With more decimals than this a number is shown as a power of ten: 1.014e−9 and not 0.000000001014.
_MOST_DECIMALS = 7


class Number(NamedTuple):
    """A number in a table.

    Attributes
    ----------
    value : the full value; None or NaN: it does not exist.
    decimals : digits shown after the point; with more than seven the number is a power of ten, to the same
        place.
    plus : whether a positive number shows its sign.
    """

    value: float | None
    decimals: int = 0
    plus: bool = False

    @property
    def exists(self) -> bool:
        """Whether there is a value."""
        return self.value is not None and math.isfinite(self.value)

    @property
    def data(self) -> str:
        """The full value as text that reads back exactly; empty without a value."""
        value = self[0]
        return repr(float(value)) if value is not None and math.isfinite(value) else ""

    def __str__(self) -> str:
        value, decimals, plus = self
        if value is None or not math.isfinite(value):
            return NONE
        sign = "+" if plus else ""
        if decimals > _MOST_DECIMALS and value != 0.0:
            digits = max(_exponent(value) + decimals, 0)
            mantissa, exponent = f"{value:{sign}.{digits}e}".split("e")
            return f"{mantissa}e{int(exponent)}".replace("-", "−")
        text = f"{value:{sign},.{decimals if decimals <= _MOST_DECIMALS else 0}f}"
        # A zero that was rounded has no sign.
        if text[-1] == "0" and not text.strip("+-0.,"):
            text = text.lstrip("+-")
        return text.replace("-", "−") if value < 0.0 else text


Cell: TypeAlias = str | Number


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    name : for programs, in ``data-column``.
    heading : for people.
    unit : shown under the heading; empty for texts and counts.
    numeric : whether its cells are numbers, which stand at the right.
    """

    name: str
    heading: str
    unit: str = ""
    numeric: bool = True


@dataclass(frozen=True)
class Row:
    """One row: its key for programs, and a cell for each column."""

    key: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    name : the id of the table in the page.
    caption : what it shows.
    columns, rows : the first column names the row.
    note : a sentence under it, such as what was left out; empty: none.
    linked : keys of the rows that have an id, to which a link leads.
    """

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    note: str = ""
    linked: frozenset[str] = frozenset()

    def row_id(self, key: str) -> str:
        """The id of a row that is linked."""
        return f"{self.name}-row-{[row.key for row in self.rows].index(key) + 1}"

    @property
    def body(self) -> Markup:
        """The rows as HTML; for thousands of rows, a template would take as long as the adjustment."""
        texts = ["<td>" if column.numeric else '<td class="words">' for column in self.columns]
        values = [f'<td data-column="{escape(column.name)}" data-value="' for column in self.columns]
        escaped = cache(lambda text: str(escape(text)))  # names of strips repeat, and most texts are empty
        lines = []
        for row in self.rows:
            cells = "".join(
                f"{text}{escaped(cell)}</td>" if isinstance(cell, str) else f'{value}{cell.data}">{cell}</td>'
                for text, value, cell in zip(texts, values, row.cells, strict=True)
            )
            anchor = f' id="{self.row_id(row.key)}"' if row.key in self.linked else ""
            lines.append(f'<tr{anchor} data-key="{escaped(row.key)}">{cells}</tr>\n')
        return Markup("".join(lines))


def text_column(name: str, heading: str) -> Column:
    """A column of texts."""
    return Column(name, heading, numeric=False)


def components(pattern: str, headings: Sequence[str], unit: str, names: Sequence[str]) -> tuple[Column, ...]:
    """Columns for the components of a vector; `pattern` takes each of `names`."""
    return tuple(Column(pattern.format(n), heading, unit) for n, heading in zip(names, headings, strict=True))


def numbers(values: Iterable[float | None], decimals: int, *, plus: bool = False) -> tuple[Number, ...]:
    """Cells with the same number of decimals."""
    return tuple(Number(None if value is None else float(value), decimals, plus) for value in values)


def decimals_for(value: float | None, digits: int = 2) -> int:
    """Decimals that show `digits` significant digits of a value, such as a standard deviation; 0 or more."""
    if value is None or not math.isfinite(value) or value == 0.0:
        return 0
    return max(digits - 1 - _exponent(value, digits - 1), 0)


def _exponent(value: float, digits: int = 17) -> int:
    """Power of ten of a value rounded to so many digits after the first."""
    return int(f"{abs(value):.{digits}e}".split("e")[1])
