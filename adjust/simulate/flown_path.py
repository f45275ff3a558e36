"""The flight between its exposures: one smooth path through them, with turns between the strips.

Positions and the angles heading, pitch, roll about the axes of the local frame are cubic splines over time:
their derivatives are the velocities and the rates of the body. A strip is entered and left straight and
level; between two strips lies a turn with its bank. Before the first and after the last exposure the flight
goes straight on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.simulate.flight_plan import FlightPlan
from adjust.simulate.trajectory import Trajectory

#: How long the flight is recorded before its first exposure and after its last one, seconds.
RECORDED = 20.0
# Straight and level at either end of a strip, seconds; bank in a turn, radians.
_LEVEL, _BANK = 5.0, np.deg2rad(20.0)


@dataclass(frozen=True, slots=True, eq=False)
class FlownPath:
    """The path of one flight over time, in the local frame.

    Attributes
    ----------
    span : first and last time, seconds.
    """

    span: tuple[float, float]
    _position: CubicSpline
    _angles: CubicSpline

    def position(self, time: Floats) -> Floats:
        """Projection centres (n, 3), metres."""
        return np.asarray(self._position(time))

    def velocity(self, time: Floats) -> Floats:
        """Velocities (n, 3), m/s."""
        return np.asarray(self._position(time, 1))

    def local_from_body(self, time: Floats) -> Floats:
        """Attitudes (n, 3, 3)."""
        return np.asarray(rotation.ENU_FROM_NED @ rotation.ned_from_body(self._angles(time)))

    def rate(self, time: Floats) -> Floats:
        """Rates (n, 3) of the body about its axes forward, right, down, rad/s."""
        _, pitch, roll = self._angles(time).T
        heading_rate, pitch_rate, roll_rate = self._angles(time, 1).T
        return np.column_stack(
            [
                roll_rate - heading_rate * np.sin(pitch),
                pitch_rate * np.cos(roll) + heading_rate * np.cos(pitch) * np.sin(roll),
                heading_rate * np.cos(pitch) * np.cos(roll) - pitch_rate * np.sin(roll),
            ]
        )


def flown_path(plan: FlightPlan, flown: Trajectory, flight: int) -> FlownPath:
    """The path of a flight through its exposures."""
    own = np.flatnonzero(plan.flight == flight)
    own = own[np.argsort(flown.time[own], kind="stable")]
    angles = rotation.to_heading_pitch_roll(rotation.ENU_FROM_NED.T @ flown.local_from_body[own])
    angles[:, 0] = np.unwrap(angles[:, 0])
    knots = _Knots([], [], [])
    last = len(own) - 1
    for row, exposure in enumerate(own):
        course = _course(plan, exposure)
        time, place, heading = float(flown.time[exposure]), flown.projection_centre[exposure], angles[row, 0]
        enters = row == 0 or plan.strip[own[row - 1]] != plan.strip[exposure]
        leaves = row == last or plan.strip[own[row + 1]] != plan.strip[exposure]
        if enters:
            lead = RECORDED if row == 0 else _LEVEL
            knots.add(time - lead, place - lead * course, (heading, 0.0, 0.0))
        knots.add(time, place, tuple(angles[row]))
        if leaves:
            lag = RECORDED if row == last else _LEVEL
            knots.add(time + lag, place + lag * course, (heading, 0.0, 0.0))
        if leaves and row < last:
            knots.turn(0.5 * (time + float(flown.time[own[row + 1]])), heading, angles[row + 1, 0])
    return knots.path()


def along_the_path(plan: FlightPlan, flown: Trajectory) -> Trajectory:
    """The same exposures with the velocities and rates of the smooth paths through them."""
    velocity, rate = np.zeros_like(flown.velocity), np.zeros_like(flown.rate)
    for flight in range(len(plan.flights)):
        path, own = flown_path(plan, flown, flight), plan.flight == flight
        velocity[own], rate[own] = path.velocity(flown.time[own]), path.rate(flown.time[own])
    return replace(flown, velocity=velocity, rate=rate)


def _course(plan: FlightPlan, exposure: np.integer) -> Floats:
    """Planned velocity (3,), m/s."""
    heading = plan.heading[exposure]
    return np.asarray(plan.speed[exposure] * np.array([np.sin(heading), np.cos(heading), 0.0]))


@dataclass(frozen=True, slots=True, eq=False)
class _Knots:
    """Times, positions and angles that a path goes through; a turn has angles only."""

    time: list[float]
    position: list[Floats | None]
    angles: list[tuple[float, ...]]

    def add(self, time: float, position: Floats | None, angles: tuple[float, ...]) -> None:
        self.time.append(time)
        self.position.append(position)
        self.angles.append(angles)

    def turn(self, time: float, heading: float, next_heading: float) -> None:
        turned = next_heading - heading
        self.add(time, None, (heading + 0.5 * turned, 0.0, _BANK * np.sign(turned)))

    def path(self) -> FlownPath:
        of_places = [(t, p) for t, p in zip(self.time, self.position, strict=True) if p is not None]
        return FlownPath(
            (self.time[0], self.time[-1]),
            CubicSpline([t for t, _ in of_places], np.array([p for _, p in of_places])),
            CubicSpline(self.time, np.array(self.angles)),
        )
