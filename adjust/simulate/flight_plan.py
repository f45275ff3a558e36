"""Flight plan: lines, overlaps, and the planned exposures with their times.

Base B = (1 − p) W_f h/c and line spacing A = (1 − q) W_a h/c, with end lap p, side lap q, the sides W_f, W_a
of the image along and across the flight, and the height h above the mean terrain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError

LinePattern = Literal["single", "alternating", "both"]

#: Time on the scale of the flights at which the first exposure is made, seconds.
START_TIME = 36_000.0
#: From the last exposure of a line to the first of the next, seconds.
TURN_TIME = 180.0


@dataclass(frozen=True)
class LineGroup:
    """Parallel lines flown alike. Lengths in metres, angles in radians.

    Attributes
    ----------
    name : before the number of the line in the names of its strips.
    flight : name of the flight the lines belong to.
    camera : index of the camera.
    heading : of the first line, clockwise from the y axis of the local frame.
    height : above the mean terrain.
    exposures : number of exposures of each line; the lines lie one next to the other to the right.
    base, spacing : between exposures and between lines.
    pattern : "single": all in the same direction; "alternating": every second one back; "both": each line
        flown twice, forward and back.
    centre : of the group in the local frame.
    speed : over ground, m/s.
    """

    name: str
    flight: str
    camera: int
    heading: float
    height: float
    exposures: tuple[int, ...]
    base: float
    spacing: float
    pattern: LinePattern = "alternating"
    centre: tuple[float, float] = (0.0, 0.0)
    speed: float = 75.0


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """n planned exposures.

    Attributes
    ----------
    images, strips, flights : names; the names of the images are in ascending order.
    strip, flight, camera : (n,) indices.
    plan : (n, 2) metres, local frame.
    height : (n,) above the mean terrain.
    heading : (n,) radians.  speed : (n,) m/s.  time : (n,) seconds.
    """

    images: tuple[str, ...]
    strips: tuple[str, ...]
    flights: tuple[str, ...]
    strip: Ints
    flight: Ints
    camera: Ints
    plan: Floats
    height: Floats
    heading: Floats
    speed: Floats
    time: Floats


def sides_along_and_across(camera: FrameCamera) -> tuple[float, float]:
    """Sides of the image along and across the flight, metres; the mounting decides which is which."""
    x, y = (2.0 * half for half in camera.half_format)
    return (x, y) if camera.mount_deg % 180 == 0 else (y, x)


def base_of(camera: FrameCamera, height: float, end_lap: float) -> float:
    """Distance of successive exposures, metres, that gives an end lap (0 to 1) at a height."""
    return (1.0 - end_lap) * sides_along_and_across(camera)[0] * height / camera.focal_length


def spacing_of(camera: FrameCamera, height: float, side_lap: float) -> float:
    """Distance of neighbouring lines, metres, that gives a side lap (0 to 1) at a height."""
    return (1.0 - side_lap) * sides_along_and_across(camera)[1] * height / camera.focal_length


def centre_from_start(
    start: tuple[float, float], heading: float, exposures: tuple[int, ...], base: float, spacing: float
) -> tuple[float, float]:
    """Centre of a group of lines whose first line has its first exposure at a given place."""
    forward, right = _directions(heading)
    x, y = start + 0.5 * (exposures[0] - 1) * base * forward + 0.5 * (len(exposures) - 1) * spacing * right
    return float(x), float(y)


def _directions(heading: float) -> tuple[Floats, Floats]:
    """Unit vectors (2,) forward and to the right."""
    sine, cosine = np.sin(heading), np.cos(heading)
    return np.array([sine, cosine]), np.array([cosine, -sine])


@dataclass(frozen=True, eq=False)
class _Line:
    """One line as it is flown."""

    strip: str
    group: LineGroup
    heading: float
    plan: Floats


def flight_plan(groups: tuple[LineGroup, ...]) -> FlightPlan:
    """All exposures of the groups, line after line.

    Raises
    ------
    InconsistentBlockError : if there is no exposure, or two groups of the same name.
    """
    lines = [line for group in groups for line in _lines(group)]
    strips = tuple(line.strip for line in lines)
    if not lines:
        raise InconsistentBlockError("The flight plan has no lines.")
    if len(set(strips)) < len(strips):
        raise InconsistentBlockError("Two groups of lines have the same name; strips would be confused.")
    flights = tuple(dict.fromkeys(group.flight for group in groups))
    clock = dict.fromkeys(flights, START_TIME)
    times = []
    for line in lines:
        seconds = np.arange(len(line.plan)) * line.group.base / line.group.speed
        times.append(clock[line.group.flight] + seconds)
        clock[line.group.flight] = float(times[-1][-1]) + TURN_TIME
    count = [len(line.plan) for line in lines]
    digits = max(3, len(str(max(count))))
    names = [f"{line.strip}_{k + 1:0{digits}d}" for line in lines for k in range(len(line.plan))]
    order = np.argsort(np.array(names))

    def of_lines(values: list[float]) -> Floats:
        return np.repeat(np.array(values, dtype=np.float64), count)[order]

    def index_of_lines(values: list[int]) -> Ints:
        return np.repeat(np.array(values, dtype=np.int64), count)[order]

    return FlightPlan(
        tuple(names[i] for i in order),
        strips,
        flights,
        index_of_lines(list(range(len(lines)))),
        index_of_lines([flights.index(line.group.flight) for line in lines]),
        index_of_lines([line.group.camera for line in lines]),
        np.concatenate([line.plan for line in lines])[order],
        of_lines([line.group.height for line in lines]),
        of_lines([line.heading for line in lines]),
        of_lines([line.group.speed for line in lines]),
        np.concatenate(times)[order],
    )


def _lines(group: LineGroup) -> list[_Line]:
    """The lines of a group in the order they are flown."""
    forward, right = _directions(group.heading)
    digits = max(2, len(str(len(group.exposures))))
    lines = []
    for number, exposures in enumerate(group.exposures):
        along = (np.arange(exposures) - 0.5 * (exposures - 1)) * group.base
        across = (number - 0.5 * (len(group.exposures) - 1)) * group.spacing
        plan = np.array(group.centre) + along[:, None] * forward + across * right
        strip = f"{group.name}{number + 1:0{digits}d}"
        there = _Line(strip, group, group.heading, plan)
        back = _Line(strip, group, group.heading + np.pi, plan[::-1])
        if group.pattern == "both":
            lines += [
                _Line(f"{strip}f", group, there.heading, plan),
                _Line(f"{strip}r", group, back.heading, plan[::-1]),
            ]
        else:
            lines.append(back if group.pattern == "alternating" and number % 2 else there)
    return lines
