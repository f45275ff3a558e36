"""Text tables: the line of headings, the meaning of their columns, the rows below.

Headings may have upper case and be written as others do (``sigma_x``, ``std x``); one that is nearly a column
that is read is an error. How a table of others is laid out is declared (`tasks.formats.table_layout`).
"""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

import pyarrow as pa

from tasks.errors import InputError, Location
from tasks.formats.foreign_headings import (
    OF_THE_FILE,
    declaration,
    mapped_names,
    refuse_other_separator,
)
from tasks.formats.table_layout import MARKS, TableLayout
from tasks.formats.text_lines import DeliveredLines
from tasks.formats.text_rows import Layout
from tasks.formats.text_table import TextTable, read_rows
from tasks.nearest_name import nearest
from tasks.plain_text import trouble_in

_MOST_COLUMNS = 1_000
_NOT_BLANK = re.compile(rb"\S")
# How others head a standard deviation: before or behind the quantity.
_WORDS = "(?:sigma|sig|stddev|stdev|std|sd)"
_SIGMA = re.compile(rf"{_WORDS}_?(?P<before>\w+)|(?P<behind>\w+)_{_WORDS}")
# What can hardly be anything else.
_SURELY_SIGMA = re.compile(rf"(?:sigma|stddev|stdev)\w*|{_WORDS}_\w+|\w+_{_WORDS}")
# The camera of an image of a rig is one of its heads.
_ALSO = {"head": "camera"}
# Names up to this length are like too many others.
_SHORT = 3


