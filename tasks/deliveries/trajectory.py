"""Exposures from a trajectory: interpolated at the times of the events, never beyond its samples.

Positions by cubics through positions and velocities, attitudes by cubics of rotation vectors through
attitudes and rates (`adjust.geometry.interpolation`), both geocentric; σ linearly. Where the file has no
velocities, or others than those of its positions, they are taken from differences. How well it interpolates
is found by leaving out the samples next to the events.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry.earth import ecef_from_enu, geodetic_from_ecef
from adjust.geometry.interpolation import Poses
from adjust.geometry.rotation import ENU_FROM_NED, to_heading_pitch_roll
from tasks.deliveries.trajectory_path import TrajectoryPath, path_of
from tasks.deliveries.trajectory_window import Window, nearest_period, on_clock_of, window_of
from tasks.errors import Location
from tasks.formats.earth_poses import WGS84, in_degrees
from tasks.formats.records import ExposureRecords
from tasks.formats.register import ACCURACY_FORMATS, TRAJECTORY_FORMATS, read_events
from tasks.formats.trajectory_records import SOLUTIONS, Clock, EventRecords, TrajectoryRecords
from tasks.plain_text import some_of
from tasks.settings.inputs import ExposuresInput
from tasks.settings.trajectory import CLOCKS, ClockName, EventsInput

# Intervals of the median that are still none between two samples.
_GAP_FACTOR = 2.5
# Names that a message lists.
# A sample that is so many times farther off than four of five, and than its σ, does not belong to the others.
_OUTLIER, _USUAL, _OUTLIER_SIGMAS, _OUTLIER_M = 5.0, 0.8, 5.0, 0.05
# The error is of the fourth order: over twice the interval it is so many times as large.
_TWICE = 16.0


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Events within a trajectory.

    Attributes
    ----------
    time : (n,) of the events on its clock.
    first : (n,) the sample before each; meaningless where there is none.
    inside : (n,) whether samples lie before and after it, without a gap.
    trouble : (n,) what is wrong otherwise, in words.
    """

    time: Floats
    first: Ints
    inside: Bools
    trouble: list[str]


def exposures_of_trajectory(source: ExposuresInput) -> tuple[ExposureRecords, TrajectoryPath]:
    """Exposures of a trajectory with its events, and its path; without events each sample is an exposure.

    Raises
    ------
    InputError
        As of the readers; for clocks that cannot be compared; for events outside of the trajectory or in one
        of its gaps, unless they are to be left out.
    """
    records = TRAJECTORY_FORMATS[source.format](source.file)
    if source.events is None:
        return _samples(records), path_of(records, np.inf, np.zeros(0, np.int64))
    events = _events(source.events)
    clock = _clock(records.clock, source.trajectory.time)
    found = _found(records, clock, events, source)
    _refuse_outside(events, found, source.events)
    rows = np.flatnonzero(found.inside)
    if len(rows) == 0:
        raise Location(events.file).error(
            f"None of the {len(found.time):,} events lies within the trajectory {source.file.name}.",
            f"{found.trouble[0]} Check the clocks (trajectory.time, events.time).",
        )
    first = found.first[rows]
    # Rates of other axes are delivered as they stand and turned with the angles; here they are needed.
    signs = np.array([1.0, -1.0, -1.0] if source.angles.rate_axes == "forward-left-up" else [1.0, 1.0, 1.0])
    gap = _longest_gap(records, source)
    window = window_of(records, first, gap, signs)
    poses = window.at(found.time[rows])
    reduced = events.from_antenna is not None and source.position == "projection_centre"
    exposures = _exposures(records, events, found, poses, events.from_antenna if reduced else None)
    part = (found.time[rows] - records.time_s[first]) / (records.time_s[first + 1] - records.time_s[first])
    exposures = _with_sigmas(exposures, records, source, clock, rows, first, part)
    if exposures.rates is not None:
        exposures = replace(exposures, rates=exposures.rates * signs)
    metres, radians = window.left_out()
    away = _outliers(metres, exposures.sigma_position[rows])
    remarks = (
        *_about_outside(events, found),
        *_about_window(window),
        _about_precision(float(np.median(np.diff(records.time_s))), metres, radians),
        *_about_motion(exposures, rows, metres),
        *_about_outliers(exposures.image, rows[away], metres[away]),
    )
    exposures = replace(exposures, remarks=tuple(f"{source.file.name}: {remark}" for remark in remarks))
    beside = first[away] + np.argmax(np.nan_to_num(metres[away]), axis=1)
    return exposures, path_of(records, gap, beside)


def _events(declared: EventsInput) -> EventRecords:
    count = "week" if declared.time is None else CLOCKS[declared.time].count
    events = read_events(declared.format, declared.file, count, declared.layout)
    return replace(events, clock=_clock(events.clock, declared.time))


def _clock(stated: Clock | None, declared: ClockName | None) -> Clock:
    """The clock that a file states, or the one declared for it; the settings require one of both."""
    return CLOCKS[declared] if stated is None and declared is not None else stated  # type: ignore[return-value]


