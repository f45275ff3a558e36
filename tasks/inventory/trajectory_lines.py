"""Inputs that take exposures from a trajectory: which events and accuracies belong to it.

Events belong to a trajectory if some of them lie within its times. On which clocks the two are the files
mostly do not say, so times are compared within a day, or a week where both count more than the seconds of a
day, and leap seconds are allowed for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow as pa

from adjust.arrays import Bools, Floats
from tasks.formats.records import ImagePointRecords
from tasks.formats.sbet import DAY_S, WEEK_S
from tasks.formats.trajectory_records import AccuracyRecords, EventRecords, TrajectoryRecords
from tasks.inventory.cameras import CameraSection
from tasks.inventory.foreign_tables import layout_keys
from tasks.inventory.project_lines import (
    ON_EARTH,
    POSITION,
    STRIP,
    camera_lines,
    comment,
    key_line,
    place_lines,
    value_range,
)
from tasks.inventory.recognition import Content, FoundFile
from tasks.settings.declare import open_value

# More than the leap seconds between GPS time and UTC will be in the life of a file.
_LEAP_S = 60.0
_TRAJECTORY_CLOCKS = ("gps-week", "utc-week", "gps-day", "utc-day")
_REDUCED = "projection_centre (the offset from the antenna in the events is applied) or antenna (it is not)"
_NAMES = "table (CSV with a heading) of the number of each event and the name of its image"
_LEAP = "GPS time minus UTC on the day of the flight, s (18 since 2017)"


@dataclass(frozen=True, eq=False)
class _Part:
    """A file that is one part of a delivered trajectory."""

    path: Path
    content: Content

    @property
    def time(self) -> Floats:
        """Times (n,) of its rows, s."""
        return np.asarray(
            cast(TrajectoryRecords | AccuracyRecords | EventRecords, self.content.records).time_s
        )


@dataclass(frozen=True, eq=False)
class TrajectorySection:
    """One input.

    Attributes
    ----------
    lines : of the project file.
    images : whose exposures it gives.
    """

    lines: tuple[str, ...]
    images: frozenset[str]


def trajectory_sections(
    files: Sequence[FoundFile], folder: Path, cameras: Sequence[CameraSection]
) -> list[TrajectorySection]:
    """An input for each trajectory and file of events that belongs to it, also for one without events."""
    trajectories, accuracies, events = (
        [_Part(file.path, one) for file in files for one in file.contents if one.kind == kind]
        for kind in ("trajectory", "accuracy", "events")
    )
    measured = _measured(files)
    sections = []
    for trajectory in trajectories:
        of_it: list[_Part | None] = [part for part in events if _within(part, trajectory).any()]
        accuracy = next((part for part in accuracies if _within(part, trajectory).any()), None)
        for part in of_it or [None]:
            lines = _lines(trajectory, part, accuracy, folder, cameras, measured)
            sections.append(TrajectorySection(tuple(lines), _images(part)))
    return sections


def unused_parts(files: Sequence[FoundFile], folder: Path) -> Iterator[str]:
    """Comments on events and accuracies that belong to no trajectory of the folder."""
    parts = [_Part(file.path, one) for file in files for one in file.contents]
    trajectories = [part for part in parts if part.content.kind == "trajectory"]
    exposures = {part.path for part in parts if part.content.kind == "exposures"}
    for part in parts:
        # A file of positions with times, such as DJI's, has its use without a trajectory.
        if part.content.kind not in ("accuracy", "events") or (not trajectories and part.path in exposures):
            continue
        if not any(_within(part, trajectory).any() for trajectory in trajectories):
            what = "times of exposures" if part.content.kind == "events" else "accuracies"
            yield comment(
                f"{part.path.relative_to(folder).as_posix()}: {what}, {value_range(part.time)} s, "
                f"{'within none of the trajectories' if trajectories else 'and no trajectory was found'}."
            )


def _within(part: _Part, trajectory: _Part) -> Bools:
    """Rows (n,) whose time is one of a trajectory's."""
    first, last = float(trajectory.time[0]), float(trajectory.time[-1])
    if part.content.kind == "accuracy":
        # They are on the clock of their trajectory.
        return np.asarray(np.remainder(part.time - first, WEEK_S) <= last - first)
    period = WEEK_S if part.time.max() > DAY_S and first > DAY_S else DAY_S
    since = np.remainder(part.time - first, period)
    return np.asarray((since <= last - first + _LEAP_S) | (since >= period - _LEAP_S))


