"""Image points in lists that end with −99: PATB ``.im`` (also ``.ima``, ``.f``) and BINGO ``image.dat``.

The first line of a list names the photo, all that follows on it is free; the others are point, x, y and
whatever else. Coordinates are in the image system (origin at the format centre, y up) in the unit that the
project file declares: µm in old PATB projects, else mm.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable
from pathlib import Path

from tasks.errors import InputError, Location
from tasks.formats.long_columns import LongNames, table_of
from tasks.formats.plain_records import image_points_of, numbers_of
from tasks.formats.records import ImagePointRecords
from tasks.formats.text_lines import pieces_of_lines
from tasks.magnitude import HUGE
from tasks.plain_text import quoted

_END = "-99"
# Within a name the sign belongs to it.
_COMMENT = re.compile(r"(^|\s)#.*")


def read_photo_lists(path: Path) -> ImagePointRecords:
    """Read image points.

    Raises
    ------
    InputError
        With file and line: a point without two coordinates; a list that does not end.
    """
    image, point, xy, at = LongNames(), LongNames(), array("d"), array("q")
    photo, first = "", 1
    for lines in pieces_of_lines(path):
        texts: list[str] = []
        begin = len(at)
        for number, line in enumerate(lines, start=first):
            words = (line if "#" not in line else _COMMENT.sub("", line)).split(None, 3)
            if not words:
                continue
            if words[0] == _END:
                photo = ""
            elif not photo:
                photo = words[0]
            elif len(words) < 3:
                raise _no_coordinates(path, words[0], number)
            else:
                image.append(photo)
                point.append(words[0])
                texts += words[1:3]
                at.append(number)
        xy.extend(_coordinates(path, texts, at[begin:], lines, first))
        first += len(lines)
    return image_points_of(path, image.column(), point.column(), table_of(xy, 2), at)


def _coordinates(
    path: Path, texts: list[str], at: array[int], lines: list[str], first: int
) -> Iterable[float]:
    """X and y of all rows, one behind the other."""
    try:
        found = list(map(float, texts))
    except ValueError:
        found = []
    # All at once, as nearly all are numbers; row by row to say which is none.
    if len(found) == len(texts) and sum(map(abs, found)) <= HUGE and "_" not in "".join(texts):
        return found
    for row, number in enumerate(at):
        try:
            numbers_of(path, texts[2 * row : 2 * row + 2], 2, number, "x and y")
        except InputError as error:
            raise _no_coordinates(path, lines[number - first].split()[0], number) from error
    # Each can be, and only all together are so much.
    return map(float, texts)


def _no_coordinates(path: Path, point: str, line: int) -> InputError:
    return Location(path, line).error(
        f"The point {quoted(point)} has no two coordinates.",
        "Correct them; if this line is the first of a photo, the list above lacks its end, -99.",
    )
