"""The flight as it really was: positions and attitudes around the plan.

Deviations along the flight are deviations of the moment of exposure, so that positions over time keep the
speed; across and in height they are the pilot's. The camera hangs in the aircraft with a crab angle that
belongs to the strip, and every exposure has its own roll, pitch and heading error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.geometry import rotation
from adjust.geometry.earth import LocalFrame
from adjust.simulate.flight_plan import FlightPlan
from adjust.simulate.terrain import raised


@dataclass(frozen=True)
class FlightVariation:
    """Standard deviations of the flight around its plan.

    Attributes
    ----------
    position : along, across, in height, metres.
    attitude : roll, pitch, heading of single exposures, radians.
    crab : heading of a strip against its track, radians.
    rate : of the turning of single exposures about the body axes, radians per second.
    is_path : whether velocities and rates are those of one smooth path through the exposures
        (`adjust.simulate.flown_path`) instead.
    """

    position: tuple[float, float, float] = (3.0, 3.0, 5.0)
    attitude: tuple[float, float, float] = (np.deg2rad(1.0), np.deg2rad(1.0), np.deg2rad(0.5))
    crab: float = np.deg2rad(3.0)
    rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_path: bool = False


@dataclass(frozen=True, eq=False)
class Trajectory:
    """n exposures.

    Attributes
    ----------
    projection_centre : (n, 3) metres, local frame.
    local_from_body : (n, 3, 3) attitude of the inertial unit.
    time : (n,) seconds.
    velocity : (n, 3) m/s, local frame.
    rate : (n, 3) rad/s about the body axes forward, right, down.
    """

    projection_centre: Floats
    local_from_body: Floats
    time: Floats
    velocity: Floats
    rate: Floats


def fly(
    plan: FlightPlan,
    variation: FlightVariation,
    mean_elevation: float,
    frame: LocalFrame,
    random: np.random.Generator,
) -> Trajectory:
    """The flight of a plan over terrain of a mean elevation (metres in the frame's sense)."""
    n = len(plan.images)
    deviation = random.standard_normal((n, 3)) * variation.position
    wobble = random.standard_normal((n, 3)) * variation.attitude
    crab = random.standard_normal(len(plan.strips)) * variation.crab
    forward = np.stack([np.sin(plan.heading), np.cos(plan.heading)], -1)
    right = np.stack([forward[:, 1], -forward[:, 0]], -1)
    place = plan.plan + deviation[:, :1] * forward + deviation[:, 1:2] * right
    centre = raised(place, mean_elevation + plan.height + deviation[:, 2], frame)
    time = plan.time + deviation[:, 0] / plan.speed
    heading = plan.heading + crab[plan.strip] + wobble[:, 2]
    ned_from_body = rotation.ned_from_body(np.stack([heading, wobble[:, 1], wobble[:, 0]], -1))
    local_from_body = frame.local_from_enu(centre) @ rotation.ENU_FROM_NED @ ned_from_body
    rate = random.standard_normal((n, 3)) * variation.rate
    return Trajectory(centre, local_from_body, time, velocities(centre, time, plan.strip), rate)


def velocities(position: Floats, time: Floats, strip: Ints) -> Floats:
    """Velocities (n, 3), m/s: derivatives of the positions by time within each strip.

    Central differences, one-sided at the ends of a strip; zero for a strip of one exposure.
    """
    velocity = np.zeros_like(position)
    for index in np.unique(strip):
        own = np.flatnonzero(strip == index)
        own = own[np.argsort(time[own], kind="stable")]
        if len(own) < 2:
            continue
        velocity[own] = np.gradient(position[own], time[own], axis=0)
    return velocity
