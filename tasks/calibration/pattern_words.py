"""Flight directions and heights in words."""

from __future__ import annotations

import numpy as np

from adjust.calibration.flight_pattern import FlightPattern
from tasks.block.separability import listed


def heading_words(heading: float) -> str:
    """A heading in radians as whole degrees, 0° to 359°."""
    return f"{round(float(np.rad2deg(heading))) % 360}°"


def direction_words(pattern: FlightPattern) -> str:
    """The headings, and how they lie to each other."""
    headings = [heading_words(angle) for angle in pattern.directions]
    how = ["opposite"] * bool(pattern.opposite) + ["crossing"] * bool(pattern.crossing)
    return f"heading {listed(headings)}" + (f", {listed(how)}" if how else "")


def height_words(pattern: FlightPattern) -> str:
    """The heights above ground, and their ratio."""
    heights = [f"{height:.0f} m" for height in pattern.heights]
    if len(heights) == 1:
        return f"one height ({heights[0]} above ground)"
    return f"{len(heights)} heights ({listed(heights)} above ground, ratio {pattern.height_ratio:.1f})"
