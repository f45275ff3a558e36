"""Whether the declared mounting fits the direction of flight.

Collinearity does not notice how the camera is mounted; only body axes (boresight, lever arm) do. The
track of a strip, from one exposure to the next, shows where forward is.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from tasks.block.given_orientations import GivenOrientations

# Crab angles stay below this; a mounting that is wrong is wrong by a quarter turn.
_CRAB_DEG = 25.0


def check_flight_direction(given: GivenOrientations) -> list[str]:
    """A sentence if the strips are flown a quarter or half turn off the declared forward axis.

    Strips are taken in the order of time, or of the image names where there is no time. A half turn
    is named only if all strips show it, because names may count against the flight.
    """
    headings = given.headings()
    quarters = [_quarter(given, headings, number) for number, strip in enumerate(given.strips) if strip]
    known = [quarter for quarter in quarters if quarter is not None]
    if len(known) == 0:
        return []
    sideways = [quarter for quarter in known if quarter % 2 == 1]
    timed = bool(np.isfinite(given.time_s).all())
    if len(sideways) > 0.5 * len(known):
        turn = "90° or 270°" if not timed else f"{90 * max(set(sideways), key=sideways.count)}°"
    elif known.count(2) == len(known) and (timed or len(known) > 1):
        turn = "180°"
    else:
        return []
    return [
        f"The direction of flight is {turn} off the forward axis that mount_deg declares (in "
        f"{len(known)} strips): check mount_deg of the camera. Otherwise boresight and lever arm are "
        "reported in wrong axes."
    ]


def _quarter(given: GivenOrientations, headings: Floats, strip: int) -> int | None:
    """Quarter turns from the forward axis to the track of a strip; None if it is too short or unclear."""
    index = np.flatnonzero(given.strip_of_image == strip)
    if len(index) < 3:
        return None
    if np.isfinite(given.time_s[index]).all():
        index = index[np.argsort(given.time_s[index], kind="stable")]
    step = np.diff(given.observed[index], axis=0)
    # The heads of a rig are exposed in one place.
    moved = np.flatnonzero(step[:, :2].any(axis=1))
    if not len(moved):
        return None
    track = np.arctan2(step[moved, 0], step[moved, 1])
    difference: Floats = np.rad2deg(track - headings[index[moved]])
    turn = np.rad2deg(np.angle(np.mean(np.exp(1j * np.deg2rad(difference))))) % 360.0
    quarter = round(turn / 90.0)
    return quarter % 4 if abs(turn - 90.0 * quarter) < _CRAB_DEG else None
