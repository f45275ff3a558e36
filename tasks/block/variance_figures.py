"""Variance components as figures, in sentences, and in the standard deviations of the control points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.observations.control_point import ControlPoints
from adjust.quality.variance_components import VarianceComponent
from adjust.result import AdjustmentResult
from tasks.block.block_input import SurveyedPoints
from tasks.block.result_tables import reported_unit_of
from tasks.storage.json_text import JSON


def variance_figures(result: AdjustmentResult) -> JSON:
    """A row for each part of the observations, and how often they were weighted anew; null without."""
    if not result.variance_components:
        return None
    return {
        "rounds": result.reweighted,
        "confidence": result.test.confidence,
        "components": [_row(result, component) for component in result.variance_components],
    }


def _row(result: AdjustmentResult, component: VarianceComponent) -> JSON:
    unit, factor = reported_unit_of(result.groups[component.part.group].group)
    return {
        "part": component.part.name,
        "estimated": component.estimated,
        "factor": component.factor,
        "factor_lower": component.lower,
        "factor_upper": component.upper,
        "sigma": component.sigma * factor,
        "unit": unit,
        "redundancy": component.redundancy,
        "degrees_of_freedom": component.degrees_of_freedom,
    }


def variance_sentences(result: AdjustmentResult) -> list[str]:
    """What the user should know: stated σ outside their intervals, and parts that kept what was stated."""
    sentences = []
    for component in result.variance_components:
        if component.estimated and not component.lower <= 1.0 <= component.upper:
            unit, factor = reported_unit_of(result.groups[component.part.group].group)
            sentences.append(
                f"The stated σ of {_in_words(component)} do not agree with the residuals: they are "
                f"{component.factor:.2f} ({component.lower:.2f} to {component.upper:.2f}) times as large, in "
                f"the median {component.sigma * factor:.3g} {unit}; the adjustment uses these."
            )
    kept = [_in_words(item) for item in result.variance_components if not item.estimated]
    if kept:
        sentences.append(
            f"Too little redundancy to estimate the σ of {', '.join(kept)}: they stay as stated."
        )
    return sentences


def _in_words(component: VarianceComponent) -> str:
    return component.part.name.replace("_", " ").replace("prior:", "the priors of ").replace(":", " ")


def with_estimated_sigmas(surveyed: SurveyedPoints, result: AdjustmentResult) -> SurveyedPoints:
    """Control points with the standard deviations that the adjustment gave them; check points as stated."""
    factors = np.ones(3)
    for component in result.variance_components:
        if result.groups[component.part.group].group.name == ControlPoints.name:
            factors[list(component.part.components)] = component.factor
    of_points = np.where(surveyed.is_check[:, None], 1.0, factors)
    covariance = surveyed.covariance * of_points[:, :, None] * of_points[:, None, :]
    return replace(surveyed, covariance=covariance)
