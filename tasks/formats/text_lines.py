"""Delivered text in whole lines, so that a table of gigabytes is never in memory as a whole.

A table is read twice, as pieces of lines: once to see how many rows it has and whether it can be a table at
all, then to take the rows apart. The digest of the bytes is looked at in every reading
(`tasks.files.delivered_file`). Text files of other programs are read as lines, whatever their encoding and
line ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from tasks.errors import Location
from tasks.files.delivered_file import file_limits, pieces_of_delivered

# Far beyond any row there is; a file of zeros, or of one line without end, is told from a table by it.
_LONGEST_LINE = 100_000
# Bytes that are read, and taken apart, together.
_PIECE = 4_000_000
# A quotation mark that is open for so many pieces is never closed.
_MOST_OPEN = 2
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, slots=True)
class DeliveredLines:
    """A text file that can be a table.

    Attributes
    ----------
    file : where it is.
    lines : how many it has.
    size : its length, bytes.
    is_utf8 : whether it is text in UTF-8.
    lone_return : what a carriage return without line feed stands for in a file with line feeds.
    """

    file: Path
    lines: int
    size: int
    is_utf8: bool
    lone_return: bytes

    @classmethod
    def of(cls, file: Path, lone_return: bytes) -> DeliveredLines:
        """Look through a file.

        Raises
        ------
        InputError
            If it cannot be read (`tasks.files.delivered_file`), is empty or in UTF-16, has more lines than
            this installation reads, or one longer than any row can be.
        """
        lines, size, blank, is_utf8 = 1, 0, True, True
        for piece in _pieces(file, lone_return):
            if size == 0 and piece.startswith(_UTF_16):
                raise Location(file).error("The file is text in UTF-16.", "Save it as UTF-8.")
            _refuse_long_line(piece, file, lines)
            lines, size = lines + line_feeds(piece), size + len(piece)
            blank = blank and piece.isspace()
            is_utf8 = is_utf8 and _is_utf8(piece)
            file_limits().require_rows(file, lines - 1)
        if blank:
            raise Location(file).error(
                "The file is empty.", "Deliver it again, or remove it from the project file."
            )
        return cls(file, lines, size, is_utf8, lone_return)

    def pieces(self) -> Iterator[bytes]:
        """The content without byte-order mark, in pieces of whole lines; all but the last end in LF."""
        return _pieces(self.file, self.lone_return)


def line_feeds(piece: bytes) -> int:
    """How many there are; three times as fast as to find each of them."""
    return int(np.count_nonzero(np.frombuffer(piece, dtype=np.uint8) == ord("\n")))


def _pieces(file: Path, lone_return: bytes) -> Iterator[bytes]:
    rest, end, first = b"", b"", True
    for chunk in pieces_of_delivered(file, "table", _PIECE):
        rest += chunk
        if first:
            rest, first = rest.removeprefix(_BYTE_ORDER_MARK), False
        # The first piece says how the lines of the file end.
        end = end or (b"\n" if b"\n" in rest else b"\r" if b"\r" in rest else b"")
        cut = _end_of_rows(rest, end) if end else 0
        if cut:
            yield _with_line_feeds(rest[:cut], end, lone_return)
            rest = rest[cut:]
        elif len(rest) > max(_PIECE, _LONGEST_LINE) * (_MOST_OPEN if end and end in rest else 1):
            # A line, or a field in quotation marks, without end; whoever gets it says so.
            yield _with_line_feeds(rest, end, lone_return)
            rest = b""
    if rest:
        yield _with_line_feeds(rest, end, lone_return)


def _with_line_feeds(piece: bytes, end: bytes, lone_return: bytes) -> bytes:
    if b"\r" not in piece:
        return piece
    if end == b"\r":
        return piece.replace(b"\r", b"\n")
    if lone_return == b"\n":
        piece = piece.replace(b"\r\n", b"\n")
    return piece.replace(b"\r", lone_return)


def _is_utf8(piece: bytes) -> bool:
    if piece.isascii():
        return True
    try:
        piece.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _end_of_rows(content: bytes, end: bytes) -> int:
    """Behind the last end of a line that does not lie in quotation marks; 0: there is none."""
    cut = content.rfind(end) + 1
    # Found to be nowhere ten times as fast as counted.
    if b'"' not in content:
        return cut
    marks = content.count(b'"', 0, cut)
    while cut and marks % 2:
        before = content.rfind(end, 0, cut - 1) + 1
        marks -= content.count(b'"', before, cut)
        cut = before
    return cut


def _refuse_long_line(piece: bytes, file: Path, first_line: int) -> None:
    begin = 0
    while len(piece) - begin > _LONGEST_LINE:
        # The last end of a line within reach: only one too long has none.
        end = piece.rfind(b"\n", begin, begin + _LONGEST_LINE + 1)
        if end < 0:
            raise Location(file, piece.count(b"\n", 0, begin) + first_line).error(
                f"This line has more than {_LONGEST_LINE:,} characters.",
                "Deliver a table with a line for each row.",
            )
        begin = end + 1


def text_of(path: Path) -> str:
    """The text of a file with lines ended by LF: UTF-8, or Latin-1 where it is no UTF-8.

    Raises
    ------
    InputError
        If the file is missing, empty, or has lines of a length that no row has.
    """
    return "\n".join(line for some in pieces_of_lines(path) for line in some)


def numbered_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of every line, from 1; only a piece of the file is in memory.

    Raises
    ------
    InputError
        As `text_of`.
    """
    return enumerate(chain.from_iterable(pieces_of_lines(path)), start=1)


def pieces_of_lines(path: Path) -> Iterator[list[str]]:
    """The lines of a file, some thousands together; behind the last line feed stands one more, empty line.

    Raises
    ------
    InputError
        As `text_of`.
    """
    # Files mix CR LF with "CR blank LF"; alone, CR ends lines.
    text = DeliveredLines.of(path, lone_return=b"")
    encoding = "utf-8" if text.is_utf8 else "latin-1"
    rest = b""
    for piece in text.pieces():
        # Where a quotation mark stays open, a piece ends within a line.
        whole, feed, rest = (rest + piece).rpartition(b"\n")
        if feed:
            yield whole.decode(encoding).split("\n")
    yield [rest.decode(encoding)]
