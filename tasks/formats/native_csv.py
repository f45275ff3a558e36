"""Our own text inputs: UTF-8, a header line, comma, decimal point, columns in any order.

| file | columns |
|---|---|
| image points | image, point, x, y [, sx, sy] |
| exposures | image, camera, strip, x, y, z, omega, phi, kappa (or heading, pitch, roll) [, time, flight, sx, sy, sz, somega, sphi, skappa (or sheading, spitch, sroll), rate_roll, rate_pitch, rate_yaw] |
| control | point, x, y, z [, sx, sy, sz, role]; an empty coordinate is not known |
| distances | point, other_point, distance [, sigma, role] |

The three angles of an exposure may be left empty together: it has no attitude then; likewise its position.

Names are text and are kept verbatim. Headings may have upper case and be written as others do (``sigma_x``,
``std x``); one that is nearly one of these columns is an error. Further columns are kept as text and remarked on.
"""  # noqa: E501

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path

import pyarrow as pa

from tasks.errors import InputError
from tasks.formats.records import (
    AngleOrder,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    ImagePointRecords,
)
from tasks.formats.text_lines import DeliveredLines
from tasks.formats.text_rows import Layout
from tasks.formats.text_table import TextTable, read_table_text
from tasks.nearest_name import nearest
from tasks.plain_text import trouble_in

_XYZ = ("x", "y", "z")
_SIGMA_XYZ = ("sx", "sy", "sz")
_RATES = ("rate_roll", "rate_pitch", "rate_yaw")
_MOST_COLUMNS = 1_000
_NOT_BLANK = re.compile(rb"\S")
# How others head a standard deviation: before or behind the quantity.
_WORDS = "(?:sigma|sig|stddev|stdev|std|sd)"
_SIGMA = re.compile(rf"{_WORDS}_?(?P<before>\w+)|(?P<behind>\w+)_{_WORDS}")
# What can hardly be anything else.
_SURELY_SIGMA = re.compile(rf"(?:sigma|stddev|stdev)\w*|{_WORDS}_\w+|\w+_{_WORDS}")
# Names up to this length are like too many others.
_SHORT = 3


def read_csv_image_points(path: Path) -> ImagePointRecords:
    """Read image points.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    table, extra = _read(path, ("image", "point", "x", "y"), ("sx", "sy"), ("x", "y", "sx", "sy"))
    return ImagePointRecords(
        file=path,
        image=table.names("image"),
        point=table.names("point"),
        xy=table.numbers(("x", "y")),
        sigma=table.numbers(("sx", "sy"), may_be_empty=True),
        line=table.line,
        extra=extra,
    )


def read_csv_exposures(path: Path, order: AngleOrder) -> ExposureRecords:
    """Read exposures whose angles are ω, φ, κ or heading, pitch, roll.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns; some of angles or coordinates.
    """
    angles = ("heading", "pitch", "roll") if order == "heading-pitch-roll" else ("omega", "phi", "kappa")
    sigmas = tuple(f"s{name}" for name in angles)
    required = ("image", "camera", "strip", *_XYZ, *angles)
    optional = ("time", "flight", *_SIGMA_XYZ, *sigmas, *_RATES)
    table, extra = _read(path, required, optional, (*_XYZ, *angles, "time", *_SIGMA_XYZ, *sigmas, *_RATES))
    return ExposureRecords(
        file=path,
        image=table.text("image"),
        camera=table.text("camera"),
        strip=table.text("strip", may_be_empty=True),
        flight=_optional_text(table, "flight"),
        time_s=table.numbers(("time",), may_be_empty=True)[:, 0],
        position=table.all_or_none(_XYZ),
        angles=table.all_or_none(angles),
        sigma_position=table.numbers(_SIGMA_XYZ, may_be_empty=True),
        sigma_angles=table.numbers(sigmas, may_be_empty=True),
        line=table.line,
        rates=table.all_or_none(_RATES),
        extra=extra,
    )


def read_csv_control(path: Path) -> ControlRecords:
    """Read control and check points.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    table, extra = _read(path, ("point", *_XYZ), (*_SIGMA_XYZ, "role"), (*_XYZ, *_SIGMA_XYZ))
    return ControlRecords(
        file=path,
        point=table.text("point"),
        position=table.numbers(_XYZ, may_be_empty=True),
        sigma=table.numbers(_SIGMA_XYZ, may_be_empty=True),
        role=_optional_text(table, "role"),
        line=table.line,
        extra=extra,
    )


