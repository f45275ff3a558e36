"""Means of strips as flights with errors of GNSS and INS would show them, without exposures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adjust.calibration.mountings import MountingRule
from adjust.calibration.strip_means import StripMeans, direction_groups
from adjust.calibration.strip_offsets import body_fixed

#: Limits and strip errors of the default settings.
RULE = MountingRule(
    0.01,
    np.append(np.deg2rad([0.0005, 0.0005, 0.001]), 0.03),
    np.append(np.deg2rad([0.003, 0.003, 0.008]), 0.03),
)
BACK_AND_FORTH = (0.0, 180.0, 90.0, 270.0)
FORWARD, RIGHT = 3, 4


def strips_flown(
    random: np.random.Generator,
    flights: Sequence[int] = (8, 8),
    headings_deg: Sequence[float] = BACK_AND_FORTH,
    *,
    attitude_deg: Sequence[float] = (0.0005, 0.0005, 0.0015),
    position_m: float = 0.03,
    correlation: float = 0.0,
    lever_arm: Sequence[float] = (0.0, 0.0),
    shifts: Sequence[Sequence[float]] = ((0.2, -0.1), (-0.3, 0.15), (0.0, 0.4)),
) -> StripMeans:
    """Strips of some flights, each with its own GNSS shift.

    Parameters
    ----------
    flights : strips of each.
    attitude_deg, position_m : σ of the errors of a strip.
    correlation : of the errors of strips that follow each other in a flight.
    lever_arm : forward, right, that is not given.
    """
    flight = np.repeat(np.arange(len(flights)), flights)
    count = len(flight)
    heading = np.deg2rad(np.resize(headings_deg, count)) + random.normal(0.0, 0.01, count)
    errors = random.normal(size=(count, 6))
    for k in range(1, count):
        if flight[k] == flight[k - 1]:
            errors[k] = correlation * errors[k - 1] + np.sqrt(1.0 - correlation**2) * errors[k]
    misalignment = errors[:, :3] * np.deg2rad(attitude_deg)
    turn = body_fixed(heading, np.arange(count))
    in_map = errors[:, 3:5] * position_m + np.array(shifts)[flight]
    in_map += (turn @ np.tile(lever_arm, count)).reshape(-1, 2)
    in_body = (turn.T @ in_map.ravel()).reshape(-1, 2)
    height = errors[:, 5:] * position_m
    mean = np.hstack([misalignment, in_body, -height, in_map, height])
    nothing = np.full((count, 9), np.nan)
    return StripMeans(
        np.arange(count),
        flight,
        np.arange(count, dtype=np.float64),
        np.full(count, 30),
        mean,
        nothing,
        nothing,
        nothing,
        nothing,
        heading,
        np.full(count, 2000.0),
        direction_groups(heading),
        np.zeros(count, dtype=np.int64),
    )


def remounted(
    strips: StripMeans, chosen: np.ndarray, angles_deg: Sequence[float], plan_m: Sequence[float]
) -> None:
    """Turn and move the camera in some strips: roll, pitch, yaw; forward, right."""
    strips.mean[chosen, :3] += np.deg2rad(angles_deg)
    strips.mean[chosen, FORWARD:5] += plan_m
    turn = body_fixed(strips.heading, np.arange(len(chosen)))
    moved = (turn @ np.where(chosen[:, None], plan_m, 0.0).ravel()).reshape(-1, 2)
    strips.mean[:, 6:8] += moved
