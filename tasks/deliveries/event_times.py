"""Event times on the clock of a trajectory: leap seconds, weeks and days.

Seconds of a week or day are taken to the week or day in which the trajectory has them, so that a flight over
the end of a week needs no declaration. A trajectory longer than that is refused: an event could then be in
two places.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.formats.trajectory_records import Clock

_PERIODS = {"week": 604_800.0, "day": 86_400.0}


def on_clock_of(
    trajectory: Clock,
    span: tuple[float, float],
    events: Clock,
    time: Floats,
    gps_minus_utc: float | None,
    file: Path,
) -> Floats:
    """Event times (n,) on a trajectory's clock, seconds.

    Parameters
    ----------
    span : first and last time of the trajectory.
    gps_minus_utc : leap seconds, where they are declared.
    file : of the events, for messages.

    Raises
    ------
    InputError
        If the leap seconds are needed and not declared, or the trajectory has a time of day or week twice.
    """
    if events.scale != trajectory.scale:
        if gps_minus_utc is None:
            raise Location(file).error(
                f"The events are in {events}, the trajectory in {trajectory}: the leap seconds are missing.",
                "Declare trajectory.gps_minus_utc_s (18 since 2017).",
            )
        time = time + (gps_minus_utc if events.scale == "utc" else -gps_minus_utc)
    periods = [_PERIODS[clock.count] for clock in (events, trajectory) if clock.count != "date"]
    if not periods:
        return time
    first, last = span
    period = min(periods)
    if last - first >= period:
        raise Location(file).error(
            f"The trajectory lasts {last - first:,.0f} s, but event times repeat after {period:,.0f} s.",
            "Deliver event times as dates, or a trajectory for each day.",
        )
    # Into the period that begins with the trajectory, or, if nearer, before it.
    since = np.remainder(time - first, period)
    before = (since > last - first) & (period - since < since - (last - first))
    return np.asarray(first + since - np.where(before, period, 0.0))


def nearest_period(trajectory: Clock, span: tuple[float, float], time: Floats) -> Floats:
    """Times (n,) of accuracies in the week or day of a trajectory on the same clock."""
    if trajectory.count == "date":
        return time
    period = _PERIODS[trajectory.count]
    middle = 0.5 * (time[0] + time[-1])
    return np.asarray(time + period * np.round((0.5 * sum(span) - middle) / period))
