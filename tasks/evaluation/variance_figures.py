"""Variance components and correlation times as figures, and in the σ of the control points."""

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
from tasks.results.figures import ComponentFigure, CorrelationTimeFigure, VarianceFigures


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
    """The median σ only where all components have one unit: those of known calibrations have several."""
    group = result.groups[component.part.group].group
    units = {reported_unit_of(group, number) for number in component.part.components}
    unit, factor = units.pop() if len(units) == 1 else ("", float("nan"))
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
    rows: list[JSON] = [
        _correlation_row(name, seconds, estimated.get(name)).to_json()
        for name, seconds in stated_s.items()
        if seconds is not None and name in observed
    ]
    return rows or None


def _correlation_row(group: str, stated_s: float, item: CorrelationTime | None) -> CorrelationTimeFigure:
    if item is None or item.verdict == "stated":
        seconds = stated_s if item is None else item.seconds
        return CorrelationTimeFigure(
            group=group,
            stated_s=stated_s,
            correlation_s=seconds,
            verdict="stated",
            tested=item is not None,
        )
    return CorrelationTimeFigure(
        group=group,
        stated_s=stated_s,
        correlation_s=item.seconds,
        lower_s=item.lower,
        upper_s=item.upper if isfinite(item.upper) else None,
        verdict=item.verdict,
        tested=True,
    )


def with_estimated_sigmas(surveyed: SurveyedPoints, result: AdjustmentResult) -> SurveyedPoints:
    """Control points with the standard deviations that the adjustment gave them; check points as stated."""
    factors = np.ones(3)
    for component in result.variance_components:
        if result.groups[component.part.group].group.name == ControlPoints.name:
            factors[list(component.part.components)] = component.factor
    of_points = np.where(surveyed.is_check[:, None], 1.0, factors)
    covariance = surveyed.covariance * of_points[:, :, None] * of_points[:, None, :]
    return replace(surveyed, covariance=covariance)
