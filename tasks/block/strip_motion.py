"""Time and velocity of exposures along their strips."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.gnss_position import StripMotion
from tasks.block.given_orientations import GivenOrientations
from tasks.errors import InputError
from tasks.settings.adjustment import AdjustmentSettings


def strip_motion(given: GivenOrientations) -> StripMotion:
    """Strip, time since its middle and velocity of every exposure.

    The velocity is the derivative of the observed positions by time (central differences, one-sided at
    the ends of a strip); times and velocities are zero where the delivery has no times.
    """
    since, velocity = np.zeros(len(given.image)), np.zeros_like(given.observed)
    strip = given.strip_of_image
    for index in strips_in_time(strip, given.time_s):
        time = given.time_s[index]
        since[index] = time - 0.5 * (time[0] + time[-1])
        if len(index) > 1:
            velocity[index] = np.gradient(given.observed[index], time, axis=0)
    return StripMotion(strip, since, velocity)


def strips_in_time(strip: Ints, time: Floats) -> list[Ints]:
    """Indices of the exposures of each strip in the order of time; strips without times are left out."""
    order = np.lexsort((time, strip))
    parts = np.split(order, np.flatnonzero(np.diff(strip[order])) + 1)
    return [part for part in parts if np.isfinite(time[part]).all()]


def require_motion(given: GivenOrientations, settings: AdjustmentSettings) -> None:
    """Refuse parameters of strips and times where the delivery has neither.

    Raises
    ------
    InputError
        If a strip bias or drift is free without strips, or a drift or time offset without times.
    """
    for parameter in ("gnss_strip_bias", "gnss_drift"):
        if parameter in settings.free and not all(given.strip):
            raise InputError(
                "The exposures name no strips.",
                "Add a strip column to the exposures, or take it out of adjustment.free.",
                entity=f"adjustment.free = {parameter}",
            )
    for parameter in ("gnss_drift", "time_offset"):
        if parameter in settings.free and not np.isfinite(given.time_s).all():
            raise InputError(
                "The exposures have no times.",
                "Add a time column (seconds) to the exposures, or take it out of adjustment.free.",
                entity=f"adjustment.free = {parameter}",
            )
