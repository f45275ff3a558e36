"""Tables in text files: columns of a whole file, and an error that names the line of a bad row.

The file is taken apart piece by piece (`tasks.formats.text_lines`, `tasks.formats.text_rows`). Names are kept
once, with a number for each row, so that a table takes less memory than its file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from tasks.errors import InputError, Location
from tasks.files.delivered_file import Kind, changed, read_delivered
from tasks.files.in_turn import in_turn
from tasks.formats.joined_names import joined_names, room_of_names
from tasks.formats.records import Lines
from tasks.formats.table_layout import MARKS
from tasks.formats.text_lines import DeliveredLines, line_feeds
from tasks.formats.text_rows import Layout, Rows, rows_of
from tasks.magnitude import HUGE
from tasks.plain_text import LONGEST_NAME, quoted, trouble_in

# What is looked at of the end of a file, bytes, and the lines that say how long its numbers are.
_TAIL, _FEWEST_BEFORE = 20_000, 50


def refuse_short_last_number(before: bytes, content: bytes, layout: Layout, first_line: int) -> None:
    """Refuse a file that ends inside its last number.

    Its last line has no end, and at least two decimals fewer than each of the lines before it.

    Parameters
    ----------
    before : the rows before, as far as they are known.
    content, first_line : as of `rows_of`.
    """
    if content.endswith(b"\n") or layout.names[-1] not in layout.numeric:
        return
    # The first one may have been cut here.
    lines = (before[-_TAIL:] + content[-_TAIL:]).splitlines()[1:]
    if len(lines) < _FEWEST_BEFORE:
        return
    *others, last = lines
    fewest = min(_decimals(line, layout) for line in others)
    if _decimals(last, layout) <= fewest - 2:
        text = last.rsplit(MARKS[layout.separator].encode(), 1)[-1].decode(layout.encoding, "replace")
        raise Location(layout.file, first_line + content.count(b"\n")).error(
            f"The file ends with {quoted(text)} and no line end; the lines before have {fewest} decimals or "
            "more.",
            "The file may have been cut off here: deliver it again, or end its last line.",
        )


def _decimals(line: bytes, layout: Layout) -> int:
    """Digits behind the decimal mark of the last field."""
    field = line.rsplit(MARKS[layout.separator].encode(), 1)[-1]
    return len(field.strip().partition(layout.decimal.encode())[2])


# Names that are looked at together.
_MANY = 100_000
# Bytes that a number takes, and a name or line.
_NUMBER, _CODE = 8, 4
# Pieces of a file that are taken apart at the same time, while the next one is read.
_THREADS = 2
# In 32 bits, with those of the last piece.
_MOST_LINES = 2**31 - 2**27
# The columns of a table may take twice the size of its file, and so many bytes.
_BESIDES = 150_000_000


class _Numbered(NamedTuple):
    """Rows of a file, what stands before them, and the line in which they start."""

    content: bytes
    before: bytes
    first_line: int


@dataclass(frozen=True, slots=True, eq=False)
class TextTable:
    """Columns of a text table with the line of every row.

    Attributes
    ----------
    layout : file and columns.
    line : (n,) 1-based line of each row.
    """

    layout: Layout
    line: Lines
    _texts: dict[str, pa.DictionaryArray]
    _values: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.line)

    def has(self, name: str) -> bool:
        """Whether the table has this column."""
        return name in self.layout.names

    def text(self, name: str, *, may_be_empty: bool = False) -> pa.Array:
        """A column of names as text (n,), verbatim; empty fields are null.

        Raises
        ------
        InputError
            If a field is empty and may not be, or holds a name nobody can read (`tasks.plain_text`).
        """
        return self.names(name, may_be_empty=may_be_empty).cast(pa.string())

    def names(self, name: str, *, may_be_empty: bool = False) -> pa.DictionaryArray:
        """As :meth:`text`, with each name kept once."""
        column = self._texts[name]
        if not may_be_empty and column.null_count:
            row = int(np.argmax(column.is_null().to_numpy(zero_copy_only=False)))
            raise self._error(row, f"The column '{name}' is empty here.", "Fill it in.")
        found = first_trouble(column.dictionary)
        if found is not None:
            number, trouble = found
            import pyarrow.compute as pc

            row = pc.index(column.indices, number).as_py()
            raise self._error(row, trouble, f"Give a name of ordinary characters, 255 at most, in '{name}'.")
        return column

    def remarks(self, name: str) -> pa.Array:
        """A column of any text (n,), verbatim; empty fields are null."""
        return self._texts[name].cast(pa.string())

    def numbers(self, names: Sequence[str], *, may_be_empty: bool = False) -> NDArray[np.float64]:
        """Columns as numbers (n, len(names)); NaN where a field is empty or the column does not exist.

        The array is not to be written into: columns of the table are not copied where they stand together.

        Raises
        ------
        InputError
            If a field is empty and may not be, or holds more than any quantity has.
        """
        numeric = self.layout.numeric
        for name in names:
            if name in numeric:
                self._refuse_impossible(name, self._values[:, numeric.index(name)], may_be_empty)
        present = [numeric.index(name) for name in names if name in numeric]
        if not present:
            return np.broadcast_to(np.nan, (len(self), len(names)))
        if present == list(range(present[0], present[0] + len(names))):
            return self._values[:, present[0] : present[0] + len(names)]
        values = np.full((len(self), len(names)), np.nan)
        for position, name in enumerate(names):
            if name in numeric:
                values[:, position] = self._values[:, numeric.index(name)]
        return values

    def _refuse_impossible(self, name: str, column: NDArray[np.float64], may_be_empty: bool) -> None:
        low, high = (np.fmin, np.fmax) if may_be_empty else (np.minimum, np.maximum)
        # NaN if there is one that counts.
        if low.reduce(column) >= -HUGE and high.reduce(column) <= HUGE:
            return
        bad = ~(np.abs(column) <= HUGE)
        if may_be_empty:
            bad &= ~np.isnan(column)
        if bad.any():
            row = int(np.argmax(bad))
            what = "empty" if np.isnan(column[row]) else f"{column[row]:g}"
            raise self._error(
                row, f"The column '{name}' is {what} here.", "Give a number or delete the line."
            )

    def all_or_none(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Columns as numbers (n, len(names)) that may be empty, but only together in a row.

        Raises
        ------
        InputError
            If some of them are empty in a row and some are not, or one is infinite.
        """
        values = self.numbers(names, may_be_empty=True)
        empty = np.isnan(values)
        partly = empty.any(axis=1) & ~empty.all(axis=1)
        if partly.any():
            row = int(np.argmax(partly))
            name = names[int(np.argmax(empty[row]))]
            raise self._error(
                row,
                f"The column '{name}' is empty here, but not {' and '.join(n for n in names if n != name)}.",
                "Give all of them or none.",
            )
        return values

    def _error(self, row: int, what: str, remedy: str) -> InputError:
        return InputError(what, remedy, self.layout.file, int(self.line[row]))


