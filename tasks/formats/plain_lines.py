"""Text files of other programs as a whole, whatever their encoding and line ends."""

from __future__ import annotations

from pathlib import Path

from tasks.formats.text_lines import DeliveredLines


def text_of(path: Path) -> str:
    """The text of a file with lines ended by LF: UTF-8, or Latin-1 where it is no UTF-8.

    Raises
    ------
    InputError
        If the file is missing, empty, or has lines of a length that no row has.
    """
    # Files mix CR LF with "CR blank LF"; alone, CR ends lines.
    text = DeliveredLines.of(path, lone_return=b"")
    return b"".join(text.pieces()).decode("utf-8" if text.is_utf8 else "latin-1")


def lines(path: Path) -> list[str]:
    """The lines of a file; line k of an editor is element k − 1.

    Raises
    ------
    InputError
        As `text_of`.
    """
    return text_of(path).split("\n")
