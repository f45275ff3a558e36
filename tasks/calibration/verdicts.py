"""Verdicts of a calibration: what this flight determines, what not and why, and what to fly.

Of every parameter: determined, weak, not determinable, or held. Of the flight: accepted or refused by its
σ; other evidence against it is in `tasks.calibration.evidence`. Standard
deviations decide, not correlations: c and the shift in height are correlated by 0.9 in good flights because
both are unknown; and where a prior has taken over, correlations are small and nothing is determined.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern
from adjust.selection.correlation import correlated_groups
from tasks.calibration.pattern_words import direction_words, height_words
from tasks.calibration.record import Verdict
from tasks.quantities import COMPONENTS, KINDS, is_calibrated, kind_of, named, quantity_words, written_sigma
from tasks.remarks.separability import (
    HEADINGS,
    HEIGHTS,
    OBSERVATIONS,
    correlation_sentence,
    determining,
    listed,
    percent,
    separating,
)
from tasks.settings.calibration import AcceptanceLimits
from tasks.tables.covariance import Key, correlation_pairs, covariance_of

ParameterVerdictWord: TypeAlias = Literal["determined", "weak", "not_determinable", "held"]

#: A parameter of which more than half of what is known comes from its prior: (σ/σ_prior)² > 1/2.
MOSTLY_PRIOR = float(np.sqrt(0.5))
# Correlated by this much or more, a parameter is explained by its partner.
_ENTANGLED = 0.7
# Part of its prior from which a σ is set next to it in a sentence.
_WORTH_SAYING = 0.1
# A shift of a strip whose prior is wider than this, metres, is as good as free.
_WIDE_PRIOR_M = 0.3
# With an error common to a strip their number counts, not that of the images.
_MORE_STRIPS = "more strips, such as every line forward and reverse or lines across"

#: What a reason of the verdict follows among the problems of a run.
REFUSED = "The calibration is refused: "
#: The same for a restriction.
RESTRICTED = "The calibration is restricted: "


@dataclass(frozen=True)
class Correlated:
    """The parameter another one is correlated with most, and by how much."""

    parameter: str
    entity: str
    correlation: float

    def __str__(self) -> str:
        return named(self.parameter, self.entity)


@dataclass(frozen=True)
class ParameterVerdict:
    """The result of a flight for one parameter.

    Attributes
    ----------
    parameter, entity : as in parameters.parquet.
    verdict : see there.
    because : a sentence; empty if there is nothing to say.
    sigma, limit : in the unit of the table; None where held, or where there is no limit.
    sigma_over_prior : σ/σ_prior; None without a prior.
    strongest : the other quantity of the calibration it is correlated with most; None if there is none.
    """

    parameter: str
    entity: str
    verdict: ParameterVerdictWord
    because: str = ""
    sigma: float | None = None
    limit: float | None = None
    sigma_over_prior: float | None = None
    strongest: Correlated | None = None

    def __str__(self) -> str:
        return named(self.parameter, self.entity)


@dataclass(frozen=True)
class FlightVerdict:
    """Whether a flight calibrates what it was flown for.

    Attributes
    ----------
    reasons : why it is refused, sentences.
    restrictions : what restricts its use, sentences.
    remarks : further sentences for the reader.
    """

    reasons: tuple[str, ...] = ()
    restrictions: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Refused with any reason, restricted with any restriction, else accepted."""
        return "refused" if self.reasons else "restricted" if self.restrictions else "accepted"

    def beside(self, reasons: tuple[str, ...], restrictions: tuple[str, ...]) -> FlightVerdict:
        """The verdict with additional reasons against the flight, listed first."""
        return FlightVerdict((*reasons, *self.reasons), (*restrictions, *self.restrictions), self.remarks)


def parameter_verdicts(
    parameters: pd.DataFrame, correlations: pd.DataFrame, pattern: FlightPattern, limits: AcceptanceLimits
) -> Mapping[Key, ParameterVerdict]:
    """The verdict of every row of a table of parameters.

    Parameters
    ----------
    parameters, correlations : parameters.parquet and correlations.parquet.
    """
    strongest = strongest_correlations(correlations)
    found = {}
    for row in parameters.to_dict("records"):
        key = (str(row["parameter"]), str(row["entity"]))
        found[key] = _of_parameter(row, strongest.get(key), pattern, limits)
    return found


