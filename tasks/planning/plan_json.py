"""A plan as JSON, what ``aerocal plan --json`` prints, and its proposals in words."""

from __future__ import annotations

import numpy as np

from adjust.planning.additions import Addition, ProposedLines
from tasks.calibration.pattern_words import heading_words
from tasks.calibration.verdicts import ParameterVerdict
from tasks.files.json_text import JSON, attributes
from tasks.planning.plan import CalibrationPlan, Expectation, Proposal
from tasks.quantities import is_calibrated
from tasks.remarks.separability import listed


def plan_json(plan: CalibrationPlan) -> JSON:
    """Everything a plan has found."""
    here, cheapest = plan.expectation, plan.cheapest
    return {
        "name": plan.name,
        **attributes(here.flight, "verdict", "reasons", "remarks"),
        "free": list(plan.request.free),
        "additional": plan.request.self_calibration.parameters,
        "strip_bias_m": plan.request.strip_bias_m,
        "limits": plan.request.limits.model_dump(mode="json"),
        "network": {
            "exposures": here.exposures,
            "images": here.images,
            "strips": here.strips,
            "object_points": here.points,
            "image_points": here.rays,
            "control_points": here.control,
        },
        "pattern": _pattern(here),
        "parameters": [_parameter(item, here) for item in here.quantities],
        "correlations": _correlations(here),
        "cheapest": None if cheapest is None else _proposal(cheapest, here),
        "proposals": [_proposal(proposal, here) for proposal in plan.proposals],
    }


def _pattern(here: Expectation) -> JSON:
    pattern = here.pattern
    return {
        "headings_deg": [round(float(angle), 1) for angle in np.rad2deg(pattern.directions)],
        "opposite": len(pattern.opposite) > 0,
        "crossing": len(pattern.crossing) > 0,
        "heights_m": [round(float(height), 1) for height in pattern.heights],
        "height_ratio": round(pattern.height_ratio, 3),
        "images": pattern.images.tolist(),
        "strips": pattern.strips.tolist(),
    }


def _parameter(item: ParameterVerdict, here: Expectation) -> JSON:
    table = here.parameters
    row = table[(table["parameter"] == item.parameter) & (table["entity"] == item.entity)].iloc[0]
    return {
        **attributes(item, "parameter", "entity", "sigma", "limit", "sigma_over_prior", "verdict", "because"),
        "unit": str(row["unit"]),
        "strongest_correlation": None
        if item.strongest is None
        else attributes(item.strongest, "parameter", "entity", "correlation"),
    }


def _correlations(here: Expectation) -> JSON:
    """Of the quantities of the calibration with each other."""
    table = here.correlations
    kept = table[table["parameter_a"].map(is_calibrated) & table["parameter_b"].map(is_calibrated)]
    names = ("parameter_a", "entity_a", "parameter_b", "entity_b")
    return [
        {**{name: str(row[name]) for name in names}, "correlation": float(row["correlation"])}
        for row in kept.to_dict("records")
    ]


def _proposal(proposal: Proposal, here: Expectation) -> JSON:
    expectation = proposal.expectation
    return {
        "addition": _addition_json(proposal.addition, expectation.images - here.images),
        **attributes(expectation.flight, "verdict", "reasons"),
        "worst": {
            **attributes(expectation.worst, "parameter", "entity"),
            "sigma_over_limit": expectation.worst_part,
        },
        "sigmas": {f"{item.parameter} of {item.entity}": item.sigma for item in expectation.quantities},
    }


def addition_words(addition: Addition) -> str:
    """What to fly and survey in addition."""
    parts = [_lines(group) for group in addition.groups]
    if addition.control:
        parts.append(f"{addition.control} more control points")
    return listed(parts)


def _addition_json(addition: Addition, images: int) -> JSON:
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
