"""Rows of text split into fields: fast if they are correct, otherwise naming the wrong line and field.

Rows go through Arrow's compiled parser. What it does not take as it stands (blank lines, quotation marks
behind blanks, anything wrong) goes through that of pandas, which says where; only if that fails, too, are the
rows read as text, to find the field to blame. Both read numbers to the last digit.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from tasks.errors import InputError, Location
from tasks.formats.table_layout import MARKS, Separator
from tasks.formats.text_lines import line_feeds
from tasks.plain_text import quoted

if TYPE_CHECKING:
    import pandas as pd

_NAMES = pa.dictionary(pa.int32(), pa.string())
_REMAINDER = "\x00more"
_DECIMAL_COMMA = re.compile(r"^[+-]?\d+,\d+$")
# Of a line in the mean; no table has more columns.
_MOST_MARKS = 1_000
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
    return _plain_rows(content, layout) or _any_rows(content, layout, first_line)


def _plain_rows(content: bytes, layout: Layout) -> Rows | None:
    """Rows that Arrow takes as pandas would; None: they must be examined more closely."""
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
    # Rows without anything are passed over, which only the other parser's lines allow for.
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


def _any_rows(content: bytes, layout: Layout, first_line: int) -> Rows:
    """Rows as pandas takes them.

    Raises
    ------
    InputError
        As of :func:`rows_of`.
    """
    file = layout.file
    if layout.separator != "blank":
        # Rows without anything in them, as spreadsheets write them.
        mark = MARKS[layout.separator].encode()
        if content.count(mark) > _MOST_MARKS * (line_feeds(content) + 1):
            # No spreadsheet writes so many for a row without anything.
            _refuse_other_counts(content, layout, first_line)
        nothing = re.compile(rb"^[" + re.escape(mark) + rb" \t]+$", re.MULTILINE)
        content = nothing.sub(b"", content) if content.translate(None, mark + b" \t\n") else b"\n"
        _refuse_other_counts(content, layout, first_line)
    if content.isspace():
        return Rows((pa.nulls(0, _NAMES),) * len(layout.texts), np.empty((0, len(layout.numeric))))
    # Loaded for files that Arrow does not take as they are.
    import pandas as pd

    options = _options(layout)
    kinds: dict[str, Any] = {
        name: np.float64 if name in layout.numeric else object for name in (*layout.names, _REMAINDER)
    }
    try:
        with warnings.catch_warnings():
            # Of fields beyond the one column more, which is refused below.
            warnings.simplefilter("ignore", pd.errors.ParserWarning)
            frame = pd.read_csv(io.BytesIO(content), dtype=kinds, **options)
    except UnicodeDecodeError as error:
        raise _not_text(content, file, first_line, layout.encoding) from error
    except pd.errors.ParserError as error:
        raise _malformed(str(error), layout, first_line) from error
    except (ValueError, TypeError) as error:
        raise _not_a_number(content, file, layout.numeric, options, first_line) from error
    blank = frame.isna().all(axis=1).to_numpy()
    line = np.flatnonzero(~blank).astype(np.int32)
    frame = frame[~blank]
    _refuse_remainder(frame, line + first_line, layout)
    return Rows(
        tuple(
            pa.array(frame[name], pa.string(), from_pandas=True).dictionary_encode() for name in layout.texts
        ),
        frame[list(layout.numeric)].to_numpy(np.float64),
        line,
    )


def _options(layout: Layout) -> Mapping[str, Any]:
    # One column more than the file should have: surplus fields land there instead of getting lost.
    return {
        "sep": r"\s+" if layout.separator == "blank" else MARKS[layout.separator],
        "decimal": layout.decimal,
        "quotechar": layout.quote,
        "header": None,
        "names": [*layout.names, _REMAINDER],
        "index_col": False,
        "skip_blank_lines": False,
        "skipinitialspace": True,
        "keep_default_na": False,
        "na_values": [""],
        "encoding": layout.encoding,
    }


def _refuse_remainder(frame: pd.DataFrame, line: NDArray[np.int32], layout: Layout) -> None:
    surplus = frame[_REMAINDER].notna().to_numpy()
    if surplus.any():
        raise _too_many(layout, int(line[np.argmax(surplus)]))


def _too_many(layout: Layout, line: int | None) -> InputError:
    decimal = "comma" if layout.decimal == "," else "point"
    return Location(layout.file, line).error(
        f"This line has more than {len(layout.names)} columns.",
        f"Correct it; numbers need a decimal {decimal}, a {layout.separator} only separates columns.",
    )


def _refuse_other_counts(content: bytes, layout: Layout, first_line: int) -> None:
    """Refuse rows with fewer marks than columns, as a file ends with that was cut off inside a row, or more.

    An empty field keeps its mark, so this is no question of what is given; one at the end is not a column.
    """
    expected = len(layout.names)
    signs = np.frombuffer(content, dtype=np.uint8)
    ends = np.flatnonzero(signs == _LINE_FEED)
    ends = ends if len(ends) and ends[-1] == len(signs) - 1 else np.append(ends, len(signs))
    marks = np.diff(np.searchsorted(np.flatnonzero(signs == ord(MARKS[layout.separator])), ends), prepend=0)
    starts = np.append(0, ends[:-1] + 1)
    others = ((marks < expected - 1) & (ends > starts)) | (marks > expected)
    for row in np.flatnonzero(others).tolist():
        text = content[starts[row] : ends[row]]
        # A field in quotation marks may hold line ends.
        if not text.strip() or layout.quote.encode() in text:
            continue
        if marks[row] > expected:
            raise _too_many(layout, first_line + row)
        found = int(marks[row]) + 1
        raise Location(layout.file, first_line + row).error(
            f"This line has {found} column{'s' * (found > 1)}, but the header has {expected}.",
            "The file may have been cut off here: deliver it again. An empty field still needs its "
            f"{layout.separator}.",
        )


def _malformed(message: str, layout: Layout, first_line: int) -> InputError:
    quote = re.search(r"EOF inside string starting at row (\d+)", message)
    if quote:
        line = int(quote.group(1)) + first_line
        return Location(layout.file, line).error("A quotation mark is not closed.", "Close it or delete it.")
    found = re.search(r"in line (\d+)", message)
    return _too_many(layout, int(found.group(1)) - 1 + first_line if found else None)


def _not_text(content: bytes, file: Path, first_line: int, encoding: str) -> InputError:
    try:
        content.decode(encoding)
        line = None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + first_line
    return Location(file, line).error(
        f"This contains characters that are not {encoding.upper()} text.",
        'Save the file as UTF-8, or, if it is a table (csv), declare encoding = "latin-1".',
    )


def _not_a_number(
    content: bytes,
    file: Path,
    numeric: Sequence[str],
    options: Mapping[str, Any],
    first_line: int,
) -> InputError:
    """Read everything as text and name the first field that is not a number."""
    import pandas as pd

    with warnings.catch_warnings():
        # Of fields beyond the columns, which are refused where all numbers are some.
        warnings.simplefilter("ignore", pd.errors.ParserWarning)
        try:
            frame = pd.read_csv(io.BytesIO(content), dtype=object, **options)
        except UnicodeDecodeError:
            return _not_text(content, file, first_line, options["encoding"])
    bad = np.zeros((len(frame), len(numeric)), dtype=bool)
    for position, name in enumerate(numeric):
        given = frame[name].notna()
        # "nan" converts, but is not a number either.
        shown = frame[name]
        if options["decimal"] == ",":
            shown = shown.str.replace(".", "?").str.replace(",", ".")
        bad[:, position] = (given & pd.to_numeric(shown, errors="coerce").isna()).to_numpy()
    row = int(np.argmax(bad.any(axis=1)))
    name = list(numeric)[int(np.argmax(bad[row]))]
    value = str(frame[name].iloc[row])
    remedy = "Correct the field or delete the line."
    if _DECIMAL_COMMA.match(value):
        remedy = 'Declare decimal = "," for this input, or write numbers with a decimal point.'
    elif value.lower().lstrip("+-") in {"nan", "na", "null", "none"}:
        remedy = (
            "Leave the field empty if the value is not known and may be missing; otherwise delete the line."
        )
    what = f"{quoted(value)} in the column '{name}' is not a number."
    return InputError(what, remedy, file, row + first_line)
