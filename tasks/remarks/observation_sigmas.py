"""Variance components and correlation times that differ from what was stated, in words."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from tasks.results.figures import CorrelationTimeFigure, VarianceFigures


def variance_sentences(figures: VarianceFigures | None) -> Iterator[str]:
    """Stated σ outside the limits of the estimated ones."""
    if figures is None:
        return
    for item in figures.components:
        lower = item.factor_lower or 0.0
        upper = inf if item.factor_upper is None else item.factor_upper
        if item.estimated and not lower <= 1.0 <= upper:
            median = "" if item.sigma is None else f", in the median {item.sigma:.3g} {item.unit}"
            yield (
                f"The stated σ of {part_words(item.part)} do not agree with the residuals: they are "
                f"{item.factor:.2f} ({lower:.2f} to {upper:.2f}) times as large{median}; the adjustment uses "
                "these."
            )


def unestimated_sentences(
    figures: VarianceFigures | None, times: tuple[CorrelationTimeFigure, ...] | None
) -> Iterator[str]:
    """Parts of the observations that kept the stated σ or correlation time, as redundancy is too small."""
    kept = () if figures is None else (item for item in figures.components if not item.estimated)
    if parts := ", ".join(part_words(item.part) for item in kept):
        yield f"There is too little redundancy to estimate the σ of {parts}; they remain as stated."
    for item in times or ():
        if item.tested and item.verdict == "stated":
            yield (
                "There is too little redundancy to estimate the correlation time of the errors of "
                f"{item.group.replace('_', ' ')}; it stays at {item.correlation_s:.3g} s."
            )


def correlation_time_sentences(figures: tuple[CorrelationTimeFigure, ...] | None) -> Iterator[str]:
    """Correlation times that were estimated: different from the stated ones, none, or unknown."""
    for item in figures or ():
        if item.tested and item.verdict != "stated" and (sentence := _about_correlation(item)) is not None:
            yield sentence


def _about_correlation(item: CorrelationTimeFigure) -> str | None:
    """One sentence about a correlation time; None where it is as stated."""
    whose = f"the errors of {item.group.replace('_', ' ')}"
    used = f"{item.correlation_s:.3g} s"
    if item.verdict == "undetermined":
        return f"The residuals do not show whether {whose} are correlated over time."
    if item.verdict == "none":
        return (
            f"The residuals show no correlation over time in {whose} (correlation time below "
            f"{item.upper_s:.3g} s); the adjustment uses {used}."
        )
    if item.verdict == "longer":
        return (
            f"The correlation time of {whose} cannot be determined. It is longer than {item.lower_s:.3g} s, "
            f"as a bias of each strip would be; the adjustment uses {used}."
        )
    lower, upper = item.lower_s or 0.0, inf if item.upper_s is None else item.upper_s
    if lower <= item.stated_s <= upper:
        return None
    return (
        f"The correlation time of {whose} is {used} ({lower:.3g} to {upper:.3g} s), not "
        f"{item.stated_s:.3g} s as stated; the adjustment uses it."
    )


def part_words(part: str) -> str:
    """A part of the observations in words: ``GNSS positions in height of flight 2``."""
    part, joint, origin = part.partition(" of ")
    group, _, components = part.partition(" ")
    words = group.replace("_", " ").replace("prior:", "the priors of ").replace(":", " ")
    words = words.replace("gnss", "GNSS").replace("ins ", "INS ")
    what = f"{words} in {components}" if components in ("plan", "height") else f"{words} {components}".strip()
    return f"{what}{joint}{origin}"
