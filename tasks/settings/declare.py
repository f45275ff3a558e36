"""Values that a project file leaves open: texts that begin with ``DECLARE`` and stop every computation.

``aerocal init`` writes them where the files do not say what their numbers mean. They are not guessed, and a
project that still has some is refused with the list of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from tasks.errors import Location
from tasks.settings.key_lines import line_of_key

#: How an open value begins.
DECLARE = "DECLARE"
_MOST_LISTED = 25


def open_value(what: str) -> str:
    """The placeholder of a value until it is declared; `what` says which values it may have."""
    return f"{DECLARE}: {what}"


def refuse_open_values(content: Mapping[str, object], text: str, path: Path) -> None:
    """Raise if values are still open.

    Parameters
    ----------
    content : the tables of the file, with what replaces values of it on the command line.
    text : the file as written, for the lines.

    Raises
    ------
    InputError
        Naming each of them, with its line and what is asked.
    """
    found = list(_open(content, ()))
    if not found:
        return
    lines = [(keys, line_of_key(text, keys)) for keys in found]
    named = ", ".join(
        f"{'.'.join(map(str, keys))}{f' (line {line})' if line else ''}"
        for keys, line in lines[:_MOST_LISTED]
    )
    more = f" and {len(found) - _MOST_LISTED} more" if len(found) > _MOST_LISTED else ""
    what = "1 value is" if len(found) == 1 else f"{len(found)} values are"
    raise Location(path, lines[0][1]).error(
        f"{what} still to be declared; aerocal never guesses them: {named}{more}.",
        f"Replace each text that begins with {DECLARE}; it states what is required.",
    )


def _open(value: object, keys: tuple[str | int, ...]) -> Iterator[tuple[str | int, ...]]:
    """Keys of all open values below a value; no number where a single table was written."""
    if isinstance(value, str):
        if value.startswith(DECLARE):
            yield keys
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _open(inner, (*keys, str(key)))
    elif isinstance(value, Sequence):
        for number, inner in enumerate(value):
            yield from _open(inner, (*keys, number))
