"""The lines of a network, as far as a proposal needs to know them: where, how high, in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
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
    """All strips of a network."""
    exposures, heights, headings = network.exposures, network.height_above_ground, network.heading
    lines = []
    for strip in np.unique(exposures.strip):
        own = np.flatnonzero(exposures.strip == strip)
        own = own[np.argsort(exposures.time[own], kind="stable")]
        plan = exposures.projection_centre[own, :2]
        way = plan[-1] - plan[0]
        mean = np.arctan2(np.sin(headings[own]).mean(), np.cos(headings[own]).mean())
        heading = float(np.arctan2(way[0], way[1])) if len(own) > 1 else float(mean)
        lines.append(FlownLine(int(strip), own, heading, float(np.median(heights[own])), plan))
    return tuple(lines)


def without_return(lines: tuple[FlownLine, ...]) -> tuple[FlownLine, ...]:
    """The lines that nobody flew back: none of the opposite direction lies over them at their height."""
    return tuple(line for line in lines if not any(_is_return(line, other) for other in lines))


def _is_return(line: FlownLine, other: FlownLine) -> bool:
    opposite = np.cos(line.heading - other.heading) < -np.cos(np.deg2rad(15.0))
    if not opposite or abs(other.height - line.height) > 0.1 * line.height:
        return False
    # Nearer than a line spacing can be with any side lap.
    return abs(line.across(other.plan.mean(axis=0))) < 0.1 * line.height
