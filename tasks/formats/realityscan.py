"""RealityScan (RealityCapture): its CSV of registered images, ``#name,x,y,alt,heading,pitch,roll,…``.

A line ``#cameras N`` may come first, and ``alt`` may be called ``z``.

The rotation world from camera (x right, y up) is R_z(−heading) R_x(pitch) R_y(roll), degrees; it is read as
ω, φ, κ. Whether east, north, up are those at each camera or at the anchor of the project depends on the
export and is not in the file.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from adjust.geometry.rotation import about_x, about_y, about_z
from tasks.errors import Location
from tasks.formats.long_columns import LongRows
from tasks.formats.plain_records import degrees_of_rotations, numbers_of, pieces_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement
from tasks.formats.text_lines import numbered_lines

_COUNT = re.compile(r"#cameras\s+(\d{1,9})\s*", re.ASCII)
_NEEDED = ("name", "x", "y", "alt", "heading", "pitch", "roll")


def read_realityscan_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the registered images.

    Raises
    ------
    InputError
        With file and line: columns or fields missing.
    """
    rows = numbered_lines(path)
    first, top = next(rows)
    count = _COUNT.fullmatch(top)
    if count is not None:
        first, top = next(rows, (2, ""))
    head = [name.strip().lower() for name in top.lstrip("#").split(",")]
    if "alt" not in head:
        head = ["alt" if name == "z" else name for name in head]
    missing = [name for name in _NEEDED if name not in head]
    if missing:
        raise Location(path, first).error(
            f"The line with the headings lacks {', '.join(missing)}.",
            "It must be '#name,x,y,alt,heading,pitch,roll', possibly with more columns.",
        )
    places = [head.index(name) for name in _NEEDED]
    images = LongRows("position", "angles")
    for number, line in rows:
        if not line.strip():
            continue
        fields = next(csv.reader([line]))
        if len(fields) < len(head):
            raise Location(path, number).error(
                f"This line has {len(fields)} fields, but the headings are {len(head)}.",
                "The file may have been cut off: deliver it again.",
            )
        named = [fields[place] for place in places[1:]]
        values = numbers_of(path, named, 6, number, ", ".join(_NEEDED[1:]))
        images.append(fields[places[0]].strip(), values[:3], values[3:], line=number)
    if count is not None and int(count[1]) != len(images.names):
        raise Location(path, 1).error(
            f"The file has {len(images.names):,} images, but its first line counts {int(count[1]):,}.",
            "The file may have been cut off: deliver it again.",
        )
    angles = np.empty_like(images["angles"])
    for piece in pieces_of(len(angles)):
        heading, pitch, roll = np.radians(images["angles"][piece]).T
        turn = about_z(-heading) @ about_x(pitch) @ about_y(roll)
        angles[piece] = degrees_of_rotations(path, turn, images.names[piece], images.line[piece])
    return images.exposures(path, FileStatement(order="omega-phi-kappa"), unit="deg", angles=angles)
