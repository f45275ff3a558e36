"""Headings of tables by others: what the project file must declare to have them read.

Nothing is taken for granted from a heading that is not ours; but the error that it makes names the line of
the project file with which the table can be read as it stands.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from tasks.errors import Location
from tasks.formats.table_layout import MARKS, TableLayout
from tasks.nearest_name import did_you_mean
from tasks.plain_text import quoted

#: Headings seen in deliveries, in lower case and without blanks and marks.
_ALIASES: Mapping[str, tuple[str, ...]] = {
    "point": ("name", "id", "gcp", "pointid", "pointname", "pt", "nr", "number", "label", "station"),
    "image": (
        "filename", "imagename", "photo", "photoid", "photoname", "label", "rollframe", "raster", "picture",
        "id", "name", "imageid", "frame",
    ),
    "x": (
        "easting", "east", "e", "xlong", "longitude", "lon", "long", "perspectivex", "x0", "eopx", "xm",
        "xmm", "column", "col",
    ),
    "y": (
        "northing", "north", "n", "ylat", "latitude", "lat", "perspectivey", "y0", "eopy", "ym", "ymm", "row",
    ),
    "z": (
        "height", "elevation", "elev", "h", "alt", "altitude", "hmsl", "ellipsoidheight", "perspectivez",
        "z0", "eopz", "zm", "up",
    ),
    "omega": ("rotx", "o", "omegadeg", "omegagon"),
    "phi": ("roty", "p", "phideg", "phigon"),
    "kappa": ("rotz", "k", "kappadeg", "kappagon"),
    "heading": ("yaw", "azimuth", "headingdeg"),
    "pitch": ("pitchdeg",),
    "roll": ("rolldeg",),
    "camera": ("cameraid", "cam", "sensor"),
    "strip": ("line", "stripid", "run", "flightline"),
    "time": ("gpstime", "times", "timestamp", "eventtime", "gpsseconds", "secondsofweek", "sow", "gpssow"),
}  # fmt: skip
#: What a project file can declare in the place of a column.
_INSTEAD = {
    "camera": 'camera = "NAME"',
    "strip": 'strip = "time-gaps" (or strip = { pattern = "{strip}_*" })',
}
#: Behind a heading of ours that the project file declares to be something else.
OF_THE_FILE = " of the file"
_NUMBERS_WITH_COMMA = re.compile(r"\d,\d")


def mapped_names(
    fields: Sequence[str], layout: TableLayout, known: Sequence[str], path: Path, line: int
) -> list[str]:
    """Our names where the project file declares a column by its heading or number, else the heading.

    Raises
    ------
    InputError
        If a declared column is not in the file, or its name is none that is read.
    """
    names = list(fields)
    for ours, theirs in layout.columns.items():
        if ours not in known:
            raise Location(path, entity=ours).error(
                f"columns declares {quoted(ours)}, which is not a column of this kind of file.",
                f"Columns are {', '.join(known)}.",
            )
        places = (
            [theirs - 1]
            if isinstance(theirs, int) and 0 < theirs <= len(fields)
            else [k for k, heading in enumerate(fields) if heading == theirs]
        )
        if len(places) != 1:
            trouble = "is not in the file" if not places else "exists twice"
            raise Location(path, line).error(
                f"columns declares {quoted(str(theirs))} for '{ours}', but that column {trouble}.",
                did_you_mean(str(theirs), fields)
                if isinstance(theirs, str) and not places
                else f"The file has {len(fields)} columns; give the number of one, from 1.",
            )
        if names[places[0]] != fields[places[0]]:
            raise Location(path, line).error(
                f"columns declares the same column, {quoted(str(theirs))}, twice.", "Keep one of them."
            )
        names[places[0]] = ours
    absent = next((heading for heading in layout.unused if heading not in fields), None)
    if absent is not None:
        raise Location(path, line).error(
            f"unused declares {quoted(absent)}, but that column is not in the file.",
            did_you_mean(absent, fields),
        )
    # What is declared to be another column, or to be unused, is not this one, whatever its heading.
    taken = {*layout.columns, *layout.unused} & set(known)
    return [
        f"{name}{OF_THE_FILE}"
        if name == heading and name in taken and layout.columns.get(name) != name
        else name
        for name, heading in zip(names, fields, strict=True)
    ]


def refuse_other_separator(
    fields: Sequence[str], needed: Sequence[str], layout: TableLayout, rows: bytes, path: Path, line: int
) -> None:
    """Raise if the line of headings has one column, and another separator would divide it.

    Raises
    ------
    InputError
        Naming the lines for the project file.
    """
    if len(fields) != 1 or len(needed) < 2:
        return
    text = fields[0] if layout.header else rows.split(b"\n", 1)[0].decode(layout.encoding, errors="replace")
    counts = {name: text.count(mark) for name, mark in MARKS.items() if name != layout.separator}
    name = max(counts, key=lambda one: (counts[one], one != "blank"))
    if counts[name] == 0:
        return
    sample = rows[:2_000].decode(layout.encoding, errors="replace")
    comma = name != "comma" and layout.decimal == "." and _NUMBERS_WITH_COMMA.search(sample)
    shown = {
        "semicolon": "a semicolon",
        "tab": "a tab",
        "bar": "a bar",
        "comma": "a comma",
        "blank": "blanks",
    }
    lines = f'separator = "{name}"' + (' and decimal = ","' if comma else "")
    raise Location(path, line).error(
        f"The columns are separated by {shown[name]}, not by a {layout.separator}.",
        f"Write {lines} into this input of the project file.",
    )


def alike(wanted: Iterable[str], fields: Sequence[str]) -> dict[str, str]:
    """Our names of columns → the headings of a file that look like them; no heading is used for two."""
    plain = {re.sub(r"[^a-z0-9]", "", name.lower()): name for name in reversed(fields)}
    found: dict[str, str] = {}
    for name in wanted:
        heading = next((plain[a] for a in _ALIASES.get(name, ()) if a in plain), None)
        if heading is not None and heading not in found.values():
            found[name] = heading
    return found


def declaration(missing: Iterable[str], fields: Sequence[str], layout: TableLayout) -> str:
    """The line of the project file that would declare missing columns; empty if nothing looks like them."""
    if not layout.header:
        return " The file has no headings: declare the columns by number, e.g. columns = { x = 2 }."
    missing = list(missing)
    found = alike(missing, fields)
    text = ""
    if found:
        every = {**{name: str(heading) for name, heading in layout.columns.items()}, **found}
        pairs = ", ".join(f'{name} = "{heading}"' for name, heading in every.items())
        text = f" If these are the corresponding columns, write columns = {{ {pairs} }} into this input."
    instead = [_INSTEAD[name] for name in missing if name in _INSTEAD and name not in found]
    return text + (f" Instead of a column: {' and '.join(instead)}." if instead else "")
