"""RTKLIB's solutions, ``.pos``: a trajectory of positions with their quality, or positions of events.

Comments begin with ``%``; the last of them heads the columns: time (``GPST`` or ``UTC``, as a date or as week
and second), ``latitude(deg)``, ``longitude(deg)``, ``height(m)``, Q, ns, standard deviations and covariances
north, east, up, …, and velocities where they were written. Q: 1 fixed, 2 float, 3 SBAS, 4 DGPS, 5 single, 6
PPP. Another comment says ``lat/lon/height=WGS84/ellipsoidal``; ``geodetic`` heights are above a geoid.
"""

from __future__ import annotations

import re
from array import array
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import InputError, Location
from tasks.formats.calendar_time import seconds_of_date
from tasks.formats.long_columns import table_of
from tasks.formats.plain_records import number_of, numbers_of
from tasks.formats.records import FileStatement
from tasks.formats.sbet import SHORTEST_STEP_S, WEEK_S
from tasks.formats.text_lines import numbered_lines
from tasks.formats.trajectory_records import SOLUTIONS, Clock, TrajectoryRecords

_QUALITY = {1: "fixed", 2: "float", 3: "sbas", 4: "dgps", 5: "single", 6: "ppp"}
_SOLUTION = np.array([-1, *(SOLUTIONS.index(name) for name in _QUALITY.values())])
_PLACE = ("latitude(deg)", "longitude(deg)", "height(m)")
_SIGMA = ("sde(m)", "sdn(m)", "sdu(m)")
_VELOCITY = ("ve(m/s)", "vn(m/s)", "vu(m/s)")
_NEEDED = (*_PLACE, "Q")
_ABOVE_GEOID = re.compile(r"lat/lon/height\s*=[^/]*/\s*geodetic", re.IGNORECASE)
_FIELDS = re.compile(r"\s*,\s*|\s+")


def read_rtklib(path: Path) -> TrajectoryRecords:
    """Read a solution.

    Raises
    ------
    InputError
        With file and line: headings or fields missing, another clock, heights above a geoid, times that do
        not ascend.
    """
    head: list[str] = []
    time, values, at = array("d"), array("d"), array("q")
    for number, line in numbered_lines(path):
        if line.startswith("%"):
            if _ABOVE_GEOID.search(line):
                raise Location(path, number).error(
                    "The heights are above the geoid of RTKLIB (lat/lon/height=…/geodetic).",
                    "Write ellipsoidal heights (RTKLIB: out-height = ellipsoidal).",
                )
            named = _split(line.lstrip("%"))
            head = named if "Q" in named else head
            continue
        if not line.strip():
            continue
        if not head:
            raise _no_heading(path, number)
        if not at:
            _refuse_headings(path, head, number)
            # The time is one heading and two fields.
            places = [head.index(name) + 1 for name in _names(head)]
        fields = _split(line)
        if len(fields) < len(head) + 1:
            raise Location(path, number).error(
                f"This line has {len(fields)} fields, but the heading has {len(head) + 1}.",
                "The file may have been cut off: deliver it again.",
            )
        time.append(_time(path, fields, number))
        values.extend(numbers_of(path, [fields[k] for k in places], len(places), number, "a solution"))
        at.append(number)
    if not at:
        raise Location(path).error("There is no solution in the file.", "Deliver it again.")
    return _records(path, head, np.array(time), table_of(values, len(places)), at)


def _split(line: str) -> list[str]:
    return _FIELDS.split(line.strip())


def _names(head: list[str]) -> list[str]:
    return [name for name in (*_NEEDED, *_SIGMA, *_VELOCITY) if name in head]


def _time(path: Path, fields: list[str], line: int) -> float:
    if "/" in fields[0]:
        return seconds_of_date(path, f"{fields[0]} {fields[1]}", line)
    week = number_of(path, fields[0], line, "GPS week")
    return week * WEEK_S + number_of(path, fields[1], line, "seconds of the week")


def _no_heading(path: Path, line: int) -> InputError:
    return Location(path, line).error(
        "There is no line with the headings of the columns above this one.",
        "Write the solution with its header (RTKLIB: out-outhead = on).",
    )


def _refuse_headings(path: Path, head: list[str], line: int) -> None:
    if head[0] not in ("GPST", "UTC"):
        raise Location(path, line).error(
            f"The times are headed '{head[0][:20]}'.",
            "Write the solution in GPST or UTC (RTKLIB: out-timesys).",
        )
    missing = [name for name in _NEEDED if name not in head]
    if missing:
        raise Location(path, line).error(
            f"The headings lack {', '.join(missing)}.",
            "Write latitude, longitude, height in degrees (RTKLIB: out-solformat = llh, out-degform = deg).",
        )


def _records(path: Path, head: list[str], time: Floats, values: Floats, at: array[int]) -> TrajectoryRecords:
    names = _names(head)

    def columns(wanted: tuple[str, ...]) -> Floats | None:
        if not set(wanted) <= set(names):
            return None
        return values[:, [names.index(name) for name in wanted]]

    late = np.concatenate([[False], np.diff(time) < SHORTEST_STEP_S])
    quality = values[:, names.index("Q")]
    unknown = ~np.isin(quality, list(_QUALITY))
    latitude, longitude = values[:, 0], values[:, 1]
    nowhere = (np.abs(latitude) > 90.0) | (np.abs(longitude) > 360.0)
    for bad, what in (
        (late, "is not later than the one above"),
        (unknown, "has a quality Q other than 1 to 6"),
        (nowhere, "is not a position on the earth"),
    ):
        if bad.any():
            raise Location(path, at[int(np.argmax(bad))]).error(
                f"The solution {what} ({int(bad.sum())} of {len(bad)}).",
                "Deliver the unchanged file of RTKLIB.",
            )
    sigma = columns(_SIGMA)
    return TrajectoryRecords(
        path,
        Clock("gps" if head[0] == "GPST" else "utc", "date"),
        time,
        np.column_stack([longitude, latitude, values[:, 2]]),
        columns(_VELOCITY),
        sigma_position=None if sigma is None else np.where(sigma > 0.0, sigma, np.nan),
        solution=_SOLUTION[quality.astype(np.int64)],
        states=FileStatement(heights="ellipsoidal"),
    )