def _lines(
    trajectory: _Part,
    events: _Part | None,
    accuracy: _Part | None,
    folder: Path,
    cameras: Sequence[CameraSection],
    measured: frozenset[str],
) -> Iterator[str]:
    records = cast(TrajectoryRecords, trajectory.content.records)
    moments = None if events is None else cast(EventRecords, events.content.records)
    yield "[[inputs.exposures]]"
    yield key_line("file", trajectory.path.relative_to(folder).as_posix())
    yield key_line("format", trajectory.content.format)
    yield from place_lines(records.states, records.position, _described(records), ON_EARTH)
    reduced = moments is not None and moments.from_antenna is not None
    yield key_line("position", open_value(_REDUCED if reduced else POSITION))
    yield from _angles(records)
    if len(cameras) > 1 and moments is not None:
        yield from camera_lines(moments.camera, cameras)
    if moments is None or moments.strip.null_count == len(moments.strip):
        yield key_line("strip", open_value(STRIP))
    if measured and not measured & _images(events):
        yield comment("Images have different names in the image points.")
        yield key_line("image_names", open_value(_NAMES))
    about = dict(_about(records, moments, accuracy, folder))
    if about:
        yield key_line("trajectory", about)
    yield ""
    yield "[inputs.exposures.events]"
    yield from _events(events, records, folder)


def _described(records: TrajectoryRecords) -> str:
    step = np.diff(records.time_s)
    usual = f", mostly {np.median(step):.4g} s apart, at most {step.max():.4g} s" if len(step) else ""
    return f"{len(records.time_s):,} samples, {value_range(records.time_s)} s{usual}"


def _angles(records: TrajectoryRecords) -> Iterator[str]:
    angles = {"order": "heading-pitch-roll", "unit": "deg", "reference": "true-north"}
    if records.angles is None:
        yield comment("no angles are given, so none of these keys matters")
    else:
        yield comment("angles and rates as defined by the format")
        angles = angles | {"unit": "rad", "rate_axes": "forward-right-down"}
    yield key_line("angles", angles)


def _about(
    records: TrajectoryRecords, moments: EventRecords | None, accuracy: _Part | None, folder: Path
) -> Iterator[tuple[str, str]]:
    """Keys of the table ``trajectory``."""
    if records.clock is None:
        # The seconds of a day are never as many.
        clocks = _TRAJECTORY_CLOCKS[:2] if records.time_s[0] > DAY_S else _TRAJECTORY_CLOCKS
        yield "time", open_value(" or ".join(clocks))
    if accuracy is not None:
        yield "accuracy", accuracy.path.relative_to(folder).as_posix()
    stated = {one.clock.scale for one in (records, moments) if one is not None and one.clock is not None}
    if len(stated) > 1:
        yield "gps_minus_utc_s", open_value(_LEAP)


def _events(events: _Part | None, records: TrajectoryRecords, folder: Path) -> Iterator[str]:
    if events is None:
        alone = "; without this table each solution is an exposure" if records.clock is not None else ""
        yield key_line("file", open_value(f"the times of the exposures{alone}"))
        yield key_line("time", open_value(" or ".join(_clocks(None))))
        return
    moments = cast(EventRecords, events.content.records)
    yield comment(f"{len(moments.line):,} times: {value_range(moments.time_s)} s")
    yield key_line("file", events.path.relative_to(folder).as_posix())
    yield key_line("format", events.content.format)
    for key, value in layout_keys(events.content.layout).items():
        yield key_line(key, value)
    if moments.clock is None:
        yield key_line("time", open_value(" or ".join(_clocks(moments.time_s))))
        yield comment(
            "If one clock is UTC and the other GPS time: trajectory.gps_minus_utc_s, 18.0 since 2017."
        )


def _clocks(time: Floats | None) -> tuple[str, ...]:
    """Clocks that times (n,) may be on."""
    if time is None:
        return (*_TRAJECTORY_CLOCKS, "gps-date", "utc-date")
    if time.max() > WEEK_S:
        return ("gps-date", "utc-date")
    return _TRAJECTORY_CLOCKS[:2] if time.max() > DAY_S else _TRAJECTORY_CLOCKS


def _measured(files: Sequence[FoundFile]) -> frozenset[str]:
    """Images that have image points."""
    records = [one.records for file in files for one in file.contents]
    return frozenset(
        str(name)
        for one in records
        if isinstance(one, ImagePointRecords)
        for name in one.image.dictionary.to_pylist()
    )


def _images(events: _Part | None) -> frozenset[str]:
    if events is None:
        return frozenset()
    names = cast(pa.Array, cast(EventRecords, events.content.records).image)
    return frozenset(str(name) for name in names.to_pylist())
