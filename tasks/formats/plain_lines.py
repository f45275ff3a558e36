"""Text files of other programs, whatever their encoding and line ends."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from tasks.formats.text_lines import DeliveredLines


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
