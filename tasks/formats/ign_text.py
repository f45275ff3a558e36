"""IGN's text files of aerial triangulation: ``.mes``, ``.OPK`` and ``.APP``.

| file | row | unit and frame |
|---|---|---|
| ``.mes`` | point image column row | pixels, origin at the top left corner, row downwards |
| ``.OPK`` | image X Y Z ω φ κ [camera] | as declared; R_x(ω) R_y(φ) R_z(κ), grid axes |
| ``.APP`` | point code x y z | CRS and heights as declared |

Columns are separated by any number of blanks; names may be in quotation marks; lines may end in blank,
CR, blank, LF, and the last one in nothing. An OPK file may open with lines ``KEY : value`` and a line of
column names (``NOM`` or ``ID``, X, Y, Z, O, P, K, CAMERA). Image names like ``21FD244720x00015_00614`` hold
flight (before the x), strip (``x00015``) and number.

Code of a control point: 13 and 3 occur, and no description of them was available. In the one delivery with
both, points of code 13 fit given orientations to 0.1 to 0.5 px and the one of code 3 to 1.1 to 1.4 px along
the columns, which fits "3 = height only" but does not prove it. Every row therefore counts as known in x, y
and z, and a remark names the points of another code than 13.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa

from tasks.errors import Location
from tasks.formats.records import AngleOrder, ControlRecords, ExposureRecords, ImagePointRecords
from tasks.formats.text_lines import DeliveredLines
from tasks.formats.text_rows import Layout
from tasks.formats.text_table import TextTable, read_rows
from tasks.plain_text import quoted

_OPK_COLUMNS = ("NOM", "X", "Y", "Z", "O", "P", "K", "CAMERA")
_IMAGE_NAME = r"^(?P<flight>.*?)(?P<strip>[xX]\d+)_\d+"
_FULL_CONTROL = "13"
# Points that are named.
_SHOWN = 5
_ANGLE_UNIT = re.compile(r"^\s*UNITE\s+ANGLE\s*:\s*(\S+)", re.IGNORECASE)
_UNITS: dict[str, Literal["deg", "gon", "rad"]] = {
    "degre": "deg", "degree": "deg", "degres": "deg", "grade": "gon", "grades": "gon", "gon": "gon",
    "radian": "rad", "radians": "rad",
}  # fmt: skip


def read_ign_mes(path: Path) -> ImagePointRecords:
    """Read image points: point image column row.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`.
    """
    table = _read(path, ("point", "image", "column", "row"), ("column", "row"))
    return ImagePointRecords(
        file=path,
        image=table.names("image"),
        point=table.names("point"),
        xy=table.numbers(("column", "row")),
        sigma=np.broadcast_to(np.nan, (len(table), 2)),
        line=table.line,
    )


def read_ign_app(path: Path) -> ControlRecords:
    """Read control points: point code x y z; all of them fully known (see the module's docstring).

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`.
    """
    table = _read(path, ("point", "code", "x", "y", "z"), ("x", "y", "z"))
    return ControlRecords(
        file=path,
        point=table.text("point"),
        position=table.numbers(("x", "y", "z")),
        sigma=np.full((len(table), 3), np.nan),
        role=pa.nulls(len(table), pa.string()),
        line=table.line,
        extra={"code": table.text("code")},
        remarks=_code_remark(path, table),
    )


def _code_remark(path: Path, table: TextTable) -> tuple[str, ...]:
    import pyarrow.compute as pc

    other = pc.fill_null(pc.not_equal(table.text("code"), _FULL_CONTROL), fill_value=True)
    count = pc.sum(other).as_py()
    if not count:
        return ()
    point, code = (table.text(name).filter(other)[:_SHOWN].to_pylist() for name in ("point", "code"))
    listed = ", ".join(f"{name} ({value})" for name, value in zip(point, code, strict=True))
    shown = listed + (", …" if count > _SHOWN else "")
    return (
        f"{path.name}: control points with a code other than {_FULL_CONTROL} are assumed to be known in "
        f"x, y and z: {shown}. If some of their coordinates are only approximate, deliver them as CSV "
        "with these coordinates empty.",
    )


def read_ign_opk(path: Path, order: AngleOrder) -> ExposureRecords:
    """Read exposures: image X Y Z ω φ κ [camera]; strip and flight come from the image's name.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; a header without the needed columns; an order of
        angles this format does not have.
    """
    if order == "heading-pitch-roll":
        raise Location(path).error(
            "A file in ign-opk format contains ω, φ, κ, but the project file declares heading-pitch-roll.",
            'Declare angles.order = "omega-phi-kappa".',
        )
    text = _delivered(path)
    pieces = text.pieces()
    first = next(pieces)
    header_lines, names, unit = _opk_header(first, path)
    rows = first.split(b"\n", header_lines)[-1] if header_lines else first
    numeric = ("X", "Y", "Z", "O", "P", "K")
    table = _read_rows(text, chain([rows] if rows else [], pieces), names, numeric, header_lines + 1)
    image = table.text(names[0])
    camera = table.text("CAMERA") if table.has("CAMERA") else pa.nulls(len(table), pa.string())
    flight, strip = _flight_and_strip(image)
    missing = np.full((len(table), 3), np.nan)
    return ExposureRecords(
        file=path,
        image=image,
        camera=camera,
        strip=strip,
        flight=flight,
        time_s=missing[:, 0],
        position=table.numbers(("X", "Y", "Z")),
        angles=table.numbers(("O", "P", "K")),
        sigma_position=missing,
        sigma_angles=missing,
        line=table.line,
        declared_angle_unit=unit,
    )


def _flight_and_strip(image: pa.Array) -> tuple[pa.Array, pa.Array]:
    """Flight and strip in names like ``21FD244720x00015_00614``; null where the name has another form."""
    import pandas as pd
    import pyarrow.compute as pc

    encoded = image.dictionary_encode()
    parts = pd.Series(encoded.dictionary.to_pylist(), dtype="str").str.extract(_IMAGE_NAME)
    columns = []
    for name in ("flight", "strip"):
        values = pa.array(parts[name].tolist(), pa.string(), from_pandas=True)
        values = pc.if_else(pc.equal(values, ""), None, values)
        columns.append(pc.take(values, encoded.indices))
    return columns[0], columns[1]


def _opk_header(
    content: bytes, path: Path
) -> tuple[int, tuple[str, ...], Literal["deg", "gon", "rad"] | None]:
    """Number of lines before the first row, the column names, and the angle unit if a line states it."""
    unit: Literal["deg", "gon", "rad"] | None = None
    for number, raw in enumerate(content.split(b"\n", 50)[:50]):
        line = raw.decode("latin-1").strip()
        fields = line.split()
        if not fields:
            continue
        stated = _ANGLE_UNIT.match(line)
        if stated:
            unit = _UNITS.get(stated.group(1).lower().replace("é", "e"))
        if fields[0].upper() in {"NOM", "ID"}:
            return number + 1, _opk_names(fields, path, number + 1), unit
        if ":" not in line:
            return number, _OPK_COLUMNS[: max(7, min(len(fields), 8))], unit
    return 0, _OPK_COLUMNS, unit


def _opk_names(fields: Sequence[str], path: Path, line: int) -> tuple[str, ...]:
    names = tuple(field.upper() for field in fields)
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise Location(path, line).error(
            f"The header contains the column {quoted(twice)} twice.", "Use each column name once."
        )
    missing = [name for name in _OPK_COLUMNS[1:7] if name not in names]
    if missing:
        raise Location(path, line).error(
            f"The header lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}.",
            "Required are NOM (or ID), X, Y, Z, O, P, K and, if there are several cameras, CAMERA.",
        )
    return names


def _delivered(path: Path) -> DeliveredLines:
    # A blank for each CR keeps the line numbers: the files mix CR LF with "CR blank LF". Alone it ends lines.
    return DeliveredLines.of(path, lone_return=b" ")


def _read(path: Path, names: tuple[str, ...], numeric: tuple[str, ...]) -> TextTable:
    text = _delivered(path)
    return _read_rows(text, text.pieces(), names, numeric, 1)


def _read_rows(
    text: DeliveredLines,
    pieces: Iterable[bytes],
    names: tuple[str, ...],
    numeric: tuple[str, ...],
    first_line: int,
) -> TextTable:
    # The files are older than UTF-8; every byte is a character in Latin-1, so nothing is lost.
    layout = Layout(text.file, names, numeric, "blank", "utf-8" if text.is_utf8 else "latin-1")
    return read_rows(text, pieces, layout, first_line)
