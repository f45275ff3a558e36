"""BINGO: control points (``geoin.dat``) and orientations (``itera.dat``); image points are in `photo_lists`.

| file | line | meaning |
|---|---|---|
| ``geoin.dat`` | ``CONT`` id E N H, ``CHCK`` id E N H | control point, check point |
| ``itera.dat`` | ``ORIA`` photo X Y Z and three angles, camera | φ, ω, κ in most projects, else ω, φ, κ, as declared; mostly gon |

Other lines are of the program's own: those of ``geoin.dat`` (cameras, eccentricities, options) are named, object
points of ``itera.dat`` are passed over.
"""  # noqa: E501

from __future__ import annotations

from pathlib import Path

from tasks.errors import Location
from tasks.formats.long_columns import LongRows
from tasks.formats.named_entries import NotTaken
from tasks.formats.plain_records import numbers_of
from tasks.formats.records import AngleOrder, ControlRecords, ExposureRecords
from tasks.formats.text_lines import numbered_lines

_COMMENTS = ("*", "#")
_ROLES = {"CONT": "control", "CHCK": "check"}


def read_bingo_control(path: Path) -> ControlRecords:
    """Read control and check points.

    Raises
    ------
    InputError
        With file and line: no such lines, coordinates that are not numbers.
    """
    points, rest = LongRows("position"), NotTaken()
    for number, line in numbered_lines(path):
        fields = line.split()
        if len(fields) < 2 or fields[0].upper() not in _ROLES:
            rest.add(word for word in fields[:1] if not word.startswith(_COMMENTS) and word != "C")
            continue
        rest.add(["fields behind E, N, H"] if fields[5:] else [])
        place = numbers_of(path, fields[2:], 3, number, "E, N, H of a point")
        points.append(fields[1], place, text=_ROLES[fields[0].upper()], line=number)
    return points.control(path, remarks=rest.remarks(path))


def read_bingo_orientations(path: Path, order: AngleOrder) -> ExposureRecords:
    """Read orientations; the order of the angles is the declared one.

    Raises
    ------
    InputError
        With file and line: no such lines, an order that the program does not have.
    """
    if order == "heading-pitch-roll":
        raise Location(path).error(
            "A BINGO file contains φ, ω, κ (or ω, φ, κ), but the project file declares heading-pitch-roll.",
            'Declare angles.order = "phi-omega-kappa".',
        )
    rows = LongRows("position", "angles")
    for number, line in numbered_lines(path):
        fields = line.split()
        if len(fields) < 2 or fields[0].upper() != "ORIA":
            continue
        values = numbers_of(path, fields[2:], 6, number, "X, Y, Z and three angles")
        first, second, third = values[3:]
        angles = [second, first, third] if order == "phi-omega-kappa" else [first, second, third]
        camera = fields[8] if len(fields) > 8 else None
        rows.append(fields[1], values[:3], angles, text=camera, line=number)
    return rows.exposures(path)
