"""Proposals in words, and as numbers that can be put into a flight plan."""

from __future__ import annotations

import numpy as np

from adjust.planning.additions import Addition, ProposedLines
from tasks.calibration.pattern_words import heading_words
from tasks.files.json_text import JSON
from tasks.remarks.separability import listed


def addition_words(addition: Addition) -> str:
    """What to fly and survey in addition."""
    parts = [_lines(group) for group in addition.groups]
    if addition.control:
        parts.append(f"{addition.control} more control points")
    return listed(parts)


def addition_json(addition: Addition, images: int) -> JSON:
    """The same with every strip: start and end in the local frame of the adjustment, metres.

    Parameters
    ----------
    images : that are taken at its exposures, by all heads of a rig.
    """
    return {
        "words": addition_words(addition),
        "exposures": addition.exposures,
        "images": images,
        "control_points": addition.control,
        "strips": [
            {
                "heading_deg": round(float(np.rad2deg(strip.heading)) % 360.0, 1),
                "height_above_ground_m": round(float(strip.height), 1),
                "exposures": len(strip.plan),
                "first_m": [round(float(value), 1) for value in strip.plan[0]],
                "last_m": [round(float(value), 1) for value in strip.plan[-1]],
            }
            for strip in addition.strips
        ],
    }


def _lines(group: ProposedLines) -> str:
    height = f"{10.0 * round(group.height / 10.0):.0f} m"
    if group.what == "again":
        return "all lines again"
    lines = f"{group.lines} line{'s' if group.lines > 1 else ''}"
    if group.what == "back":
        return f"the {lines} at {height} also flown back" if group.lines > 1 else f"the line at {height} back"
    exposures = len(group.strips[0].plan)
    across = " across" if group.what == "across" else ""
    ways = ", there and back" if group.both_ways else ""
    ways += {1: "", 2: ", twice"}.get(group.times, f", {group.times} times")
    heading = heading_words(group.heading)
    return f"{lines}{across} at {height}, heading {heading}, of {exposures} exposures{ways}"