def read_csv_distances(path: Path) -> DistanceRecords:
    """Read distances between object points.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    numeric = ("distance", "sigma")
    table, extra = _read(path, ("point", "other_point", "distance"), ("sigma", "role"), numeric)
    return DistanceRecords(
        file=path,
        point=table.text("point"),
        other_point=table.text("other_point"),
        distance=table.numbers(("distance",))[:, 0],
        sigma=table.numbers(("sigma",), may_be_empty=True)[:, 0],
        role=_optional_text(table, "role"),
        line=table.line,
        extra=extra,
    )


def _optional_text(table: TextTable, name: str) -> pa.Array:
    return table.text(name, may_be_empty=True) if table.has(name) else pa.nulls(len(table), pa.string())


def _read(
    path: Path, required: Sequence[str], optional: Sequence[str], numeric: Sequence[str]
) -> tuple[TextTable, Mapping[str, pa.Array]]:
    text = DeliveredLines.of(path, lone_return=b"\n")
    header_line, delivered, rows = _header(text)
    names = [_recognised(name, (*required, *optional)) for name in delivered]
    _check_columns(names, required, optional, path, header_line)
    _refuse_near_misses(names, required, optional, path, header_line)
    present = [name for name in numeric if name in names]
    layout = Layout(path, tuple(names), tuple(present), "comma")
    table = read_table_text(rows, layout, text.lines - header_line, first_line=header_line + 1)
    known = {*required, *optional}
    extra = {name: table.remarks(name) for name in names if name not in known}
    return table, extra


def _header(text: DeliveredLines) -> tuple[int, list[str], Iterator[bytes]]:
    """Line of the header, its names, and the rows below it."""
    line, pieces, content = 1, text.pieces(), b""
    for content in pieces:
        if not content.isspace():
            break
        line += content.count(b"\n")
    found = _NOT_BLANK.search(content)
    begin = content.rfind(b"\n", 0, found.start()) + 1 if found is not None else 0
    line += content.count(b"\n", 0, begin)
    first, _, rest = content[begin:].partition(b"\n")
    try:
        fields = next(csv.reader([first.decode("utf-8")], skipinitialspace=True))
    except UnicodeDecodeError as error:
        raise InputError(
            "The header is not UTF-8 text.", "Save the file as UTF-8.", file=text.file, line=line
        ) from error
    return line, [field.strip() for field in fields], chain([rest] if rest else [], pieces)


def _recognised(name: str, known: Sequence[str]) -> str:
    """The column a heading means: spelt in upper case, or a standard deviation as others write it."""
    plain = re.sub(r"[\s-]+", "_", name).lower()
    if name in known or plain in known:
        return name if name in known else plain
    sigma = _SIGMA.fullmatch(plain)
    meant = f"s{sigma['before'] or sigma['behind']}" if sigma is not None else ""
    return meant if meant in known else name


def _refuse_near_misses(
    names: Sequence[str], required: Sequence[str], optional: Sequence[str], path: Path, line: int
) -> None:
    """A column that is nearly one this program reads must not be passed over in silence."""
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
        raise InputError(
            f"The column '{name}' looks like {meant}, and nothing reads it.",
            f"Rename it, also if it is something else; columns of that kind are {', '.join(optional)}.",
            file=path,
            line=line,
            entity=name,
        )


def _check_columns(
    names: Sequence[str], required: Sequence[str], optional: Sequence[str], path: Path, line: int
) -> None:
    missing = [name for name in required if name not in names]
    if missing and len(names) == 1 and any(mark in names[0] for mark in ";\t|"):
        mark = next(mark for mark in ";\t|" if mark in names[0])
        shown = {";": "a semicolon", "\t": "a tab", "|": "a bar"}[mark]
        raise InputError(
            f"The columns are separated by {shown}.",
            "Separate them by commas, with decimal points.",
            file=path,
            line=line,
        )
    if missing:
        like = {
            name: nearest(name, [n for n in names if n not in (*required, *optional)]) for name in missing
        }
        hints = [f"'{found}' may be meant for '{name}'" for name, found in like.items() if found]
        what = f"The header lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}."
        remedy = f"Needed are {', '.join(required)}" + (f"; {', '.join(hints)}." if hints else ".")
        raise InputError(what, remedy, file=path, line=line)
    trouble = next((found for found in map(trouble_in, names) if found is not None), None)
    if trouble is not None or len(names) > _MOST_COLUMNS:
        what = trouble or f"The header names {len(names):,} columns, more than {_MOST_COLUMNS}."
        raise InputError(what, "Deliver a table with the columns that are needed.", file=path, line=line)
    double = next((name for name in names if list(names).count(name) > 1), None)
    if double is not None:
        raise InputError(
            f"The header names the column '{double}' twice.", "Delete one.", file=path, line=line
        )
