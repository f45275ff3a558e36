"""Flight directions and heights in words."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern
from tasks.remarks.separability import listed


def heading_words(heading: float) -> str:
    """A heading in radians as whole degrees, 0° to 359°."""
    return f"{round(float(np.rad2deg(heading))) % 360}°"


def direction_words(pattern: FlightPattern) -> str:
    """The headings and their relation to each other."""
    headings = [heading_words(angle) for angle in pattern.directions]
    how = ["opposite"] * bool(pattern.opposite) + ["crossing"] * bool(pattern.crossing)
    return f"heading {listed(headings)}" + (f", {listed(how)}" if how else "")


def height_words(pattern: FlightPattern) -> str:
    """The heights above ground, and their ratio."""
    heights = [f"{height:.0f} m" for height in pattern.heights]
    if len(heights) == 1:
        return f"one height ({heights[0]} above ground)"
    return f"{len(heights)} heights ({listed(heights)} above ground, ratio {pattern.height_ratio:.1f})"


def flights_by_height(images: pd.DataFrame, pattern: FlightPattern) -> str | None:
    """What to declare if every flight of images.parquet has only one height; otherwise None.

    With a separate GNSS shift at every height, the focal length cannot be separated from the shifts.
    """
    height = images.groupby("flight")["height_above_ground_m"].median().to_numpy()
    level = np.argmin(np.abs(np.log(height[:, None] / pattern.heights)), axis=1)
    spread = images.groupby("flight")["height_above_ground_m"].agg(lambda own: own.max() / own.min())
    if len(set(level.tolist())) < 2 or (spread > np.sqrt(pattern.height_ratio)).any():
        return None
    names = listed([f"'{name}'" for name in sorted(images["flight"].unique())])
    return (
        f"The flights {names} were each flown at one height, and each has its own GNSS shift, which cannot "
        "be separated from the focal length. If they are parts of one flight with one GNSS solution, "
        "declare it: inputs.exposures.flights.NAME.part_of."
    )
