"""Where keys are in TOML text, and how deep it is nested, in a time proportional to the text.

``tomllib`` gives values without places, and the time it takes grows with the square of the dots in a key.
Here the text is divided into tokens, each of which is read once whatever comes behind it; a text that is not
TOML is divided as well.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

# No key of ours has as many parts; of more the rest says nothing.
_MOST_PARTS = 64
# Nothing gives back what it has taken (possessive quantifiers); what is not closed reaches to the end.
_TOKEN = re.compile(
    r"""
      (?P<newline> \n )
    | (?P<nothing> [^\S\n]++ | \#[^\n]*+ )
    | (?P<quoted>  \"{3}(?: [^"\\]++ | \\. | "{1,2}+(?!") )*+ (?: "{3,5}+ | . | \Z )
                 | '{3}(?: [^']++ | '{1,2}+(?!') )*+ (?: '{3,5}+ | \Z )
                 | "(?: [^"\\\n]++ | \\[^\n] )*+ "?+
                 | '[^'\n]*+ '?+ )
    | (?P<bare>    [A-Za-z0-9_-]++ )
    | (?P<sign>    . )
    """,
    re.VERBOSE | re.DOTALL,
)


def line_of_key(text: str, keys: Sequence[str | int]) -> int | None:
    """The 1-based line of a key, or of the nearest table around it; None if nothing of it is written.

    For what stands inside an array or table in brackets it is the line of the key that opens it.
    """
    wanted = [str(key) for key in keys]
    best, best_length = None, 0
    for line, path in _written_keys(text):
        length = _common_length(path, wanted)
        whole = length == len(path)
        if whole and length > best_length:
            best, best_length = line, length
    return best


def line_nested_deeper(text: str, most: int) -> int | None:
    """The 1-based line of the first key of more than `most` parts, or more open brackets; None: none."""
    line, parts, dotted, brackets = 1, 0, False, 0
    for kind, token in _tokens(text):
        if kind in ("bare", "quoted"):
            parts, dotted = (parts + 1 if dotted else 1), False
        elif kind == "sign":
            dotted = token == "."
            brackets = max(0, brackets + (token in "[{") - (token in "]}"))
        elif kind == "newline":
            dotted = False
        if max(parts, brackets) > most:
            return line
        line += token.count("\n")
    return None


def _common_length(first: Sequence[str], second: Sequence[str]) -> int:
    length = 0
    for one, other in zip(first, second, strict=False):
        if one != other:
            break
        length += 1
    return length


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    """Kind and text of every token; together they are the whole text."""
    return ((str(found.lastgroup), found.group()) for found in _TOKEN.finditer(text))


def _written_keys(text: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Line and full path of every table header and key; items of arrays of tables carry their number."""
    table: tuple[str, ...] = ()
    numbers: dict[tuple[str, ...], int] = {}
    for line, opening, parts in _statements(text):
        if opening == 0:
            yield line, (*table, *parts)
            continue
        table = _numbered(parts, numbers)
        if opening > 1:
            numbers[table] = numbers.get(table, -1) + 1
            table = (*table, str(numbers[table]))
        yield line, table


def _statements(text: str) -> Iterator[tuple[int, int, tuple[str, ...]]]:
    """Line, number of opening brackets (none: a key with its value) and key of each statement, in parts."""
    line, begin, opening, depth, in_value = 1, 1, 0, 0, False
    parts: list[str] = []
    for kind, token in (*_tokens(text), ("newline", "\n")):
        if kind == "newline" and depth == 0:
            if parts:
                yield begin, opening, tuple(parts)
            begin, opening, in_value, parts = line + 1, 0, False, []
        elif kind == "sign" and in_value:
            depth = max(0, depth + (token in "[{") - (token in "]}"))
        elif kind == "sign":
            in_value = token == "="
            opening += token == "["
        elif kind in ("bare", "quoted") and not in_value and len(parts) < _MOST_PARTS:
            parts.append(token if kind == "bare" else token[1:-1])
        line += token.count("\n")


def _numbered(path: tuple[str, ...], numbers: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Insert the number of the present item where a part of the path is an array of tables."""
    numbered: tuple[str, ...] = ()
    for depth, part in enumerate(path):
        numbered = (*numbered, part)
        if numbered in numbers and depth < len(path) - 1:
            numbered = (*numbered, str(numbers[numbered]))
    return numbered
