"""RealityScan (RealityCapture): its CSV of registered images, ``#name,x,y,alt,heading,pitch,roll,…``.

The rotation world from camera (x right, y up) is R_z(−heading) R_x(pitch) R_y(roll), degrees; it is read as
ω, φ, κ. Whether east, north, up are those at each camera or at the anchor of the project depends on the
export and does not stand in the file.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from adjust.geometry.rotation import about_x, about_y, about_z
from tasks.errors import InputError
from tasks.formats.plain_lines import lines
from tasks.formats.plain_records import degrees_of_rotations, exposures_of, number_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement

_NEEDED = ("name", "x", "y", "alt", "heading", "pitch", "roll")


def read_realityscan_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the registered images.

    Raises
    ------
    InputError
        With file and line: columns or fields missing.
    """
    rows = lines(path)
    head = [name.strip().lower() for name in rows[0].lstrip("#").split(",")]
    missing = [name for name in _NEEDED if name not in head]
    if missing:
        raise InputError(
            f"The first line lacks {', '.join(missing)}.",
            "It is '#name,x,y,alt,heading,pitch,roll' and whatever else.",
            file=path,
            line=1,
        )
    places = [head.index(name) for name in _NEEDED]
    image, values, at = [], [], []
    for number, line in enumerate(rows[1:], start=2):
        if not line.strip():
            continue
        fields = next(csv.reader([line]))
        if len(fields) < len(head):
            raise InputError(
                f"This line has {len(fields)} fields, and the first one names {len(head)}.",
                "The file may have been cut off: deliver it again.",
                file=path,
                line=number,
            )
        image.append(fields[places[0]].strip())
        values.append([number_of(path, fields[place], number, head[place]) for place in places[1:]])
        at.append(number)
    table = np.array(values).reshape(-1, 6)
    heading, pitch, roll = np.radians(table[:, 3:]).T
    angles = degrees_of_rotations(path, about_z(-heading) @ about_x(pitch) @ about_y(roll), image, at)
    states = FileStatement(order="omega-phi-kappa")
    return exposures_of(path, image, table[:, :3], angles, at, unit="deg", states=states)