def sigma_limit(parameter: str, limits: AcceptanceLimits) -> float | None:
    """Largest σ that is accepted, in the unit of parameters.parquet; None where there is no limit."""
    known = COMPONENTS.get(parameter)
    if known is None or not known.sigma_limit:
        return None
    limit: float = getattr(limits, known.sigma_limit)
    return limit * 1e-3 if known.kind.unit == "mm" else limit


def strongest_correlations(correlations: pd.DataFrame) -> Mapping[Key, Correlated]:
    """For every quantity of a calibration, the strongest correlation with another one; strips excluded."""
    found: dict[Key, Correlated] = {}
    columns = ("parameter_a", "entity_a", "parameter_b", "entity_b", "correlation")
    for name_a, entity_a, name_b, entity_b, value in zip(
        *(correlations[column] for column in columns), strict=True
    ):
        if not (is_calibrated(name_a) and is_calibrated(name_b) and np.isfinite(value)):
            continue
        pair = ((name_a, entity_a), (name_b, entity_b))
        for one, other in (pair, pair[::-1]):
            if one not in found or abs(value) > abs(found[one].correlation):
                found[one] = Correlated(*other, float(value))
    return found


def _of_parameter(
    row: Mapping[Hashable, object],
    strongest: Correlated | None,
    pattern: FlightPattern,
    limits: AcceptanceLimits,
) -> ParameterVerdict:
    name, entity, unit, status = (str(row[key]) for key in ("parameter", "entity", "unit", "status"))
    sigma, ratio = _number(row["sigma"]), _number(row["sigma_over_prior"])
    if sigma is None:
        because = "A candidate, eliminated as not significant." if status == "eliminated" else ""
        return ParameterVerdict(name, entity, "held", because)
    limit = sigma_limit(name, limits)
    said = _Said(name, sigma, unit, limit, ratio, strongest, pattern, limits)
    verdict, because = _judged(status, said) if is_calibrated(name) else _of_strip(said)
    return ParameterVerdict(name, entity, verdict, f"{because}.", sigma, limit, ratio, strongest)


def _of_strip(said: _Said) -> tuple[ParameterVerdictWord, str]:
    """Verdict on a bias or drift of a strip: it is random about its prior, and not kept by a calibration."""
    return "determined", f"{said.numbers}; random from strip to strip, and not part of the calibration"


def _judged(status: str, said: _Said) -> tuple[ParameterVerdictWord, str]:
    """Verdict and reason of a quantity of the calibration."""
    if status == "not_determinable":
        because = f"cannot be separated from other parameters ({said.numbers}); {said.advice}"
        return "not_determinable", because
    if status == "prior_only" or (said.ratio is not None and said.ratio > MOSTLY_PRIOR):
        return (
            "not_determinable",
            f"most of the information on it comes from its prior ({said.numbers}); {said.advice}",
        )
    excess = 0.0 if said.limit is None else said.sigma / said.limit
    if excess > said.limits.weak_up_to:
        return "not_determinable", f"{said.numbers}; {said.advice}"
    if excess > 1.0 or (said.ratio is not None and said.ratio > said.limits.sigma_over_prior):
        return "weak", f"{said.numbers}; {said.advice}"
    return "determined", said.numbers


