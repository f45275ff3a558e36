"""The lines of a network, as far as a proposal needs to know them: where, how high, in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.calibration.strip_means import direction_groups, height_groups
from adjust.planning.network import PlannedNetwork


@dataclass(frozen=True, eq=False)
class FlownLine:
    """One strip.

    Attributes
    ----------
    strip : its number.
    exposures : (k,) indices in the order they were flown.
    heading : of the track (of the aircraft with one exposure), radians.
    height : median above ground, metres.
    plan : (k, 2) metres, local frame.
    """

    strip: int
    exposures: Ints
    heading: float
    height: float
    plan: Floats

    @property
    def base(self) -> float:
        """Median distance of neighbouring exposures, metres; NaN with one."""
        if len(self.plan) < 2:
            return float("nan")
        return float(np.median(np.hypot(*np.diff(self.plan, axis=0).T)))

    def across(self, place: Floats) -> float:
        """Distance of a place (2,) from the line through this one's middle, metres, to the right positive."""
        right = np.array([np.cos(self.heading), -np.sin(self.heading)])
        return float((place - self.plan.mean(axis=0)) @ right)


def flown_lines(network: PlannedNetwork) -> tuple[FlownLine, ...]:
    """All strips of a network; what is called a strip but has several directions is taken apart by them."""
    exposures, heights, headings = network.exposures, network.height_above_ground, network.heading
    lines = []
    for strip in np.unique(exposures.strip):
        own = np.flatnonzero(exposures.strip == strip)
        own = own[np.argsort(exposures.time[own], kind="stable")]
        parts = _parts(headings[own], heights[own])
        for part in np.unique(parts):
            rows = own[parts == part]
            plan = exposures.projection_centre[rows, :2]
            way = plan[-1] - plan[0]
            mean = np.arctan2(np.sin(headings[rows]).mean(), np.cos(headings[rows]).mean())
            is_line = len(rows) > 1 and parts.max() == 0
            heading = float(np.arctan2(way[0], way[1])) if is_line else float(mean)
            lines.append(FlownLine(int(strip), rows, heading, float(np.median(heights[rows])), plan))
    return tuple(lines)


def _parts(heading: Floats, height: Floats) -> Ints:
    """Which exposures (k,) of a strip belong together: all, unless they have several directions."""
    direction = direction_groups(heading)
    if direction.max() == 0:
        return direction
    level = height_groups(height)
    return np.asarray(direction * (level.max() + 1) + level)


def without_return(lines: tuple[FlownLine, ...]) -> tuple[FlownLine, ...]:
    """The lines that nobody flew back: none of the opposite direction lies over them at their height."""
    return tuple(line for line in lines if not any(_is_return(line, other) for other in lines))


def _is_return(line: FlownLine, other: FlownLine) -> bool:
    opposite = np.cos(line.heading - other.heading) < -np.cos(np.deg2rad(15.0))
    if not opposite or abs(other.height - line.height) > 0.1 * line.height:
        return False
    # Nearer than a line spacing can be with any side lap.
    return abs(line.across(other.plan.mean(axis=0))) < 0.1 * line.height