def read_table(
    path: Path, required: Sequence[str], optional: Sequence[str], numeric: Sequence[str], layout: TableLayout
) -> tuple[TextTable, Mapping[str, pa.Array]]:
    """The rows of a table, and its further columns as text (n,), without those declared to be unused.

    Parameters
    ----------
    required, optional : columns that are read.
    numeric : those of them that are numbers.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    text = DeliveredLines.of(path, lone_return=b"\n")
    first_line, names, rows = _columns(text, required, optional, layout)
    present = tuple(name for name in numeric if name in names)
    read = Layout(
        path, tuple(names), present, layout.separator, layout.encoding, layout.decimal, layout.quote
    )
    table = read_rows(text, rows, read, first_line)
    known = {*required, *optional}
    return table, {name: table.remarks(name) for name in _watched(names, layout) if name not in known}


def _columns(
    text: DeliveredLines, required: Sequence[str], optional: Sequence[str], layout: TableLayout
) -> tuple[int, list[str], Iterator[bytes]]:
    """Line of the first row, the names of the columns, and the rows without anything else."""
    line, fields, rows = _header(text, layout)
    first = next(rows, b"")
    known = [name for name in (*required, *optional) if name not in layout.columns]
    names = mapped_names(fields, layout, (*required, *optional), text.file, line)
    as_is = {*layout.columns, *layout.unused}
    names = [name if name in as_is else _recognised(name, known) for name in names]
    needed = [name for name in required if name not in layout.elsewhere]
    refuse_other_separator(fields, needed, layout, first, text.file, line)
    _check_columns(names, needed, optional, text.file, line, layout)
    _refuse_near_misses(_watched(names, layout), required, optional, text.file, line)
    return line + layout.header, names, chain([first] if first else [], rows)


def _watched(names: Sequence[str], layout: TableLayout) -> list[str]:
    """The columns that are not declared to be unused."""
    return [name for name in names if name.removesuffix(OF_THE_FILE) not in layout.unused]


def _header(text: DeliveredLines, layout: TableLayout) -> tuple[int, list[str], Iterator[bytes]]:
    """Line of the headings (or of the first row), the headings (or numbers), and the rows."""
    line, skip, content = 1, layout.skip_lines, b""
    pieces = text.pieces()
    for piece in pieces:
        begin = 0
        while skip and begin < len(piece):
            begin, skip, line = piece.find(b"\n", begin) + 1 or len(piece), skip - 1, line + 1
        content = _without_comments(piece[begin:], layout)
        if content and not content.isspace():
            break
        line += content.count(b"\n")
    found = _NOT_BLANK.search(content)
    begin = content.rfind(b"\n", 0, found.start()) + 1 if found is not None else 0
    line += content.count(b"\n", 0, begin)
    first, _, rest = content[begin:].partition(b"\n")
    others = (_without_comments(piece, layout) for piece in pieces)
    try:
        heading = first.decode(layout.encoding)
    except UnicodeDecodeError as error:
        raise Location(text.file, line).error(
            "The header is not UTF-8 text.", 'Save the file as UTF-8, or declare encoding = "latin-1".'
        ) from error
    fields = _fields(heading, layout)
    if not layout.header:
        return line, [str(number) for number in range(1, len(fields) + 1)], chain([content[begin:]], others)
    fields[0] = fields[0].lstrip("#% \t")
    while len(fields) > 1 and not fields[-1]:
        fields.pop()
    return line, fields, chain([rest] if rest else [], others)


def _without_comments(piece: bytes, layout: TableLayout) -> bytes:
    """The lines with comments emptied, so that line numbers stay those of the file."""
    if not layout.comment:
        return piece
    mark = re.escape(layout.comment.encode(layout.encoding, errors="replace"))
    return re.sub(rb"(?m)^[ \t]*" + mark + rb"[^\n]*", b"", piece)


def _fields(text: str, layout: TableLayout) -> list[str]:
    mark, text = MARKS[layout.separator], text.strip() if layout.separator == "blank" else text
    if layout.separator == "blank":
        text = re.sub(r"\s+", " ", text)
    found = next(csv.reader([text], delimiter=mark, quotechar=layout.quote, skipinitialspace=True), [""])
    return [field.strip() for field in found]


def _recognised(name: str, known: Sequence[str]) -> str:
    """The column a heading means: spelt in upper case, or a standard deviation as others write it."""
    plain = re.sub(r"[\s-]+", "_", name).lower()
    if name in known or plain in known:
        return name if name in known else plain
    if _ALSO.get(plain) in known:
        return _ALSO[plain]
    sigma = _SIGMA.fullmatch(plain)
    meant = f"s{sigma['before'] or sigma['behind']}" if sigma is not None else ""
    return meant if meant in known else name


def _refuse_near_misses(
    names: Sequence[str], required: Sequence[str], optional: Sequence[str], path: Path, line: int
) -> None:
    """Refuse a column whose name is nearly one this program reads, instead of ignoring it silently."""
    absent = [name for name in optional if name not in names]
    for name in names:
        if name in required or name in optional:
            continue
        plain = re.sub(r"[\s-]+", "_", name).lower()
        like = next((one for one in absent if plain.startswith(f"{one}_") or plain.endswith(f"_{one}")), None)
        found = difflib.get_close_matches(
            plain, [one for one in absent if len(one) > _SHORT], n=1, cutoff=0.8
        )
        if like is None and not found and not _SURELY_SIGMA.fullmatch(plain):
            continue
        meant = f"'{like or found[0]}'" if like or found else "a standard deviation"
        raise Location(path, line, name).error(
            f"The column '{name}' looks like {meant}, but it is not used.",
            f"Rename it, even if it is something else; columns of that kind are {', '.join(optional)}. Or "
            f'declare what it is: columns = {{ {like or (found or ["sx"])[0]} = "{name}" }}, or '
            f'unused = ["{name}"].',
        )


def _check_columns(
    names: Sequence[str],
    required: Sequence[str],
    optional: Sequence[str],
    path: Path,
    line: int,
    layout: TableLayout,
) -> None:
    missing = [name for name in required if name not in names]
    if missing:
        like = {
            name: nearest(name, [n for n in names if n not in (*required, *optional)]) for name in missing
        }
        hints = [f"'{found}' may mean '{name}'" for name, found in like.items() if found]
        what = f"The header lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}."
        remedy = f"Needed are {', '.join(required)}" + (f"; {', '.join(hints)}." if hints else ".")
        remedy += declaration(missing, names, layout)
        raise InputError(what, remedy, path, line)
    trouble = next((found for found in map(trouble_in, names) if found is not None), None)
    if trouble is not None or len(names) > _MOST_COLUMNS:
        what = trouble or f"The header has {len(names):,} columns, more than {_MOST_COLUMNS}."
        raise Location(path, line).error(what, "Deliver a table with the required columns.")
    double = next((name for name in names if list(names).count(name) > 1), None)
    if double is not None:
        raise Location(path, line).error(f"The header contains the column '{double}' twice.", "Delete one.")