@dataclass(frozen=True)
class _Said:
    """What can be said about one free parameter."""

    name: str
    sigma: float
    unit: str
    limit: float | None
    ratio: float | None
    strongest: Correlated | None
    pattern: FlightPattern
    limits: AcceptanceLimits

    @property
    def numbers(self) -> str:
        """σ compared with its limit and with its prior, and the strongest correlation."""
        parts = [f"σ {written_sigma(self.sigma, self.unit)}"]
        if self.limit is not None:
            parts.append(f"limit {written_sigma(self.limit, self.unit)}")
        if self.ratio is not None and self.ratio >= _WORTH_SAYING:
            parts.append(f"σ/σ_prior {self.ratio:.2f}")
        if self.strongest is not None:
            sign = "−" if self.strongest.correlation < 0.0 else ""
            parts.append(f"correlated {sign}{percent(self.strongest.correlation)} with {self.strongest}")
        return ", ".join(parts)

    @property
    def advice(self) -> str:
        """What this flight lacks to determine it."""
        remedies: tuple[str, ...] = ()
        if self.strongest is not None and abs(self.strongest.correlation) >= _ENTANGLED:
            remedies = separating((self.name, self.strongest.parameter))
        missing = [remedy for remedy in remedies or determining(self.name) if not self._has(remedy)]
        if missing:
            return f"to determine it: {listed(missing)}"
        kind = KINDS.get(kind_of(self.name))
        return f"to determine it better: {(kind.more if kind else '') or _MORE_STRIPS}"

    def _has(self, remedy: str) -> bool:
        if remedy == HEADINGS:
            return len(self.pattern.directions) >= self.limits.headings
        if remedy in OBSERVATIONS:  # something observes it unless its prior is all there is
            return self.ratio is None or self.ratio <= MOSTLY_PRIOR
        return remedy == HEIGHTS and self.pattern.height_ratio >= self.limits.height_ratio


def flight_verdict(
    parameters: pd.DataFrame,
    correlations: pd.DataFrame,
    verdicts: Mapping[Key, ParameterVerdict],
    pattern: FlightPattern,
    limits: AcceptanceLimits,
    *,
    by_gnss: bool = True,
    heads: Collection[str] = (),
) -> FlightVerdict:
    """Whether the flight is accepted as a calibration flight, with the reasons why not.

    Refused if a quantity of the calibration is not determined, or if what is calibrated needs directions or
    heights that were not flown.

    Parameters
    ----------
    parameters, correlations : parameters.parquet and correlations.parquet.
    by_gnss : whether GNSS positions were observed; control alone needs neither directions nor heights.
    heads : cameras that take pictures together with other heads of a rig.
    """
    calibrated = [
        item for item in verdicts.values() if item.sigma is not None and is_calibrated(item.parameter)
    ]
    if not calibrated:
        return FlightVerdict(("No calibration parameter was estimated; free at least one.",))
    names = {item.parameter for item in calibrated}
    reasons, of_heads = pattern_reasons(names, pattern, limits) if by_gnss else [], []
    if by_gnss and "focal_length" in names and pattern.height_ratio < limits.height_ratio:
        of_heads = about_converging_heads(calibrated, pattern, heads)
        if of_heads:
            reasons = pattern_reasons(names - {"focal_length"}, pattern, limits)
    free_strips, about_strips = _about_strips(parameters, calibrated) if by_gnss else ([], [])
    reasons += free_strips
    reasons += [
        f"{item} is {item.verdict.replace('_', ' ')}: {item.because}"
        for item in calibrated
        if item.verdict != "determined"
    ]
    remarks = of_heads + about_strips + _about_correlations(calibrated, correlations, limits)
    return FlightVerdict(tuple(reasons), remarks=tuple(remarks))


def pattern_reasons(names: set[str], pattern: FlightPattern, limits: AcceptanceLimits) -> list[str]:
    """Sentences about directions and heights that these parameters need and that were not flown."""
    reasons, kinds = [], {kind_of(name) for name in names}
    turning = sorted(name for name, kind in KINDS.items() if kind.needs_headings and name in kinds)
    directions = len(pattern.directions)
    if turning and directions < limits.headings:
        those = listed([quantity_words(name) for name in turning])
        what = "one direction" if directions == 1 else f"{directions} directions"
        reasons.append(
            f"Flown in {what} only ({direction_words(pattern)}), but {limits.headings} are needed for "
            f"{those}: also fly the lines in the opposite direction, or cross lines."
        )
    both = {"principal_point", "lever_arm"} <= kinds
    if ("focal_length" in names or both) and pattern.height_ratio < limits.height_ratio:
        what = "the focal length" if "focal_length" in names else "principal point and lever arm"
        reasons.append(
            f"Flown at {height_words(pattern)}: {what} from GNSS positions requires flying heights in a "
            f"ratio of at least {limits.height_ratio:g}. Fly some of the lines at "
            f"{limits.height_ratio * pattern.heights[0]:.0f} m or more, or at "
            f"{pattern.heights[-1] / limits.height_ratio:.0f} m or less."
        )
    return reasons