def first_trouble(names: pa.Array) -> tuple[int, str] | None:
    """Number of the first unreadable one of distinct names, and why; None: all are readable."""
    import pyarrow.compute as pc

    for begin in range(0, len(names), _MANY):
        some = names.slice(begin, _MANY)
        # Nearly all are ordinary, which is known for all of them at once.
        ordinary = pc.and_(pc.ascii_is_printable(some), pc.less_equal(pc.binary_length(some), LONGEST_NAME))
        for number in np.flatnonzero(~ordinary.to_numpy(zero_copy_only=False)).tolist():
            trouble = trouble_in(some[number].as_py())
            if trouble is not None:
                return begin + number, trouble
    return None


def read_bytes(path: Path, kind: Kind = "table") -> bytes:
    """The bytes of a text file without its byte-order mark.

    Raises
    ------
    InputError
        If the file is missing, has no content, or is refused by `tasks.files.delivered_file`.
    """
    content = read_delivered(path, kind).removeprefix(b"\xef\xbb\xbf")
    if not content or content.isspace():
        raise Location(path).error(
            "The file is empty.", "Deliver it again, or remove it from the project file."
        )
    return content


def read_rows(
    text: DeliveredLines, pieces: Iterable[bytes], layout: Layout, first_line: int = 1
) -> TextTable:
    """As :func:`read_table_text`, of the rows of a file.

    Raises
    ------
    InputError
        As of :func:`read_table_text`; if the rows are so many and short, or so many names are new, that the
        columns would take far more memory than the file.
    """
    rows = text.lines - first_line + 1
    return read_table_text(pieces, layout, rows, first_line, 2 * text.size + _BESIDES)


