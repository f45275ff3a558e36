"""Variance components and correlation times as figures, in sentences, and in the σ of the control points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite

import numpy as np

from adjust.observations.control_point import ControlPoints
from adjust.quality.correlation_time import CorrelationTime
from adjust.quality.variance_components import VarianceComponent
from adjust.result import AdjustmentResult
from tasks.block.block_input import SurveyedPoints
from tasks.evaluation.result_tables import reported_unit_of
from tasks.files.json_text import JSON
from tasks.results.figures import ComponentFigure, VarianceFigures


def variance_figures(result: AdjustmentResult) -> JSON:
    """A row for each part of the observations, and how often they were weighted again; null without."""
    if not result.variance_components:
        return None
    return VarianceFigures(
        rounds=result.reweighted,
        confidence=result.test.confidence,
        components=tuple(_row(result, component) for component in result.variance_components),
    ).to_json()


def _row(result: AdjustmentResult, component: VarianceComponent) -> ComponentFigure:
    unit, factor = reported_unit_of(result.groups[component.part.group].group)
    return ComponentFigure(
        part=component.part.name,
        estimated=component.estimated,
        factor=component.factor,
        factor_lower=component.lower,
        factor_upper=component.upper,
        sigma=component.sigma * factor,
        unit=unit,
        redundancy=component.redundancy,
        degrees_of_freedom=component.degrees_of_freedom,
    )


def correlation_figures(result: AdjustmentResult, stated_s: Mapping[str, float | None]) -> JSON:
    """A row for each group whose errors are correlated over time; null without any.

    Parameters
    ----------
    stated_s : group → the correlation time of the project, s.
    """
    estimated = {item.name: item for item in result.correlation_times}
    observed = {group.group.name for group in result.groups}
    rows: list[JSON] = []
    for name, seconds in stated_s.items():
        if seconds is None or name not in observed:
            continue
        item = estimated.get(name)
        verdict = "stated" if item is None else item.verdict
        known = item is not None and verdict != "stated"
        rows.append(
            {
                "group": name,
                "stated_s": seconds,
                "correlation_s": seconds if item is None else item.seconds,
                "lower_s": item.lower if item is not None and known else None,
                "upper_s": item.upper if item is not None and known and isfinite(item.upper) else None,
                "verdict": verdict,
            }
        )
    return rows or None


def correlation_sentences(result: AdjustmentResult, stated_s: Mapping[str, float | None]) -> list[str]:
    """Findings on correlation times: different from the stated ones, none, or not determinable."""
    return [
        sentence
        for item in result.correlation_times
        if (sentence := _about_correlation(item, stated_s.get(item.name))) is not None
    ]


def _about_correlation(item: CorrelationTime, stated_s: float | None) -> str | None:
    """One sentence about a correlation time; None where it is as stated."""
    whose = f"the errors of {item.name.replace('_', ' ')}"
    if item.verdict == "stated":
        return (
            f"There is too little redundancy to estimate the correlation time of {whose}; it stays at "
            f"{item.seconds:.3g} s."
        )
    if item.verdict == "undetermined":
        return f"The residuals do not show whether {whose} are correlated over time."
    if item.verdict == "none":
        return (
            f"The residuals show no correlation over time in {whose} (correlation time below "
            f"{item.upper:.3g} s); the adjustment uses {item.seconds:.3g} s."
        )
    if item.verdict == "longer":
        return (
            f"The correlation time of {whose} cannot be determined. It is longer than {item.lower:.3g} s, as "
            f"a bias of each strip would be; the adjustment uses {item.seconds:.3g} s."
        )
    if stated_s is not None and item.lower <= stated_s <= item.upper:
        return None
    stated = "" if stated_s is None else f", not {stated_s:.3g} s as stated"
    return (
        f"The correlation time of {whose} is {item.seconds:.3g} s ({item.lower:.3g} to {item.upper:.3g} s)"
        f"{stated}; the adjustment uses it."
    )


def variance_sentences(result: AdjustmentResult) -> list[str]:
    """What the user should know: stated σ outside their intervals, and parts that kept what was stated."""
    sentences = []
    for component in result.variance_components:
        if component.estimated and not component.lower <= 1.0 <= component.upper:
            unit, factor = reported_unit_of(result.groups[component.part.group].group)
            part = part_words(component.part.name)
            sentences.append(
                f"The stated σ of {part} do not agree with the residuals: they are "
                f"{component.factor:.2f} ({component.lower:.2f} to {component.upper:.2f}) times as large, "
                f"in the median {component.sigma * factor:.3g} {unit}; the adjustment uses these."
            )
    kept = [part_words(item.part.name) for item in result.variance_components if not item.estimated]
    if kept:
        sentences.append(
            f"There is too little redundancy to estimate the σ of {', '.join(kept)}; they remain as stated."
        )
    return sentences


def part_words(part: str) -> str:
    """A part of the observations in words: ``GNSS positions in height of flight 2``."""
    part, joint, origin = part.partition(" of ")
    group, _, components = part.partition(" ")
    words = group.replace("_", " ").replace("prior:", "the priors of ").replace(":", " ")
    words = words.replace("gnss", "GNSS").replace("ins ", "INS ")
    what = f"{words} in {components}" if components in ("plan", "height") else f"{words} {components}".strip()
    return f"{what}{joint}{origin}"


def with_estimated_sigmas(surveyed: SurveyedPoints, result: AdjustmentResult) -> SurveyedPoints:
    """Control points with the standard deviations that the adjustment gave them; check points as stated."""
    factors = np.ones(3)
    for component in result.variance_components:
        if result.groups[component.part.group].group.name == ControlPoints.name:
            factors[list(component.part.components)] = component.factor
    of_points = np.where(surveyed.is_check[:, None], 1.0, factors)
    covariance = surveyed.covariance * of_points[:, :, None] * of_points[:, None, :]
    return replace(surveyed, covariance=covariance)
