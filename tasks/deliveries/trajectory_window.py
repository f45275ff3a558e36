"""A trajectory around its events: eight samples each, geocentric, and what can be interpolated from them.

Event times are put onto the clock of the trajectory: leap seconds, weeks and days. Seconds of a week or day
are taken to the week or day in which the trajectory has them, so that a flight over the end of a week needs
no declaration. A trajectory longer than that is refused: an event could then be in two places.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.geometry.earth import ecef_from_enu, ecef_from_geodetic
from adjust.geometry.interpolation import Poses, between
from adjust.geometry.rotation import ENU_FROM_NED, log, ned_from_body
from tasks.errors import Location
from tasks.formats.earth_poses import WGS84
from tasks.formats.trajectory_records import Clock, TrajectoryRecords

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


#: Sample before an event, among its eight; the next one is after it.
_BEFORE, _SAMPLES = 3, 8
# Velocities of other axes differ by a good part of the speed, rates by all of what they are.
_SAME_SPEED, _SLACK_M_S = 0.05, 0.3
_SAME_RATE, _SLACK_RAD_S = 0.5, np.deg2rad(0.05)


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Eight samples around each of n events.

    Attributes
    ----------
    time : (n, 8) seconds.
    linked : (n, 7) whether a sample and the next are there, and no gap lies between them.
    position : (n, 8, 3) geocentric, m.
    attitude : (n, 8, 3, 3) geocentric from body; None: not given.
    velocity, rate : (n, 8, 3) m/s geocentric, rad/s about the axes of the body; None: from differences.
    contradicted : which of "velocities" and "rates" the file has, but not as positions and attitudes change.
    """

    time: Floats
    linked: Bools
    position: Floats
    attitude: Floats | None
    velocity: Floats | None
    rate: Floats | None
    contradicted: tuple[str, ...] = ()

    def at(self, time: Floats) -> Poses:
        """Poses at the events' times (n,)."""
        first, last = _BEFORE, _BEFORE + 1
        since = time - self.time[:, first]
        interval = self.time[:, last] - self.time[:, first]
        return between(self._pose(first, 1), self._pose(last, 1), interval, since)

    def left_out(self) -> tuple[Floats, Floats]:
        """Difference of a sample next to an event from its prediction by the others around it, m and rad.

        (n, 2) each, for the samples before and after the event; NaN where there are too few. Every other
        sample is left out, so that the interval is twice that of the interpolation.
        """
        metres, radians = np.full((len(self.time), 2), np.nan), np.full((len(self.time), 2), np.nan)
        for column, sample in enumerate((_BEFORE, _BEFORE + 1)):
            there = self.linked[:, sample - 1] & self.linked[:, sample]
            interval = self.time[:, sample + 1] - self.time[:, sample - 1]
            since = self.time[:, sample] - self.time[:, sample - 1]
            found = between(
                self._pose(sample - 1, 2),
                self._pose(sample + 1, 2),
                np.where(there, interval, 1.0),
                np.where(there, since, 0.5),
            )
            away = np.linalg.norm(found.position - self.position[:, sample], axis=1)
            metres[:, column] = np.where(there, away, np.nan)
            if found.attitude is not None and self.attitude is not None:
                turn = log(np.swapaxes(found.attitude, 1, 2) @ self.attitude[:, sample])
                radians[:, column] = np.where(there, np.linalg.norm(turn, axis=1), np.nan)
        return metres, radians

    def _pose(self, sample: int, stride: int) -> Poses:
        velocity = self._slopes(sample, stride) if self.velocity is None else self.velocity[:, sample]
        if self.attitude is None:
            return Poses(self.position[:, sample], velocity)
        rate = self._turning(sample, stride) if self.rate is None else self.rate[:, sample]
        return Poses(self.position[:, sample], velocity, self.attitude[:, sample], rate)

    def _sides(self, sample: int, stride: int) -> tuple[int, int, Floats, Floats]:
        """The samples before and after one, and their weights (n,) in a derivative; 0: missing."""
        before, after = max(sample - stride, 0), min(sample + stride, _SAMPLES - 1)
        has_before = self.linked[:, before:sample].all(axis=1) & (before < sample)
        has_after = self.linked[:, sample:after].all(axis=1) & (sample < after)
        # Of the parabola through three samples; of the straight line where only two are there.
        both = has_before & has_after
        to_before = np.where(both, self.time[:, after] - self.time[:, sample], 1.0) * has_before
        to_after = np.where(both, self.time[:, sample] - self.time[:, before], 1.0) * has_after
        total = np.where(has_before | has_after, to_before + to_after, 1.0)
        return before, after, to_before / total, to_after / total

    def _slopes(self, sample: int, stride: int) -> Floats:
        """Velocities (n, 3) from positions."""
        before, after, w0, w1 = self._sides(sample, stride)
        result = np.zeros((len(self.time), 3))
        for weight, a, b in ((w0, before, sample), (w1, sample, after)):
            step = np.where(weight > 0.0, self.time[:, b] - self.time[:, a], 1.0)
            result += (weight / step)[:, None] * (self.position[:, b] - self.position[:, a])
        return result

    def _turning(self, sample: int, stride: int) -> Floats:
        """Rates (n, 3) from attitudes."""
        assert self.attitude is not None  # a trajectory with rates has attitudes
        before, after, w0, w1 = self._sides(sample, stride)
        result = np.zeros((len(self.time), 3))
        for weight, a, b in ((w0, before, sample), (w1, sample, after)):
            step = np.where(weight > 0.0, self.time[:, b] - self.time[:, a], 1.0)
            turn = log(np.swapaxes(self.attitude[:, a], 1, 2) @ self.attitude[:, b])
            result += (weight / step)[:, None] * turn
        return result