def read_table_text(
    pieces: Iterable[bytes],
    layout: Layout,
    most_rows: int,
    first_line: int = 1,
    most_bytes: float = math.inf,
) -> TextTable:
    """Parse rows of text into columns.

    Parameters
    ----------
    pieces : the rows, without header lines, as `tasks.formats.text_lines` gives them.
    most_rows : rows there can be.
    first_line : the line of the file in which they start.
    most_bytes : memory that the columns may take.

    Raises
    ------
    InputError
        As of `tasks.formats.text_rows.rows_of`; the last number is cut off; or naming the file: no rows,
        columns larger than that.
    """
    size = most_rows * (_NUMBER * len(layout.numeric) + _CODE * len(layout.texts) + _CODE)
    _refuse_larger(size, most_bytes, most_rows, layout.file)
    # What is not written into takes no memory.
    values = np.empty((most_rows, len(layout.numeric)))
    texts: list[list[pa.DictionaryArray]] = [[] for _ in layout.texts]
    lines: list[tuple[int, NDArray[np.int32] | range]] = []
    count = 0
    for line, rows in in_turn(partial(_taken_apart, layout), _numbered(pieces, first_line), _THREADS):
        end = count + len(rows.values)
        if end > most_rows:
            # More than there were when they were counted.
            raise changed(layout.file)
        values[count:end] = rows.values
        lines.append((line, range(end - count) if rows.line is None else rows.line))
        for own, column in zip(texts, rows.texts, strict=True):
            own.append(column)
            size += room_of_names(column.dictionary)
        _refuse_larger(size, most_bytes, most_rows, layout.file)
        count = end
    if count == 0:
        raise Location(layout.file).error(
            "The file has no rows.", "Deliver it again, or remove it from the project file."
        )
    # Column by column, so that no two are in memory twice.
    columns = {name: joined_names(texts.pop(0)) for name in layout.texts}
    return TextTable(layout, _joined_lines(lines, count), columns, values[:count])


def _numbered(pieces: Iterable[bytes], first_line: int) -> Iterator[_Numbered]:
    before = b""
    for piece in pieces:
        yield _Numbered(piece, before[-_TAIL:], first_line)
        before, first_line = piece, first_line + line_feeds(piece)


def _taken_apart(layout: Layout, piece: _Numbered) -> tuple[int, Rows]:
    """Line in which a piece starts, and its rows."""
    refuse_short_last_number(piece.before, piece.content, layout, piece.first_line)
    return piece.first_line, rows_of(piece.content, layout, piece.first_line)


def _refuse_larger(size: float, most_bytes: float, rows: int, file: Path) -> None:
    if size > most_bytes:
        raise Location(file).error(
            f"The file has {rows:,} rows that are so short, or have so many different names, that their "
            "columns would take more than twice its size in memory.",
            "Deliver the right file, or divide it.",
        )


def _joined_lines(parts: Sequence[tuple[int, NDArray[np.int32] | range]], count: int) -> Lines:
    """Line (count,) of each row, from the first line of each part and those of its rows, counted from it."""
    joined: Lines = np.empty(count, np.int32 if parts[-1][0] < _MOST_LINES else np.int64)
    end = 0
    for first, part in parts:
        begin, end = end, end + len(part)
        joined[begin:end] = np.arange(len(part), dtype=np.int32) if isinstance(part, range) else part
        joined[begin:end] += first
    return joined
