"""Find the line of a key in TOML text, so that an error can point at it.

``tomllib`` gives values without places. This scan knows table headers, arrays of tables, dotted and
quoted keys; it does not look into multi-line values, where the line of the key that opens them is as good.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

_HEADER = re.compile(r"^\s*(\[\[?)\s*(.+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(
    r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*="""
)
_PART = re.compile(r"""[A-Za-z0-9_-]+|"[^"]*"|'[^']*'""")


def line_of_key(text: str, keys: Sequence[str | int]) -> int | None:
    """The 1-based line of a key, or of the nearest table around it; None if nothing of it is written."""
    wanted = [str(key) for key in keys]
    best, best_length = None, 0
    for line, path in _written_keys(text):
        length = _common_length(path, wanted)
        whole = length == len(path)
        if whole and length > best_length:
            best, best_length = line, length
    return best


def _common_length(first: Sequence[str], second: Sequence[str]) -> int:
    length = 0
    for one, other in zip(first, second, strict=False):
        if one != other:
            break
        length += 1
    return length


def _written_keys(text: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Line and full path of every table header and key; items of arrays of tables carry their number."""
    table: tuple[str, ...] = ()
    numbers: dict[tuple[str, ...], int] = {}
    for line, content in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(content)
        key = _KEY.match(content)
        if header and not key:
            path = _numbered(_parts(header.group(2)), numbers)
            if header.group(1) == "[[":
                numbers[path] = numbers.get(path, -1) + 1
                path = (*path, str(numbers[path]))
            table = path
            yield line, table
        elif key:
            yield line, (*table, *_parts(key.group(1)))


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip("\"'") for part in _PART.findall(dotted))


def _numbered(path: tuple[str, ...], numbers: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Insert the number of the present item where a part of the path is an array of tables."""
    numbered: tuple[str, ...] = ()
    for depth, part in enumerate(path):
        numbered = (*numbered, part)
        if numbered in numbers and depth < len(path) - 1:
            numbered = (*numbered, str(numbers[numbered]))
    return numbered
