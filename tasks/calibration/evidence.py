"""All evidence against a calibration besides its σ: reasons to refuse it or to restrict its use.

A standard deviation states how well a parameter is determined if the model is right. Whether it is right is
shown by the tests of the model, the second step, the check points, the residuals of every group of
observations, the rejections, suspicions about the deliveries, and the project's own gates.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy import special

from tasks.document_kit.table import Number
from tasks.evaluation.alternative_words import PRIOR
from tasks.quantities import group_words, is_calibrated, quantity_words, shown
from tasks.remarks.model_findings import scatter_words
from tasks.remarks.observation_sigmas import part_words
from tasks.results.calibration_figures import StepComparisonFigure
from tasks.results.figures import AdjustmentFigures
from tasks.results.quality_gates import GateResult
from tasks.settings.calibration import AcceptanceLimits

#: A sentence, and whether it refuses the calibration or restricts it only.
Objection: TypeAlias = tuple[bool, str]
_PRIOR = "prior:"
_AXES = ("east", "north", "up")
_GROUPS = ("image_points", "control_points", "gnss_positions", "ins_attitudes")
_CHECKED = ("rmse_m", "predicted_rmse_m", "degrees_of_freedom", "mean_m", "predicted_mean_sigma_m")
#: Fewer rejected observations are single gross errors, whatever part of a strip they are.
SEVERAL = 3
#: σ0 of a group with less redundancy says little.
LEAST_REDUNDANCY = 30.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence about a calibration from sources other than its σ.

    Attributes
    ----------
    suspicions : what looked wrong in the deliveries, sentences.
    adjusted : figures of the adjustment.
    residuals, images : residuals.parquet and images.parquet.
    direct : figures of the direct-georeferencing check.
    gates : of the project.
    steps : comparison with the second step; None without one.
    mountings : sentences about cameras that the second step finds flown with several mountings.
    """

    suspicions: tuple[str, ...]
    adjusted: AdjustmentFigures
    residuals: pd.DataFrame
    images: pd.DataFrame
    direct: Mapping[str, Any]
    gates: tuple[GateResult, ...]
    steps: StepComparisonFigure | None
    mountings: tuple[str, ...]

    def objections(self, limits: AcceptanceLimits) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Reasons to refuse the calibration, and restrictions, each the most serious first."""
        wrong = _contradicted(self.residuals, limits)
        calibrated = wrong[wrong["component"].map(is_calibrated).astype(bool)]
        refusing = frozenset(zip(calibrated["quantity"], calibrated["entity"], strict=True))
        found = [
            *((True, sentence) for sentence in self.suspicions),
            *_of_restored(self.adjusted, limits),
            *_of_model(self.adjusted, limits, refusing),
            *_of_groups(self.adjusted, limits),
            *_of_components(self.adjusted, limits),
            *_of_rejections(self.residuals, self.images, limits),
            *_of_priors(wrong, self.adjusted),
            *_of_check_points(self.direct, limits),
            *_of_steps(self.steps, limits),
            *((False, sentence) for sentence in self.mountings),
            *_of_gates(self.gates),
        ]
        return (
            tuple(sentence for refuses, sentence in found if refuses),
            tuple(sentence for refuses, sentence in found if not refuses),
        )


def _of_restored(adjusted: AdjustmentFigures, limits: AcceptanceLimits) -> Iterator[Objection]:
    """Groups with many rejections that no error of the model explains: their σ are wrong."""
    for item in adjusted.restored_groups:
        if item.sigma0 > limits.sigma0_factor:
            name = group_words(item.group)
            yield (
                True,
                f"The stated σ of the {name} are too small: with all of them σ0 of the group is "
                f"{item.sigma0:.2f}, and no error of the model explains it. Correct them.",
            )


def model_refuses(adjusted: AdjustmentFigures, limits: AcceptanceLimits) -> bool:
    """Whether an error of the model was found that refuses a calibration, whatever else is right."""
    return any(refuses for refuses, _ in _of_model(adjusted, limits))


def _of_model(
    adjusted: AdjustmentFigures,
    limits: AcceptanceLimits,
    refusing: frozenset[tuple[str, str]] = frozenset(),
) -> Iterator[Objection]:
    """Significant alternatives of the model: refused if a parameter is moved too far, by one or by all.

    Parameters
    ----------
    refusing : quantity and entity of findings that refuse anyway.
    """
    together = (adjusted.moved_by_findings or 0.0) > limits.moved_sigmas
    for finding in adjusted.model_findings:
        far = together or finding.moved_by > limits.moved_sigmas
        yield far or (finding.quantity, finding.entity) in refusing, finding.sentence
    for item in adjusted.strip_scatter:
        yield (
            item.moved_by > limits.moved_sigmas,
            f"{scatter_words(item)} In total this changes the calibration by {item.moved_by:.1f} σ. Declare "
            "errors that are constant over a strip (adjustment.ins_correlation_s, gnss_correlation_s, "
            "priors.gnss_strip_bias_m).",
        )


def _of_steps(steps: StepComparisonFigure | None, limits: AcceptanceLimits) -> Iterator[Objection]:
    if steps is not None and steps.probability < limits.error_probability:
        yield True, steps.sentence


def _of_check_points(direct: Mapping[str, Any], limits: AcceptanceLimits) -> Iterator[Objection]:
    """Differences at the independent check points that are larger than predicted.

    Mean and root mean square of each axis are a test of their own, with their part of the probability.
    """
    probability = limits.error_probability / (2 * len(_AXES))
    largest = float(special.ndtri(1.0 - 0.5 * probability))
    for axis, way in enumerate(_AXES):
        figures = [direct[name][axis] for name in _CHECKED if direct.get(name) is not None]
        if len(figures) < len(_CHECKED) or None in figures:
            continue
        rms, predicted, freedom, mean, sigma = (float(figure) for figure in figures)
        if abs(mean) > largest * sigma:
            signed = Number(mean, 3, plus=True)
            yield (
                True,
                f"The differences {way} at the independent check points have a mean of {signed} m, "
                f"{abs(mean) / sigma:.1f} times its standard deviation.",
            )
            continue
        limit = predicted * np.sqrt(special.chdtri(freedom, probability) / freedom)
        if rms > limit:
            yield (
                True,
                f"The differences {way} at the independent check points have a root mean square of "
                f"{rms:.3f} m; more than {limit:.3f} m cannot be due to chance.",
            )


def _of_groups(adjusted: AdjustmentFigures, limits: AcceptanceLimits) -> Iterator[Objection]:
    """Groups whose σ are stated too large or too small: every certified σ rests on them."""
    restored = {item.group for item in adjusted.restored_groups}
    for item in adjusted.groups:
        name, sigma0 = item.group, item.sigma0
        known = name in _GROUPS and name not in restored
        if not known or sigma0 is None or (item.redundancy or 0.0) < LEAST_REDUNDANCY:
            continue
        factor = limits.sigma0_factor
        if not 1.0 / factor <= sigma0 <= factor:
            what = "small" if sigma0 > 1.0 else "large"
            yield (
                True,
                f"The stated σ of the {group_words(name)} are too {what}: σ0 of the group is "
                f"{sigma0:.2f}, not within {1.0 / factor:.2f} and {factor:.2f}. Correct them.",
            )


def _of_components(adjusted: AdjustmentFigures, limits: AcceptanceLimits) -> Iterator[Objection]:
    """Stated σ that were replaced by estimated ones; larger ones may contain an unknown error."""
    for item in adjusted.variance_components.components if adjusted.variance_components else ():
        factor, lower, upper = item.factor, item.factor_lower, item.factor_upper
        if not item.estimated or factor is None or lower is None or upper is None:
            continue
        small = lower > limits.sigma0_factor
        if small or upper < 1.0 / limits.sigma0_factor:
            yield (
                small and not item.part.startswith(_PRIOR),
                f"The stated σ of {part_words(item.part)} are too {'small' if small else 'large'}: they are "
                f"{factor:.2f} ({lower:.2f} to {upper:.2f}) times as large, which was used. Correct them.",
            )


def _of_rejections(
    residuals: pd.DataFrame, images: pd.DataFrame, limits: AcceptanceLimits
) -> Iterator[Objection]:
    """Groups of which too much was rejected, as a whole or in one flight, height or strip."""
    entered = residuals[residuals["group"].isin(_GROUPS) & (residuals["status"] != "not_used")]
    if not (entered["status"] == "rejected").any():
        return
    by = ["group", "image", "point"]
    wrong = (
        entered.assign(rejected=entered["status"] == "rejected")
        .groupby(by, dropna=False, sort=False)["rejected"]
        .any()
        .reset_index()
    )
    for name, own in wrong.groupby("group", sort=False):
        count, part = int(own["rejected"].sum()), float(own["rejected"].mean())
        if count >= SEVERAL and part > limits.rejected_part:
            yield True, _rejected(str(name), count, len(own), "")
            continue
        if name in ("gnss_positions", "ins_attitudes"):
            yield from _of_entities(str(name), own.merge(images, on="image"))


def _of_entities(group: str, own: pd.DataFrame) -> Iterator[Objection]:
    """Flights and strips of which more than half was rejected: the error is theirs."""
    for scope in ("flight", "strip"):
        for (_, name), part in own.groupby(["flight", scope], sort=False, dropna=True):
            count = int(part["rejected"].sum())
            if count >= SEVERAL and count > 0.5 * len(part):
                yield scope == "flight", _rejected(group, count, len(part), f" of {scope} {name}")


def _rejected(group: str, count: int, of: int, where: str) -> str:
    return (
        f"{count:,} of {of:,} {group_words(group)}{where} ({100.0 * count / of:.0f} %) were rejected as "
        "gross errors. So many must have a common cause."
    )


def _contradicted(residuals: pd.DataFrame, limits: AcceptanceLimits) -> pd.DataFrame:
    """Residuals of given values that the flight contradicts, with entity and size in σ."""
    known = residuals[residuals["group"].str.startswith(_PRIOR) & residuals["standardized"].notna()]
    largest = float(special.ndtri(1.0 - 0.5 * limits.error_probability / max(len(known), 1)))
    wrong = known[known["standardized"].abs() > largest]
    entity = [":".join(group.split(":")[2:]) for group in wrong["group"]]
    return wrong.assign(size=wrong["standardized"].abs(), quantity=PRIOR + wrong["component"], entity=entity)


def _of_priors(wrong: pd.DataFrame, adjusted: AdjustmentFigures) -> Iterator[Objection]:
    """Contradicted values that no finding names; those of single strips only restrict, being few of many."""
    named = {(item.quantity, item.entity) for item in adjusted.model_findings}
    left = [key not in named for key in zip(wrong["quantity"], wrong["entity"], strict=True)]
    for component, own in wrong[np.array(left, dtype=bool)].groupby("component", sort=False):
        worst = own.sort_values("size").to_dict("records")[-1]
        unit, factor, _ = shown(worst["unit"])
        several = f" ({len(own)} of them)" if len(own) > 1 else ""
        yield (
            is_calibrated(str(component)),
            f"Given values of {quantity_words(str(component))} contradict the flight{several}: they differ "
            f"by up to {abs(worst['residual']) * factor:.3g} {unit}, {worst['size']:.1f} times their σ "
            f"({worst['sigma'] * factor:.3g} {unit}). Check adjustment.priors.",
        )


def _of_gates(gates: tuple[GateResult, ...]) -> Iterator[Objection]:
    for gate in gates:
        if not gate.passed:
            value, limit = gate.words
            value = "no such figure" if gate.value is None else value
            unit = "" if gate.unit == "1" else f" {gate.unit}"
            sign = "≤" if gate.bound == "max" else "≥"
            yield True, f"The gate {gate.name} failed: {value}, {sign} {limit}{unit} is required."
