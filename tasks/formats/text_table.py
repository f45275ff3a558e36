"""Tables in text files: fast to read, and an error that names the line of the first bad row.

The whole file goes through the compiled parser of pandas with numbers read as numbers. Only when that
fails is it read a second time as text, to find the row to blame. Carriage returns are replaced by blanks
(or line feeds) before, so that the lines counted here are the lines an editor shows.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from tasks.errors import InputError
from tasks.formats.table_faults import TOO_MANY, malformed, not_a_number, not_text
from tasks.formats.table_layout import MARKS, Separator
from tasks.magnitude import HUGE
from tasks.plain_text import trouble_in
from tasks.storage.delivered_file import Kind, file_limits, read_delivered

_REMAINDER = "\x00more"
# Far beyond any row there is; a file of zeros, or of one line without end, is told from a table by it.
_LONGEST_LINE = 100_000
# Bytes that are looked at together.
_PIECE = 16_000_000


@dataclass(frozen=True, slots=True, eq=False)
class TextTable:
    """Columns of a text table with the line of every row.

    Attributes
    ----------
    file : where it was read from.
    line : (n,) 1-based line of each row.
    """

    file: Path
    line: NDArray[np.int64]
    _frame: pd.DataFrame

    def __len__(self) -> int:
        return len(self.line)

    def has(self, name: str) -> bool:
        """Whether the table has this column."""
        return name in self._frame.columns

    def text(self, name: str, *, may_be_empty: bool = False) -> pa.Array:
        """A column of names as text (n,), verbatim; empty fields are null.

        Raises
        ------
        InputError
            If a field is empty and may not be, or holds a name nobody can read (`tasks.plain_text`).
        """
        column = self._frame[name]
        empty = column.isna().to_numpy()
        if not may_be_empty and empty.any():
            raise self._error(int(np.argmax(empty)), f"The column '{name}' is empty here.", "Fill it in.")
        for text in column.dropna().unique():
            trouble = trouble_in(text)
            if trouble is not None:
                row = int(np.argmax((column == text).to_numpy()))
                raise self._error(row, trouble, f"Give a name of ordinary characters in '{name}'.")
        return self.remarks(name)

    def remarks(self, name: str) -> pa.Array:
        """A column of any text (n,), verbatim; empty fields are null."""
        return pa.array(self._frame[name], pa.string(), from_pandas=True)

    def numbers(self, names: Sequence[str], *, may_be_empty: bool = False) -> NDArray[np.float64]:
        """Columns as numbers (n, len(names)); NaN where a field is empty or the column does not exist.

        Raises
        ------
        InputError
            If a field is empty and may not be, or holds more than any quantity has.
        """
        values = np.full((len(self), len(names)), np.nan)
        for position, name in enumerate(names):
            if not self.has(name):
                continue
            column = self._frame[name].to_numpy(dtype=np.float64)
            bad = ~(np.abs(column) <= HUGE)
            if may_be_empty:
                bad &= ~np.isnan(column)
            if bad.any():
                row = int(np.argmax(bad))
                what = "empty" if np.isnan(column[row]) else f"{column[row]:g}"
                raise self._error(
                    row, f"The column '{name}' is {what} here.", "Give a number or delete the line."
                )
            values[:, position] = column
        return values

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
        return InputError(what, remedy, file=self.file, line=int(self.line[row]))


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


def lines_of(content: bytes, file: Path) -> bytes:
    """The content itself, if it has lines of a length, and a number of them, that can be taken apart.

    Parameters
    ----------
    content : of the whole file, lines ended by LF.

    Raises
    ------
    InputError
        If there are more lines than this installation reads, or one is longer than any row can be.
    """
    file_limits().require_rows(file, content.count(b"\n"))
    begin = 0
    while len(content) - begin > _LONGEST_LINE:
        # The last end of a line within reach: only one too long has none.
        end = content.rfind(b"\n", begin, begin + _LONGEST_LINE + 1)
        if end < 0:
            raise InputError(
                f"This line has more than {_LONGEST_LINE:,} characters.",
                "Deliver a table with a line for each row.",
                file=file,
                line=content.count(b"\n", 0, begin) + 1,
            )
        begin = end + 1
    return content


def read_table_text(
    content: bytes,
    file: Path,
    names: Sequence[str],
    numeric: Sequence[str],
    separator: Separator,
    first_line: int = 1,
    encoding: str = "utf-8",
    decimal: str = ".",
    quote: str = '"',
) -> TextTable:
    """Parse rows of text into columns.

    Parameters
    ----------
    content : the rows, without header lines; line ends as in `read_bytes`, CR already replaced.
    file : for messages.
    names : the columns in their order in the file.
    numeric : those that are numbers.
    separator : between columns; ``blank`` for any run of blanks and tabs.
    first_line : the line of the file in which `content` starts.
    encoding : of the text columns.
    decimal : mark of numbers.
    quote : mark around texts with separators.

    Raises
    ------
    InputError
        Naming the line: too many or too few columns, a field that is not a number, an open quotation mark,
        bytes that are not text in this encoding; or naming the file: no rows.
    """
    options = _options(names, separator, encoding, decimal, quote)
    kinds: dict[str, Any] = {name: np.float64 if name in numeric else object for name in (*names, _REMAINDER)}
    try:
        with warnings.catch_warnings():
            # Of fields beyond the one column more, which is refused below.
            warnings.simplefilter("ignore", pd.errors.ParserWarning)
            frame = pd.read_csv(io.BytesIO(content), dtype=kinds, **options)
    except UnicodeDecodeError as error:
        raise not_text(content, file, first_line, encoding) from error
    except pd.errors.ParserError as error:
        raise malformed(str(error), file, len(names), first_line, separator) from error
    except (ValueError, TypeError) as error:
        raise not_a_number(content, file, numeric, options, first_line) from error
    blank = frame.isna().all(axis=1).to_numpy()
    line = np.arange(len(frame), dtype=np.int64) + first_line
    if blank.any():
        frame, line = frame[~blank], line[~blank]
    if len(frame) == 0:
        raise InputError(
            "The file has no rows.", "Deliver it again, or take it out of the project file.", file=file
        )
    _refuse_remainder(frame, line, file, len(names), separator)
    if separator != "blank":
        _refuse_short_rows(content, file, len(names), first_line, MARKS[separator], quote)
    return TextTable(file, line, frame)


def _options(
    names: Sequence[str], separator: Separator, encoding: str, decimal: str, quote: str
) -> Mapping[str, Any]:
    # One column more than the file should have: surplus fields land there instead of getting lost.
    return {
        "sep": r"\s+" if separator == "blank" else MARKS[separator],
        "decimal": decimal,
        "quotechar": quote,
        "header": None,
        "names": [*names, _REMAINDER],
        "index_col": False,
        "skip_blank_lines": False,
        "skipinitialspace": True,
        "keep_default_na": False,
        "na_values": [""],
        "encoding": encoding,
    }


def _refuse_remainder(
    frame: pd.DataFrame, line: NDArray[np.int64], file: Path, expected: int, separator: Separator
) -> None:
    surplus = frame[_REMAINDER].notna().to_numpy()
    if surplus.any():
        raise InputError(
            f"This line has more than {expected} columns.",
            TOO_MANY.format(f"a {separator}"),
            file=file,
            line=int(line[np.argmax(surplus)]),
        )


def _refuse_short_rows(
    content: bytes, file: Path, expected: int, first_line: int, mark: str, quote: str
) -> None:
    """Refuse rows with fewer separators than columns: a file that was cut off inside a row ends with one.

    An empty field keeps its separator, so this is no question of what is given. With blanks between the
    columns every one of them has to be there.
    """
    begin, line = 0, first_line
    while begin < len(content):
        # Piece by piece, for a file may have gigabytes.
        end = content.find(b"\n", min(begin + _PIECE, len(content) - 1)) + 1 or len(content)
        piece = np.frombuffer(content, dtype=np.uint8, count=end - begin, offset=begin)
        ends = np.flatnonzero(piece == ord("\n"))
        ends = ends if len(ends) and ends[-1] == len(piece) - 1 else np.append(ends, len(piece))
        marks = np.diff(np.searchsorted(np.flatnonzero(piece == ord(mark)), ends), prepend=0)
        for row in np.flatnonzero(marks < expected - 1).tolist():
            text = piece[ends[row - 1] + 1 if row else 0 : ends[row]].tobytes()
            # A field in quotation marks may hold line ends.
            if text.strip() and quote.encode() not in text:
                found = int(marks[row]) + 1
                raise InputError(
                    f"This line has {found} column{'s' * (found > 1)}, and the header names {expected}.",
                    "The file may have been cut off: deliver it again. An empty field keeps its separator.",
                    file=file,
                    line=line + row,
                )
        begin, line = end, line + len(ends)