def window_of(
    records: TrajectoryRecords, first: np.typing.NDArray[np.int64], longest_gap: float, rate_signs: Floats
) -> Window:
    """The samples around events.

    Parameters
    ----------
    first : (n,) the sample before each event.
    longest_gap : interval over which nothing is interpolated, s.
    rate_signs : (3,) from the file's axes of rates to forward, right, down.
    """
    wanted = first[:, None] + np.arange(-_BEFORE, _SAMPLES - _BEFORE)
    sample = np.clip(wanted, 0, len(records.time_s) - 1)
    time = records.time_s[sample]
    linked = (np.diff(sample, axis=1) == 1) & (np.diff(time, axis=1) <= longest_gap)
    geodetic = np.stack(
        [
            np.radians(records.position[sample, 1]),
            np.radians(records.position[sample, 0]),
            records.position[sample, 2],
        ],
        axis=-1,
    )
    axes = ecef_from_enu(geodetic[..., 0], geodetic[..., 1])
    attitude = velocity = rate = None
    if records.angles is not None:
        attitude = axes @ ENU_FROM_NED @ ned_from_body(records.angles[sample])
    if records.velocity is not None:
        velocity = np.einsum("nkij,nkj->nki", axes, records.velocity[sample])
    if records.rates is not None:
        rate = records.rates[sample] * rate_signs
    window = Window(time, linked, ecef_from_geodetic(WGS84, geodetic), attitude, None, None)
    # What the file has of both is taken only if it is what positions and attitudes say.
    contradicted = []
    if velocity is not None and not _agree(
        velocity[:, _BEFORE], window._slopes(_BEFORE, 1), _SAME_SPEED, _SLACK_M_S
    ):
        velocity, contradicted = None, ["velocities"]
    if rate is not None and not _agree(
        rate[:, _BEFORE], window._turning(_BEFORE, 1), _SAME_RATE, _SLACK_RAD_S
    ):
        rate, contradicted = None, [*contradicted, "rates"]
    return Window(time, linked, window.position, attitude, velocity, rate, tuple(contradicted))


def _agree(given: Floats, found: Floats, part: float, slack: float) -> bool:
    """Whether derivatives (n, 3) agree in the median to a fraction of their size."""
    if len(given) == 0:
        return True
    away = np.median(np.linalg.norm(given - found, axis=1))
    return bool(away <= part * np.median(np.linalg.norm(found, axis=1)) + slack)
