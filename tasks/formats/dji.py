"""DJI's ``Timestamp.MRK``: one line an exposure, made by a drone with RTK.

Number, GPS seconds of the week, [week], from the antenna to the camera N, E, V (mm, V downwards), latitude,
longitude, ellipsoidal height, standard deviations north, east, up (m), quality: 50 fixed, 34 float, 16
single, 0 none. Positions are those of the camera: the drone has applied the three offsets. Images are called
by their number.
"""

from __future__ import annotations

import re
from array import array
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.formats.long_columns import table_of
from tasks.formats.plain_records import exposures_of, numbers_of
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement
from tasks.formats.sbet import WEEK_S
from tasks.formats.text_lines import numbered_lines
from tasks.formats.trajectory_records import Clock, EventRecords

_NUMBER = r"([+-]?[0-9.eE+-]+)"
_LINE = re.compile(
    rf"(\d+)\s+{_NUMBER}\s+\[(\d+)\]\s+{_NUMBER},N\s+{_NUMBER},E\s+{_NUMBER},V\s+"
    rf"{_NUMBER},Lat\s+{_NUMBER},Lon\s+{_NUMBER},Ellh\s+{_NUMBER},\s*{_NUMBER},\s*{_NUMBER}\s+(\d+),Q",
    re.ASCII,
)
# 52 is written by newer drones next to standard deviations of one or two centimetres.
_QUALITY = {0: "none", 16: "single", 34: "float", 50: "fixed", 52: "fixed"}
_STATES = FileStatement(heights="ellipsoidal", position="projection_centre")


@dataclass(frozen=True, slots=True, eq=False)
class _Marks:
    """The lines of a file: number, time (s since 1980), 9 numbers as they stand, solution, line."""

    image: list[str]
    time_s: Floats
    values: Floats
    solution: list[str | None]
    line: array[int]


def read_mrk_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read positions of exposures; a line of quality 0 has none.

    Raises
    ------
    InputError
        With file and line: a line that is none of MRK.
    """
    marks = _marks(path)
    known = np.array([solution != "none" for solution in marks.solution])[:, None]
    position = np.where(known, marks.values[:, [4, 3, 5]], np.nan)
    sigma = marks.values[:, [7, 6, 8]]
    return exposures_of(
        path,
        marks.image,
        position,
        None,
        marks.line,
        time_s=marks.time_s.tolist(),
        sigma_position=np.where(known & (sigma > 0.0), sigma, np.nan).tolist(),
        states=_STATES,
        solution=marks.solution,
        remarks=_of_unknown_quality(path, marks),
    )


def read_mrk_events(path: Path) -> EventRecords:
    """Read the times of exposures, with the vector from the antenna to the camera.

    Raises
    ------
    InputError
        As of `read_mrk_exposures`.
    """
    marks = _marks(path)
    nothing = pa.nulls(len(marks.image), pa.string())
    north, east, down = 1e-3 * marks.values[:, :3].T
    return EventRecords(
        path,
        Clock("gps", "date"),
        pa.array(marks.image, pa.string()),
        nothing,
        nothing,
        nothing,
        marks.time_s,
        np.asarray(marks.line, dtype=np.int64),
        np.column_stack([east, north, -down]),
    )


def _marks(path: Path) -> _Marks:
    image: list[str] = []
    solution: list[str | None] = []
    time, values, at = array("d"), array("d"), array("q")
    for number, line in numbered_lines(path):
        if not line.strip():
            continue
        found = _LINE.match(line.strip())
        if found is None:
            raise Location(path, number).error(
                "This is not a line of an MRK file: number, seconds, [week], N, E, V, Lat, Lon, Ellh, three "
                "standard deviations, Q.",
                "Deliver the unchanged file of the drone.",
            )
        second, week, *numbers = numbers_of(path, found.groups()[1:], 12, number, "a number")
        if not (
            0.0 <= second <= WEEK_S and week < 1e5 and abs(numbers[3]) <= 90.0 and abs(numbers[4]) <= 360.0
        ):
            raise Location(path, number, found[1]).error(
                "Time or position of this line are not valid: seconds of the week, degrees.",
                "Deliver the unchanged file of the drone.",
            )
        image.append(found[1])
        time.append(week * WEEK_S + second)
        values.extend(numbers[:9])
        solution.append(_QUALITY.get(int(numbers[9])))
        at.append(number)
    if not image:
        raise Location(path).error("There is no exposure in the file.", "Deliver it again.")
    return _Marks(image, np.array(time), table_of(values, 9), solution, at)


def _of_unknown_quality(path: Path, marks: _Marks) -> tuple[str, ...]:
    unknown = [image for image, solution in zip(marks.image, marks.solution, strict=True) if solution is None]
    if not unknown:
        return ()
    return (
        f"{path.name}: {len(unknown):,} exposures have a quality other than 0, 16, 34, 50, 52 (the first: "
        f"{unknown[0]}); the standard deviations of the file are used.",
    )