def _longest_gap(records: TrajectoryRecords, source: ExposuresInput) -> float:
    if source.trajectory.longest_gap_s is not None:
        return source.trajectory.longest_gap_s
    return _GAP_FACTOR * float(np.median(np.diff(records.time_s)))


def _found(records: TrajectoryRecords, clock: Clock, events: EventRecords, source: ExposuresInput) -> _Found:
    if len(records.time_s) < 2:
        raise Location(records.file).error("A trajectory needs two samples.", "Deliver it again.")
    assert events.clock is not None  # set when they were read
    begin, end = float(records.time_s[0]), float(records.time_s[-1])
    time = on_clock_of(
        clock, (begin, end), events.clock, events.time_s, source.trajectory.gps_minus_utc_s, events.file
    )
    # An event at the very end lies between the last two.
    first = np.searchsorted(records.time_s, time, side="right") - 1
    first = np.where(time == end, first - 1, first)
    gap = _longest_gap(records, source)
    trouble = []
    for moment, sample in zip(time.tolist(), first.tolist(), strict=True):
        if sample < 0:
            trouble.append(f"It is {begin - moment:,.3f} s before the first sample.")
        elif sample >= len(records.time_s) - 1:
            trouble.append(f"It is {moment - end:,.3f} s after the last sample.")
        elif (interval := float(records.time_s[sample + 1] - records.time_s[sample])) > gap:
            trouble.append(f"It is in a gap of {interval:,.3f} s, longer than {gap:.3f} s.")
        else:
            trouble.append("")
    return _Found(time, first.astype(np.int64), np.array([not one for one in trouble]), trouble)


def _refuse_outside(events: EventRecords, found: _Found, declared: EventsInput) -> None:
    if found.inside.all() or declared.outside == "leave-out":
        return
    row = int(np.argmin(found.inside))
    raise Location(events.file, int(events.line[row]), str(events.image[row])).error(
        f"The trajectory does not contain the time of this event. {found.trouble[row]} "
        f"({int((~found.inside).sum()):,} of {len(found.inside):,} events are outside.)",
        'Check the clocks, deliver the whole trajectory, or declare events.outside = "leave-out".',
    )


def _samples(records: TrajectoryRecords) -> ExposureRecords:
    """Each sample as an exposure, named by its number."""
    count = len(records.time_s)
    nothing, nobody = np.full((count, 3), np.nan), pa.nulls(count, pa.string())
    return ExposureRecords(
        file=records.file,
        image=pa.array([str(number) for number in range(1, count + 1)], pa.string()),
        camera=nobody,
        strip=nobody,
        flight=nobody,
        time_s=records.time_s,
        position=records.position,
        angles=nothing,
        sigma_position=nothing if records.sigma_position is None else records.sigma_position,
        sigma_angles=nothing,
        line=np.arange(1, count + 1),
        states=records.states,
        solution=_solutions(records, *(np.arange(count),) * 3, count),
        velocity=records.velocity,
    )


def _exposures(
    records: TrajectoryRecords, events: EventRecords, found: _Found, poses: Poses, from_antenna: Floats | None
) -> ExposureRecords:
    """The events with positions, velocities, angles and rates; without σ."""
    rows, count = np.flatnonzero(found.inside), len(found.time)
    geodetic = geodetic_from_ecef(WGS84, poses.position)
    axes = ecef_from_enu(geodetic[:, 0], geodetic[:, 1])
    if from_antenna is not None:
        moved = poses.position + np.einsum("nij,nj->ni", axes, from_antenna[rows])
        geodetic = geodetic_from_ecef(WGS84, moved)
    position, velocity, angles, nothing = (np.full((count, 3), np.nan) for _ in range(4))
    position[rows] = in_degrees(geodetic)
    velocity[rows] = np.einsum("nji,nj->ni", axes, poses.velocity)
    rates = None
    if poses.attitude is not None and poses.rate is not None:
        ned_from_body = ENU_FROM_NED.T @ np.swapaxes(axes, 1, 2) @ poses.attitude
        angles[rows] = to_heading_pitch_roll(ned_from_body)
        angles[rows, 0] %= 2.0 * np.pi
        rates = np.full((count, 3), np.nan)
        rates[rows] = poses.rate
    return ExposureRecords(
        file=events.file,
        image=events.image,
        camera=events.camera,
        strip=events.strip,
        flight=events.flight,
        time_s=found.time,
        position=position,
        angles=angles,
        sigma_position=nothing,
        sigma_angles=nothing.copy(),
        line=events.line,
        rates=rates,
        declared_angle_unit=None if poses.attitude is None else "rad",
        extra=events.extra,
        states=records.states,
        solution=_solutions(records, rows, found.first[rows], found.first[rows] + 1, count),
        velocity=velocity,
    )


def _solutions(
    records: TrajectoryRecords, rows: Ints, before: Ints, after: Ints, count: int
) -> pa.Array | None:
    """Kind of solution (count,) in rows: the worse of the two samples around each."""
    if records.solution is None:
        return None
    names: list[str | None] = [None] * count
    for row, worse in zip(rows, np.maximum(records.solution[before], records.solution[after]), strict=True):
        names[int(row)] = SOLUTIONS[int(worse)]
    return pa.array(names, pa.string())


