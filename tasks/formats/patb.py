"""PATB: orientations (``.ori``) and control points (``.con``); its image points are in `photo_lists`.

Orientations: photo, one spare field, X0, Y0, Z0 in a record of 16 columns each, then the nine elements of the
rotation ground from camera, row by row, five and four of them. They are read as ω, φ, κ in degrees.

Control: two lists, each ended by −99: point X Y, then point Z, each row with or without the number of an
accuracy group. A row with three coordinates is a full point. No description of the file by its makers was at
hand; how many points are known in plan, height and both is said, and a number that may be a height or a group
is refused.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.formats.long_columns import LongRows, table_of
from tasks.formats.plain_records import control_of, numbers_of
from tasks.formats.records import AngleOrder, ControlRecords, ExposureRecords, FileStatement
from tasks.formats.text_lines import numbered_lines

_WIDTH = 16
_END = "-99"
# More than any block has.
_MOST_POINTS = 500_000
_UNKNOWN = (np.nan, np.nan, np.nan)


def read_patb_orientations(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read orientations, three lines an image.

    Raises
    ------
    InputError
        With file and line: records that are cut off, or nine numbers that are no rotation.
    """
    rows = LongRows("position", "rotation")
    for (number, first), (number_2, second), (number_3, third) in _by_threes(path):
        name, coordinates = _station(path, first, number)
        elements = numbers_of(path, _fields(second, 5), 5, number_2, "five elements of a rotation")
        elements += numbers_of(path, _fields(third, 4), 4, number_3, "four elements of a rotation")
        rows.append(name, coordinates, elements, line=number)
    return rows.exposures(path, FileStatement(order="omega-phi-kappa"))


def _by_threes(path: Path) -> Iterator[list[tuple[int, str]]]:
    """The three lines of every image."""
    record: list[tuple[int, str]] = []
    count = 0
    for number, line in numbered_lines(path):
        if not line.strip() or line.split() == [_END]:
            continue
        record.append((number, line))
        count += 1
        if len(record) == 3:
            yield record
            record = []
    if record:
        raise Location(path, record[-1][0]).error(
            f"There are {count} lines, but every image needs three.",
            "The file may have been cut off: deliver it again.",
        )


def _station(path: Path, line: str, number: int) -> tuple[str, list[float]]:
    fields = line.split()
    if len(fields) not in (4, 5) or any("-" in field[1:] for field in fields[1:]):
        # Long numbers leave no blank between the columns.
        name, rest = line[:_WIDTH].strip(), line[2 * _WIDTH :]
        fields = [name, *(rest[k : k + _WIDTH] for k in range(0, 3 * _WIDTH, _WIDTH))]
    if not fields[0]:
        raise Location(path, number).error("The photo has no number.", "Deliver the file again.")
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
        With file and line: a point twice in a list, fields that are not numbers, a third number that may be a
        height or the number of an accuracy group.
    """
    rows: dict[str, int] = {}
    position, at = array("d"), array("q")
    lists = 0
    # Line, row and number of those that may be either; whether full points have no group.
    doubtful: list[tuple[int, int, str]] = []
    full = False
    for number, line in numbered_lines(path):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        if fields[0] == _END:
            lists += 1
            continue
        name, texts, is_plan = fields[0], fields[1:], lists % 2 == 0
        values = numbers_of(path, texts, len(texts), number, "a coordinate")
        own = len(values) - (len(texts) > (2 if is_plan else 1) and _may_be_group(texts[-1]))
        row = rows.setdefault(name, len(at))
        if row == _MOST_POINTS:
            raise Location(path, number).error(
                f"The lists have more than {_MOST_POINTS:,} points.",
                "Deliver those of the block. Coordinates of tie points are no control.",
            )
        if row == len(at):
            at.append(number)
            position.extend(_UNKNOWN)
        # A number alone is a height in any list.
        given = slice(3 * row, 3 * row + own) if own > 1 else slice(3 * row + 2, 3 * row + 3)
        _refuse_row(path, name, number, position[given], own, 3 if is_plan else 1)
        position[given] = array("d", values[:own])
        if is_plan and len(values) == 3:
            full = full or own == 3
            if own == 2:
                doubtful.append((number, row, texts[-1]))
    table = table_of(position, 3)
    _refuse_doubtful(path, list(rows), doubtful, table, full=full)
    return control_of(path, list(rows), table, at, remarks=(_counted(path, table),))


def _may_be_group(text: str) -> bool:
    """Whether a field behind the usual ones may be the number of an accuracy group: a small integer."""
    return text.isdecimal() and len(text) <= 2


def _refuse_row(path: Path, name: str, line: int, known: Sequence[float], own: int, most: int) -> None:
    """Refuse a row with more coordinates than its list may have, or of a point that has them."""
    if not 0 < own <= most:
        raise Location(path, line, name).error(
            f"The point has {own} coordinates in a list of {'plan' if most > 1 else 'heights'}.",
            "The first list must contain points with X and Y, the second those with Z, both without σ.",
        )
    if not np.isnan(known).all():
        raise Location(path, line, name).error(
            "The point has these coordinates in another line, too: twice in a list, or a height in both.",
            "Keep one of the two.",
        )


def _refuse_doubtful(
    path: Path, names: list[str], doubtful: list[tuple[int, int, str]], position: Floats, *, full: bool
) -> None:
    """Refuse rows whose third number, taken for a group, may be a height.

    It is a group if the height is in the other list, or if other heights are and no row has X, Y and Z alone.
    """
    known = np.isfinite(position[:, 2])
    for line, row, text in doubtful:
        if not known[row] and (full or not known.any()):
            raise Location(path, line, names[row]).error(
                f"The third number, {text}, may be a height or the number of an accuracy group.",
                "Write heights with a decimal point, or delete the numbers of groups.",
            )


def _counted(path: Path, position: Floats) -> str:
    plan, height = np.isfinite(position[:, 0]), np.isfinite(position[:, 2])
    return (
        f"{path.name}: {int((plan & height).sum())} points known in X, Y and Z, "
        f"{int((plan & ~height).sum())} in X and Y, {int((height & ~plan).sum())} in Z. Check these numbers."
    )
