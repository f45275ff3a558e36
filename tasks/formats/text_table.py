"""Tables in text files: columns of a whole file, and an error that names the line of a bad row.

The file is taken apart piece by piece (`tasks.formats.text_lines`, `tasks.formats.text_rows`). Names are kept
once, with a number for each row, so that a table takes less memory than its file.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from tasks.errors import InputError
from tasks.formats.text_rows import Layout, rows_of
from tasks.magnitude import HUGE
from tasks.plain_text import LONGEST_NAME, trouble_in
from tasks.storage.delivered_file import Kind, read_delivered

# Names that are looked at together.
_MANY = 100_000


@dataclass(frozen=True, slots=True, eq=False)
class TextTable:
    """Columns of a text table with the line of every row.

    Attributes
    ----------
    layout : file and columns.
    line : (n,) 1-based line of each row.
    """

    layout: Layout
    line: NDArray[np.int64]
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
        found = _first_trouble(column.dictionary)
        if found is not None:
            number, trouble = found
            row = pc.index(column.indices, number).as_py()
            raise self._error(row, trouble, f"Give a name of ordinary characters in '{name}'.")
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
        return InputError(what, remedy, file=self.layout.file, line=int(self.line[row]))


def _first_trouble(names: pa.Array) -> tuple[int, str] | None:
    """Number of the first name that nobody can read, and why; None: all are names."""
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
        If the file is missing, has no content, or is refused by `tasks.storage.delivered_file`.
    """
    content = read_delivered(path, kind).removeprefix(b"\xef\xbb\xbf")
    if not content or content.isspace():
        raise InputError(
            "The file is empty.", "Deliver it again, or take it out of the project file.", file=path
        )
    return content


def read_table_text(
    pieces: Iterable[bytes], layout: Layout, most_rows: int, first_line: int = 1
) -> TextTable:
    """Parse rows of text into columns.

    Parameters
    ----------
    pieces : the rows, without header lines, as `tasks.formats.text_lines` gives them.
    most_rows : rows there can be.
    first_line : the line of the file in which they start.

    Raises
    ------
    InputError
        As of `tasks.formats.text_rows.rows_of`; or naming the file: no rows.
    """
    values = np.empty((most_rows, len(layout.numeric)))
    line = np.empty(most_rows, dtype=np.int64)
    texts: list[list[pa.DictionaryArray]] = [[] for _ in layout.texts]
    count = 0
    for piece in pieces:
        rows = rows_of(piece, layout, first_line)
        end = count + len(rows.values)
        values[count:end] = rows.values
        line[count:end] = (np.arange(end - count) if rows.line is None else rows.line) + first_line
        for own, column in zip(texts, rows.texts, strict=True):
            own.append(column)
        count, first_line = end, first_line + piece.count(b"\n")
    if count == 0:
        raise InputError(
            "The file has no rows.", "Deliver it again, or take it out of the project file.", file=layout.file
        )
    columns = {}
    for name in layout.texts:
        columns[name] = joined_names(texts.pop(0))
    return TextTable(layout, line[:count], columns, values[:count])


def joined_names(parts: Sequence[pa.DictionaryArray]) -> pa.DictionaryArray:
    """Columns of names one after the other, each name kept once."""
    if len(parts) == 1:
        return parts[0]
    return pa.concat_arrays(pa.chunked_array(parts).unify_dictionaries().chunks)
