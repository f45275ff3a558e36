"""Rows of text split into fields: fast if they are correct, otherwise naming the wrong line and field.

Rows go through Arrow's compiled parser. Pieces of a file that it does not take as they stand (blank lines,
quotation marks behind blanks, anything wrong) are read row by row, which finds the field to blame. Both read
numbers to the last digit.
"""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from tasks.errors import InputError, Location
from tasks.formats.table_layout import MARKS, Separator
from tasks.formats.text_lines import line_feeds
from tasks.plain_text import quoted

_NAMES = pa.dictionary(pa.int32(), pa.string())
_DECIMAL_COMMA = re.compile(r"^[+-]?\d+,\d+$")
# No spreadsheet writes more of them for a row without anything.
_MOST_FIELDS = 1_000
_BLANK, _LINE_FEED = ord(" "), ord("\n")


@dataclass(frozen=True, slots=True)
class Layout:
    """What the rows of a file hold.

    Attributes
    ----------
    file : for messages.
    names : the columns in their order in the file.
    numeric : those that are numbers.
    separator : between columns; ``blank`` for any run of blanks and tabs.
    encoding : of the text columns.
    decimal : mark of numbers.
    quote : mark around texts with separators.
    """

    file: Path
    names: tuple[str, ...]
    numeric: tuple[str, ...]
    separator: Separator
    encoding: str = "utf-8"
    decimal: str = "."
    quote: str = '"'

    @property
    def texts(self) -> tuple[str, ...]:
        """The columns that are text."""
        return tuple(name for name in self.names if name not in self.numeric)


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Consecutive rows of a file, without blank ones.

    Attributes
    ----------
    texts : column by column as `Layout.texts`, (m,) with a dictionary; empty fields are null.
    values : (m, k) columns as `Layout.numeric`; NaN where a field is empty.
    line : (m,) lines, counted from the first of these rows; None: each row is a line.
    """

    texts: tuple[pa.DictionaryArray, ...]
    values: NDArray[np.float64]
    line: NDArray[np.int32] | None = None


def rows_of(content: bytes, layout: Layout, first_line: int) -> Rows:
    """Split rows into fields.

    Parameters
    ----------
    content : whole lines that end in LF, but for the last of a file.
    first_line : the line of the file in which they start.

    Raises
    ------
    InputError
        Naming the line: too many or too few columns, a field that is not a number, an open quotation mark,
        bytes that are not text in this encoding.
    """
    return _plain_rows(content, layout) or _single_rows(content, layout, first_line)


def _plain_rows(content: bytes, layout: Layout) -> Rows | None:
    """Rows that Arrow takes as they are; None: they must be examined more closely."""
    # A NUL ends a field for one of them; blanks before a quotation mark are passed over by one only.
    if b"\0" in content or (layout.quote.encode() in content and _marks_behind_blanks(content, layout)):
        return None
    if layout.encoding != "utf-8" and not content.isascii():
        content = content.decode(layout.encoding).encode("utf-8")
    if layout.separator == "blank":
        content = _with_single_blanks(content)
    lines = line_feeds(content) + (not content.endswith(b"\n"))
    types = {name: pa.float64() if name in layout.numeric else _NAMES for name in layout.names}
    try:
        table = pa.csv.read_csv(
            pa.py_buffer(content),
            # As one block, so that no names are looked up again to join those of several.
            pa.csv.ReadOptions(
                use_threads=False, column_names=list(layout.names), block_size=len(content) + 1
            ),
            pa.csv.ParseOptions(delimiter=MARKS[layout.separator], quote_char=layout.quote),
            pa.csv.ConvertOptions(
                column_types=types,
                null_values=[""],
                strings_can_be_null=True,
                check_utf8=True,
                decimal_point=layout.decimal,
            ),
        )
    except (pa.ArrowException, ValueError):
        return None
    # Rows without anything are passed over, and the lines of the others are not known.
    if len(table) != lines or all(column.null_count for column in table.columns):
        return None
    values = np.empty((lines, len(layout.numeric)))
    for position, name in enumerate(layout.numeric):
        column = table.column(name)
        numbers = column.to_numpy()
        # "nan" is not a number, whatever Arrow makes of it.
        if np.count_nonzero(np.isnan(numbers)) != column.null_count:
            return None
        values[:, position] = numbers
    blanks = layout.separator != "blank" and (b" " in content or b"\t" in content)
    texts = tuple(_joined(table.column(name)) for name in layout.texts)
    return Rows(tuple(map(_without_leading_blanks, texts)) if blanks else texts, values)


def _marks_behind_blanks(content: bytes, layout: Layout) -> bool:
    mark = layout.quote.encode()
    return layout.separator == "blank" or b" " + mark in content or b"\t" + mark in content


def _with_single_blanks(content: bytes) -> bytes:
    """Rows whose columns are separated by one blank, without any at their ends."""
    signs = np.frombuffer(content.replace(b"\t", b" "), dtype=np.uint8)
    blank = signs == _BLANK
    before = np.empty_like(blank)
    before[:1] = True
    np.logical_or(blank[:-1], signs[:-1] == _LINE_FEED, out=before[1:])
    kept = ~(blank & before)
    signs, blank = signs[kept], blank[kept]
    behind = np.ones_like(blank)
    np.equal(signs[1:], _LINE_FEED, out=behind[:-1])
    return bytes(signs[~(blank & behind)].data)


def _joined(column: pa.ChunkedArray) -> pa.DictionaryArray:
    joined = column.unify_dictionaries().combine_chunks()
    return joined if isinstance(joined, pa.Array) else pa.concat_arrays(joined.chunks)


def _without_leading_blanks(texts: pa.DictionaryArray) -> pa.DictionaryArray:
    import pyarrow.compute as pc

    trimmed = pc.utf8_ltrim(texts.dictionary, " \t")
    if trimmed.equals(texts.dictionary):
        return texts
    plain = pc.if_else(pc.equal(trimmed, ""), None, trimmed)
    return plain.take(texts.indices).dictionary_encode()


def _single_rows(content: bytes, layout: Layout, first_line: int) -> Rows:
    """Rows one by one.

    Raises
    ------
    InputError
        As of :func:`rows_of`.
    """
    texts: list[list[str | None]] = [[] for _ in layout.texts]
    values, lines = array("d"), array("i")
    for line, fields in _fields(content, layout, first_line):
        of_name = dict(zip(layout.names, fields, strict=True))
        for name, column in zip(layout.texts, texts, strict=True):
            column.append(of_name[name] or None)
        values.extend(_number(of_name[name], name, layout, line) for name in layout.numeric)
        lines.append(line - first_line)
    return Rows(
        tuple(pa.array(column, pa.string()).dictionary_encode() for column in texts),
        np.array(values).reshape(len(lines), len(layout.numeric)),
        np.array(lines, dtype=np.int32),
    )


def _fields(content: bytes, layout: Layout, first_line: int) -> Iterator[tuple[int, list[str]]]:
    """Line and fields of each row with anything in it; as many fields as columns.

    An empty field keeps its mark: a row with fewer marks is what a file ends with that was cut off inside it.
    One mark more, at the end, is not a column.
    """
    text, expected = _decoded(content, layout, first_line), len(layout.names)
    if layout.separator == "blank":
        text = re.sub(" +$", "", text.replace("\t", " "), flags=re.MULTILINE)
    rows = csv.reader(
        io.StringIO(text, newline=""),
        delimiter=MARKS[layout.separator],
        quotechar=layout.quote,
        skipinitialspace=True,
        strict=True,
    )
    line = first_line
    try:
        for row in rows:
            fields = [field.lstrip(" \t") for field in row]
            found = len(fields)
            if any(fields) or found > _MOST_FIELDS:
                if found > expected + 1 or any(fields[expected:]):
                    raise _too_many(layout, line)
                if found < expected and layout.separator != "blank":
                    raise Location(layout.file, line).error(
                        f"This line has {found} column{'s' * (found > 1)}, but the header has {expected}.",
                        "The file may have been cut off here: deliver it again. An empty field still needs "
                        f"its {layout.separator}.",
                    )
                yield line, (fields + [""] * expected)[:expected]
            line = first_line + rows.line_num
    except csv.Error as error:
        raise Location(layout.file, line).error(
            "A quotation mark is not closed, or followed by text.", "Close it or delete it."
        ) from error


def _decoded(content: bytes, layout: Layout, first_line: int) -> str:
    try:
        return content.decode(layout.encoding)
    except UnicodeDecodeError as error:
        raise Location(layout.file, first_line + content.count(b"\n", 0, error.start)).error(
            f"This contains characters that are not {layout.encoding.upper()} text.",
            'Save the file as UTF-8, or, if it is a table (csv), declare encoding = "latin-1".',
        ) from error


def _too_many(layout: Layout, line: int) -> InputError:
    decimal = "comma" if layout.decimal == "," else "point"
    return Location(layout.file, line).error(
        f"This line has more than {len(layout.names)} columns.",
        f"Correct it; numbers need a decimal {decimal}, a {layout.separator} only separates columns.",
    )


def _number(text: str, name: str, layout: Layout, line: int) -> float:
    """The number of a field; NaN where it is empty."""
    plain = text.replace(".", "?").replace(",", ".") if layout.decimal == "," else text
    try:
        # Python takes 1_000 and "nan" for numbers, too.
        if not text or ("_" not in plain and plain.isascii() and not math.isnan(float(plain))):
            return float(plain or "nan")
    except ValueError:
        pass
    remedy = "Correct the field or delete the line."
    if _DECIMAL_COMMA.match(text):
        remedy = 'Declare decimal = "," for this input, or write numbers with a decimal point.'
    elif text.lower().lstrip("+-") in {"nan", "na", "null", "none"}:
        remedy = (
            "Leave the field empty if the value is not known and may be missing; otherwise delete the line."
        )
    elif name == "time" and ":" in text:
        remedy = (
            "Write seconds, such as 422922.000. Events may have dates with a time, such as "
            '2020-12-24T21:28:42.000: declare time = "gps-date" or "utc-date".'
        )
    raise InputError(f"{quoted(text)} in the column '{name}' is not a number.", remedy, layout.file, line)
