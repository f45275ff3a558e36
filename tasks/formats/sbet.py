"""Smoothed trajectories of POSPac (SBET) and their accuracies (smrmsg): binary, without a header.

An SBET record is 17 little-endian doubles: time (s), latitude, longitude (rad), height (m), velocity x, y, z
(m/s), roll, pitch, platform heading, wander angle w (rad), acceleration x, y, z of the body (m/s²), its
angular rates about forward, right, down (rad/s). Velocities are in the wander frame, x north, y west, z up
where w is 0:

    v_north = v_x cos w − v_y sin w      v_east = −v_x sin w − v_y cos w      heading = platform heading − w

A record of smrmsg is 10: time, RMS of position (m) and velocity (m/s) north, east, down, of roll, pitch,
heading (minutes of arc). Neither says its clock, datum, or point of reference.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adjust.arrays import Bools, Floats
from tasks.errors import Location
from tasks.files.delivered_file import file_limits
from tasks.formats.records import FileStatement
from tasks.formats.text_table import read_bytes
from tasks.formats.trajectory_records import AccuracyRecords, TrajectoryRecords
from tasks.magnitude import HUGE

#: Doubles of a record.
SBET_FIELDS, SMRMSG_FIELDS = 17, 10
WEEK_S, DAY_S = 604_800.0, 86_400.0
#: Samples nearer to each other than any receiver has them are one.
SHORTEST_STEP_S = 1e-6
_ARC_MINUTE = np.pi / 10_800.0
# Far from everything that flies: other doubles than those of a trajectory.
_HIGHEST_M, _FASTEST_M_S, _FASTEST_RAD_S = 1e5, 1e4, 1e3
# One record has no time before or after it.
_FEWEST = 2
_STATES = FileStatement(heights="ellipsoidal", order="heading-pitch-roll", reference="true-north")


def read_sbet(path: Path) -> TrajectoryRecords:
    """Read a trajectory.

    Raises
    ------
    InputError
        If the length is not that of whole records, one has numbers that no trajectory has, or times do not
        ascend.
    """
    table = _records(path, SBET_FIELDS, "SBET")
    latitude, longitude, height = table[:, 1], table[:, 2], table[:, 3]
    impossible = (
        (np.abs(latitude) > 0.5 * np.pi)
        | (np.abs(longitude) > 2.0 * np.pi)
        | (np.abs(height) > _HIGHEST_M)
        | (np.abs(table[:, 4:7]) > _FASTEST_M_S).any(axis=1)
        | (np.abs(table[:, 7:11]) > 4.0 * np.pi).any(axis=1)
        | (np.abs(table[:, 14:17]) > _FASTEST_RAD_S).any(axis=1)
    )
    _refuse(
        path, impossible, "has numbers that are impossible in an SBET (position, velocity, angles or rates)"
    )
    wander = table[:, 10]
    sine, cosine = np.sin(wander), np.cos(wander)
    north = table[:, 4] * cosine - table[:, 5] * sine
    east = -table[:, 4] * sine - table[:, 5] * cosine
    return TrajectoryRecords(
        path,
        None,
        _ascending(path, table[:, 0]),
        np.column_stack([np.degrees(longitude), np.degrees(latitude), height]),
        np.column_stack([east, north, table[:, 6]]),
        np.column_stack([np.remainder(table[:, 9] - wander, 2.0 * np.pi), table[:, 8], table[:, 7]]),
        table[:, 14:17],
        states=_STATES,
    )


def read_smrmsg(path: Path) -> AccuracyRecords:
    """Read the accuracies of a trajectory.

    Raises
    ------
    InputError
        If the length is not that of whole records, one is no accuracy, or times do not ascend.
    """
    table = _records(path, SMRMSG_FIELDS, "smrmsg")
    rms = table[:, 1:]
    impossible = (rms < 0.0).any(axis=1) | (rms[:, :6] > _HIGHEST_M).any(axis=1) | (len(rms) < _FEWEST)
    _refuse(path, np.asarray(impossible), "is not an accuracy, or is the only record")
    # Zero is where nothing was computed.
    rms = np.where(rms > 0.0, rms, np.nan)
    return AccuracyRecords(
        path, _ascending(path, table[:, 0]), rms[:, [1, 0, 2]], rms[:, [8, 7, 6]] * _ARC_MINUTE
    )


def _records(path: Path, fields: int, name: str) -> Floats:
    """The records (n, fields) of a file, all numbers of which are finite."""
    content = read_bytes(path)
    size = 8 * fields
    if len(content) % size:
        raise Location(path).error(
            f"The file has {len(content):,} bytes, but {name} has records of {size}: "
            f"{len(content) % size} remain.",
            "The file may have been cut off, or is of another format: deliver it again.",
        )
    file_limits().require_rows(path, len(content) // size)
    table = np.frombuffer(content, dtype="<f8").reshape(-1, fields)
    _refuse(
        path, ~np.asarray((np.abs(table) <= HUGE).all(axis=1)), f"has numbers that are impossible in a {name}"
    )
    return np.asarray(table, dtype=np.float64)


def _refuse(path: Path, bad: Bools, what: str) -> None:
    if bad.any():
        raise Location(path).error(
            f"Record {int(np.argmax(bad)) + 1:,} {what} ({int(bad.sum()):,} of {len(bad):,} records).",
            "The file may be of another format or byte order, or damaged: deliver it again.",
        )


def _ascending(path: Path, time: Floats) -> Floats:
    """Times (n,) that continue over the end of a week or a day."""
    _refuse(path, (time < 0.0) | (time > WEEK_S), "has a time beyond the seconds of a week")
    step = np.diff(time)
    for period in (WEEK_S, DAY_S):
        over = step < -0.5 * period
        if over.any():
            time = time + period * np.concatenate([[0.0], np.cumsum(over)])
            break
    late = np.concatenate([[False], np.diff(time) < SHORTEST_STEP_S])
    _refuse(path, late, "is not later than the one before")
    return time
