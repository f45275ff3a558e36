"""A simulated flight as a trajectory processor delivers it: SBET, smrmsg, and the times of the exposures.

The trajectory is that of the antenna: the smooth path with the lever arm, and with the errors that the
exposures were measured with, carried from one exposure to the next. The moments are the exposures' plus the
time offset.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc
from scipy.interpolate import PchipInterpolator

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.geometry.earth import TopocentricFrame
from adjust.parameters import LEVER_ARM, TIME_OFFSET
from adjust.simulate.block import SimulatedBlock
from adjust.simulate.flown_path import FlownPath, flown_path
from tasks.coordinates.local_frame import AdjustmentFrame

# σ of velocities, m/s, which nothing reads.
_SIGMA_VELOCITY = 0.005
_ARC_MINUTE = np.pi / 10_800.0
# Any will do; not zero, so that whoever passes it over is found out.
_WANDER = 0.3
_TIME_DIGITS = 9
# Samples that are computed together.
_PIECE = 50_000


@dataclass(frozen=True, slots=True)
class TrajectoryFiles:
    """Names of the files of one flight."""

    flight: str
    trajectory: str
    accuracy: str
    events: str


def trajectory_files(block: SimulatedBlock) -> tuple[TrajectoryFiles, ...]:
    """The files of each flight."""
    flights = block.truth.plan.flights
    ends = [""] if len(flights) == 1 else [f"_{number}" for number in range(1, len(flights) + 1)]
    return tuple(
        TrajectoryFiles(flight, f"trajectory{end}.sbet", f"smrmsg{end}.out", f"events{end}.csv")
        for flight, end in zip(flights, ends, strict=True)
    )


def write_trajectories(folder: Path, block: SimulatedBlock, frame: AdjustmentFrame, hertz: float) -> None:
    """Write the files of each flight into a folder."""
    assert isinstance(frame, TopocentricFrame)  # the settings refuse others
    for flight, files in enumerate(trajectory_files(block)):
        antenna = _Antenna.of(block, flight)
        first, last = antenna.path.span
        # Samples at whole steps of the clock, as receivers have them.
        time = np.arange(np.ceil(first * hertz), np.floor(last * hertz) + 1.0) / hertz
        with (folder / files.trajectory).open("wb") as stream:
            for begin in range(0, len(time), _PIECE):
                stream.write(_sbet(antenna, frame, time[begin : begin + _PIECE]))
        (folder / files.accuracy).write_bytes(_smrmsg(block, np.arange(np.floor(first), np.ceil(last) + 1.0)))
        _write_events(folder / files.events, block, flight)


@dataclass(frozen=True, slots=True, eq=False)
class _Antenna:
    """The path of the antenna and the attitude of the inertial unit, with their errors over time."""

    path: FlownPath
    lever_arm: Floats
    first: float
    last: float
    _shift: PchipInterpolator
    _turn: PchipInterpolator

    @classmethod
    def of(cls, block: SimulatedBlock, flight: int) -> _Antenna:
        truth, plan, measured = block.truth, block.truth.plan, block.measured
        own = np.flatnonzero(plan.flight == flight)
        own = own[np.argsort(truth.trajectory.time[own], kind="stable")]
        flown, offset = truth.trajectory, float(truth.state.system[TIME_OFFSET][flight, 0])
        attitude, time = flown.local_from_body[own], flown.time[own]
        arm = truth.state.system[LEVER_ARM][0]
        shift = (
            measured.positions[own]
            - flown.projection_centre[own]
            - attitude @ arm
            - offset * flown.velocity[own]
        )
        later = attitude @ rotation.exp(flown.rate[own] * offset)
        turn = rotation.log(np.swapaxes(later, 1, 2) @ measured.local_from_body[own])
        return cls(
            flown_path(plan, flown, flight),
            arm,
            float(time[0]),
            float(time[-1]),
            PchipInterpolator(time, shift),
            PchipInterpolator(time, turn),
        )

    def pose(self, time: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Positions, velocities (n, 3), attitudes (n, 3, 3), rates (n, 3), local frame."""
        within = np.clip(time, self.first, self.last)
        moving = ((time > self.first) & (time < self.last))[:, None]
        true, rate = self.path.local_from_body(time), self.path.rate(time)
        position = self.path.position(time) + true @ self.lever_arm + self._shift(within)
        velocity = self.path.velocity(time) + moving * self._shift(within, 1)
        velocity += np.einsum("nij,nj->ni", true, np.cross(rate, self.lever_arm))
        error = rotation.exp(self._turn(within))
        rate = np.einsum("nji,nj->ni", error, rate) + moving * self._turn(within, 1)
        return position, velocity, true @ error, rate


def _sbet(antenna: _Antenna, frame: TopocentricFrame, time: Floats) -> bytes:
    position, velocity, attitude, rate = antenna.pose(time)
    geodetic = frame.to_geodetic(position)
    local_from_ned = frame.local_from_enu(position) @ rotation.ENU_FROM_NED
    north, east, down = np.einsum("nji,nj->in", local_from_ned, velocity)
    heading, pitch, roll = rotation.to_heading_pitch_roll(np.swapaxes(local_from_ned, 1, 2) @ attitude).T
    wander = _WANDER + (geodetic[:, 1] - frame.longitude) * np.sin(geodetic[:, 0])
    sine, cosine = np.sin(wander), np.cos(wander)
    columns = [
        time, *geodetic.T,
        north * cosine - east * sine, -north * sine - east * cosine, -down,
        roll, pitch, (heading + wander) % (2.0 * np.pi), wander,
        *np.zeros((3, len(time))),  # accelerations, which nothing reads
        *rate.T,
    ]  # fmt: skip
    return np.column_stack(columns).astype("<f8").tobytes()


def _smrmsg(block: SimulatedBlock, time: Floats) -> bytes:
    """The stated standard deviations, the same at all times."""
    noise = block.specification.noise
    east, north, up = noise.stated_gnss
    roll, pitch, heading = noise.stated_ins / _ARC_MINUTE
    row = [north, east, up, *(_SIGMA_VELOCITY,) * 3, roll, pitch, heading]
    return np.column_stack([time, np.tile(row, (len(time), 1))]).astype("<f8").tobytes()


def _write_events(path: Path, block: SimulatedBlock, flight: int) -> None:
    """events.csv: the exposures in order of time."""
    plan, truth = block.truth.plan, block.truth
    own = np.flatnonzero(plan.flight == flight)
    own = own[np.argsort(truth.trajectory.time[own], kind="stable")]
    time = truth.trajectory.time[own] + truth.state.system[TIME_OFFSET][flight, 0]
    columns = {
        "image": [plan.images[row] for row in own],
        "time": np.round(time, _TIME_DIGITS),
        "camera": [block.specification.cameras[plan.camera[row]].name for row in own],
        "strip": [plan.strips[plan.strip[row]] for row in own],
    }
    options = pc.WriteOptions(quoting_style="none", quoting_header="none")
    pc.write_csv(pa.table(columns), path, options)