def about_converging_heads(
    calibrated: Sequence[ParameterVerdict], pattern: FlightPattern, heads: Collection[str]
) -> list[str]:
    """A remark where focal lengths are determined by heads of a rig and need no second height; else nothing.

    What a second height does for one camera is to tell its focal length from errors of the GNSS heights.
    Where these are an unknown of their own, nothing is taken from them, and σ says all there is to say: heads
    that look in different directions see one point at different scales, which no error in height can imitate.
    """
    lengths = [item for item in calibrated if item.parameter == "focal_length"]
    shifts = [item for item in calibrated if item.parameter == "gnss_shift_z"]
    free = [item for item in shifts if item.sigma_over_prior is None or item.sigma_over_prior < MOSTLY_PRIOR]
    determined = all(item.entity in heads and item.verdict == "determined" for item in lengths)
    if not (determined and shifts and len(free) == len(shifts)):
        return []
    sigmas = [item.sigma or 0.0 for item in lengths]
    return [
        f"Flown at {height_words(pattern)}, with the GNSS shift in height unknown: the focal lengths of "
        f"{listed([item.entity for item in lengths])} follow from heads that look in different directions "
        f"(σ up to {written_sigma(max(sigmas), 'mm')}), not from the flying height."
    ]


def _about_strips(
    parameters: pd.DataFrame, calibrated: list[ParameterVerdict]
) -> tuple[list[str], list[str]]:
    """Reasons and remarks about shifts of strips in addition to an interior orientation."""
    interior = [item for item in calibrated if kind_of(item.parameter) in ("focal_length", "principal_point")]
    by_gnss = interior + [
        item for item in calibrated if kind_of(item.parameter) in ("gnss_shift", "lever_arm")
    ]
    is_bias = parameters["parameter"].map(kind_of) == "gnss_strip_bias"
    of_strips = parameters[is_bias & parameters["sigma"].notna()]
    if of_strips.empty:
        remark = (
            "The model contains no GNSS error common to a strip (`gnss_strip_bias`). If such errors exist, "
            "the standard deviations are too small."
        )
        return [], [remark] if by_gnss else []
    prior = of_strips["sigma_prior"].to_numpy(np.float64)
    wide = ~(prior <= _WIDE_PRIOR_M)
    if not (interior and wide.any()):
        return [], []
    widest = "without a prior" if np.isnan(prior).any() else f"with a prior of {prior.max():.3g} m"
    numbers = listed([f"{item.parameter} {written_sigma(item.sigma or 0.0, 'mm')}" for item in interior])
    sentence = (
        f"The GNSS shifts of the strips are free ({widest}) together with the interior orientation and "
        f"absorb most of it: σ of {numbers}. Set `adjustment.priors.gnss_strip_bias_m` to the actual size of "
        "such errors (0.03 m)."
    )
    bad = any(item.verdict != "determined" for item in interior)
    return ([sentence], []) if bad else ([], [sentence])


def _about_correlations(
    calibrated: list[ParameterVerdict], correlations: pd.DataFrame, limits: AcceptanceLimits
) -> list[str]:
    """Remarks about determined parameters that are strongly correlated, one for each group."""
    determined = [item for item in calibrated if item.verdict == "determined"]
    keys = [(item.parameter, item.entity) for item in determined]
    matrix = covariance_of(keys, dict.fromkeys(keys, 1.0), correlation_pairs(correlations))
    return [
        correlation_sentence([str(determined[k]) for k in members], strongest)
        for members, strongest in correlated_groups(matrix, limits.correlation).items()
    ]


def _number(value: object) -> float | None:
    """A number of a table; None where it is missing."""
    number = float(value) if isinstance(value, int | float) else float("nan")
    return number if np.isfinite(number) else None
