"""Lines of text files of other programs, whatever their encoding and line ends."""

from __future__ import annotations

from pathlib import Path

from tasks.formats.text_table import lines_of, read_bytes


def text_of(path: Path) -> str:
    """The text of a file with lines ended by LF: UTF-8, or Latin-1 where it is no UTF-8.

    Raises
    ------
    InputError
        If the file is missing, empty, or has lines of a length that no row has.
    """
    content = read_bytes(path)
    # Files mix CR LF with "CR blank LF"; alone, CR ends lines.
    content = lines_of(content.replace(b"\r", b"" if b"\n" in content else b"\n"), path)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def lines(path: Path) -> list[str]:
    """The lines of a file; line k of an editor is element k − 1.

    Raises
    ------
    InputError
        As `text_of`.
    """
    return text_of(path).split("\n")
