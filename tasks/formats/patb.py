"""PATB: orientations (``.ori``) and control points (``.con``); its image points are in `photo_lists`.

Orientations: photo, one spare field, X0, Y0, Z0 in a record of 16 columns each, then the nine elements of the
rotation ground from camera, row by row, five and four of them. They are read as ω, φ, κ in degrees.

Control: two lists, each ended by −99: point X Y, then point Z, each row with or without the number of an
accuracy group. A row with three coordinates is a full point. No description of the file by its makers was at
hand; how many points are known in plan, height and both is said.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import InputError
from tasks.formats.plain_lines import lines
from tasks.formats.plain_records import control_of, degrees_of_rotations, exposures_of, number_of, numbers_of
from tasks.formats.records import AngleOrder, ControlRecords, ExposureRecords, FileStatement

_WIDTH = 16
_END = "-99"


def read_patb_orientations(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read orientations, three lines an image.

    Raises
    ------
    InputError
        With file and line: records that are cut off, or nine numbers that are no rotation.
    """
    given = [(number, line) for number, line in enumerate(lines(path), start=1) if line.strip()]
    given = [(number, line) for number, line in given if line.split() != [_END]]
    if len(given) % 3:
        raise InputError(
            f"There are {len(given)} lines, and every image has three.",
            "The file may have been cut off: deliver it again.",
            file=path,
            line=given[-1][0],
        )
    image: list[str] = []
    position: list[list[float]] = []
    rotation: list[list[float]] = []
    at: list[int] = []
    for (number, first), (number_2, second), (number_3, third) in zip(
        given[::3], given[1::3], given[2::3], strict=True
    ):
        name, coordinates = _station(path, first, number)
        elements = numbers_of(path, _fields(second, 5), 5, number_2, "five elements of a rotation")
        elements += numbers_of(path, _fields(third, 4), 4, number_3, "four elements of a rotation")
        image.append(name)
        position.append(coordinates)
        rotation.append(elements)
        at.append(number)
    angles = degrees_of_rotations(path, np.array(rotation), image, at)
    states = FileStatement(order="omega-phi-kappa")
    return exposures_of(path, image, position, angles, at, unit="deg", states=states)


def _station(path: Path, line: str, number: int) -> tuple[str, list[float]]:
    fields = line.split()
    if len(fields) not in (4, 5) or any("-" in field[1:] for field in fields[1:]):
        # Long numbers leave no blank between the columns.
        name, rest = line[:_WIDTH].strip(), line[2 * _WIDTH :]
        fields = [name, *(rest[k : k + _WIDTH] for k in range(0, 3 * _WIDTH, _WIDTH))]
    if not fields[0]:
        raise InputError("The photo has no number.", "Deliver the file again.", file=path, line=number)
    return fields[0], numbers_of(path, fields[-3:], 3, number, "X, Y, Z of a projection centre")


def _fields(line: str, count: int) -> list[str]:
    fields = line.split()
    if len(fields) == count:
        return fields
    return [line[k : k + _WIDTH] for k in range(0, len(line.rstrip()), _WIDTH)][:count]


def read_patb_control(path: Path) -> ControlRecords:
    """Read control points.

    Raises
    ------
    InputError
        With file and line: a point twice in a list, fields that are no numbers.
    """
    plan: dict[str, tuple[int, list[float]]] = {}
    height: dict[str, tuple[int, float]] = {}
    lists = 0
    for number, line in enumerate(lines(path), start=1):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        if fields[0] == _END:
            lists += 1
            continue
        values = [number_of(path, text, number, "a coordinate") for text in fields[1:]]
        name, own = fields[0], len(values) - _has_group(fields[1:], 2 if lists == 0 else 1)
        if own == 0 or own > 3 or name in (plan if lists == 0 else height):
            raise InputError(
                f"The point has {own} coordinates."
                if name not in plan
                else "The point is in this list twice.",
                "The first list has points with X and Y, the second with Z.",
                file=path,
                line=number,
                entity=name,
            )
        if own >= 2:
            plan[name] = (number, values[:2])
        if own != 2:
            height[name] = (number, values[own - 1])
    names = list(dict.fromkeys((*plan, *height)))
    missing: list[float] = [np.nan, np.nan]
    position = np.array(
        [[*plan.get(n, (0, missing))[1], height.get(n, (0, np.nan))[1]] for n in names]
    ).reshape(-1, 3)
    at = [plan[name][0] if name in plan else height[name][0] for name in names]
    return control_of(path, names, position, at, remarks=(_counted(path, position),))


def _has_group(texts: list[str], usual: int) -> bool:
    """Whether the last field is the number of an accuracy group: one more than usual, and a small integer."""
    return len(texts) > 1 and len(texts) != usual and texts[-1].isdecimal() and len(texts[-1]) <= 2


def _counted(path: Path, position: Floats) -> str:
    plan, height = np.isfinite(position[:, 0]), np.isfinite(position[:, 2])
    return (
        f"{path.name}: {int((plan & height).sum())} points known in X, Y and Z, "
        f"{int((plan & ~height).sum())} in X and Y, {int((height & ~plan).sum())} in Z. Check that so "
        "many were surveyed."
    )