def _with_sigmas(
    exposures: ExposureRecords,
    records: TrajectoryRecords,
    source: ExposuresInput,
    clock: Clock,
    rows: Ints,
    first: Ints,
    part: Floats,
) -> ExposureRecords:
    """σ of the positions of the trajectory itself, or of the file of its accuracies."""
    position, angles = exposures.sigma_position, exposures.sigma_angles
    if records.sigma_position is not None:
        before, after = records.sigma_position[first], records.sigma_position[first + 1]
        position[rows] = (1.0 - part)[:, None] * before + part[:, None] * after
    if source.trajectory.accuracy is None:
        return exposures
    accuracy = ACCURACY_FORMATS["smrmsg"](source.trajectory.accuracy)
    span = float(records.time_s[0]), float(records.time_s[-1])
    time, moment = nearest_period(clock, span, accuracy.time_s), exposures.time_s[rows]
    beyond = (moment < time[0]) | (moment > time[-1])
    if beyond.any():
        row = int(rows[int(np.argmax(beyond))])
        raise Location(exposures.file, int(exposures.line[row]), str(exposures.image[row])).error(
            f"The accuracies {accuracy.file.name} do not contain the time of this event "
            f"({int(beyond.sum()):,} events); they run from {time[0]:,.3f} to {time[-1]:,.3f} s.",
            "Deliver those of the whole trajectory, or leave trajectory.accuracy out.",
        )
    for target, given in ((position, accuracy.sigma_position), (angles, accuracy.sigma_angles)):
        target[rows] = np.column_stack([np.interp(moment, time, column) for column in given.T])
    return replace(exposures, sigma_position=position, sigma_angles=angles)


def _about_outside(events: EventRecords, found: _Found) -> list[str]:
    outside = np.flatnonzero(~found.inside)
    if len(outside) == 0:
        return []
    row = int(outside[0])
    return [
        f"{len(outside):,} events are excluded, as declared "
        f"({some_of(events.image.take(pa.array(outside)))}). The first: {found.trouble[row]}"
    ]


def _about_window(window: Window) -> list[str]:
    of = {"velocities": "positions", "rates": "attitudes"}
    return [
        f"the {name} do not agree with the changes of the {of[name]}; the interpolation derives {name} "
        f"from the {of[name]}. Their axes may be different."
        for name in window.contradicted
    ]


def _about_precision(interval: float, metres: Floats, radians: Floats) -> str:
    """How well samples next to the events are predicted from the others around them."""
    known = np.isfinite(metres).any(axis=1)
    if not known.any():
        return "no event has enough samples around it to test the interpolation."
    worst = np.fmax(metres[:, 0], metres[:, 1])
    words = f"positions to {1e3 * np.nanmedian(worst):.2g} mm (largest {1e3 * np.nanmax(worst):.2g} mm)"
    if np.isfinite(radians).any():
        turn = np.degrees(np.fmax(radians[:, 0], radians[:, 1]))
        words += f", attitudes to {np.nanmedian(turn):.2g}° (largest {np.nanmax(turn):.2g}°)"
    return (
        f"{len(metres):,} events interpolated between samples {interval:.4g} s apart. Interpolation over "
        f"twice the interval reproduces omitted samples near the events: {words}."
    )


def _about_motion(exposures: ExposureRecords, rows: Ints, metres: Floats) -> list[str]:
    """Whether the samples are too far apart for the motion."""
    error = np.nan_to_num(np.fmax(metres[:, 0], metres[:, 1])) / _TWICE
    rough = rows[error > np.linalg.norm(exposures.sigma_position[rows], axis=1)]
    if len(rough) == 0:
        return []
    return [
        f"a sixteenth of this, the interpolation error, exceeds the σ of {len(rough):,} events "
        f"({some_of(exposures.image.take(pa.array(rough)))}): the samples are too far apart for this motion."
    ]


def _outliers(metres: Floats, sigma: Floats) -> Ints:
    """Events (k,) next to a sample that deviates from its prediction by more than usual and than its σ."""
    worst = np.nan_to_num(np.fmax(metres[:, 0], metres[:, 1]))
    length = np.linalg.norm(sigma, axis=1)
    allowed = np.where(np.isfinite(length), _OUTLIER_SIGMAS * length, _OUTLIER_M)
    usual = np.quantile(worst, _USUAL, method="lower")
    return np.flatnonzero((worst > _OUTLIER * usual) & (worst > allowed))


def _about_outliers(image: pa.Array, rows: Ints, metres: Floats) -> list[str]:
    if len(rows) == 0:
        return []
    return [
        f"{len(rows):,} events lie near samples that are inconsistent with their neighbours "
        f"({some_of(image.take(pa.array(rows)))}; up to {np.nanmax(metres):.3g} m): outliers of the "
        "trajectory, or gaps that it does not show."
    ]
