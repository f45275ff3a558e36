"""Remarks on an adjustment that the report does not repeat where it has already named their cause."""

from __future__ import annotations

from collections.abc import Sequence

from tasks.quantities import group_words
from tasks.results.figures import GlobalTestFigure, GroupFigure

# σ0 of a group is worth a remark outside these limits, if the group has some redundancy.
_LIMITS = (0.7, 1.4)
_LEAST_REDUNDANCY = 10.0
_MOST_NAMES = 5


def global_test_words(sigma0: float, test: GlobalTestFigure) -> str:
    """That the global test fails."""
    return (
        f"The global test fails: σ0 is {sigma0:.3f}, expected from the stated σ: {test.lower:.3f} to "
        f"{test.upper:.3f} ({100 * test.confidence:g} %)."
    )


def misfit_words(group: GroupFigure) -> str | None:
    """That the σ of a group do not fit its residuals; None: they do, or nothing is known."""
    sigma0, redundancy = group.sigma0, group.redundancy or 0.0
    if sigma0 is None or redundancy < _LEAST_REDUNDANCY or _LIMITS[0] <= sigma0 <= _LIMITS[1]:
        return None
    verdict = "worse" if sigma0 > 1.0 else "better"
    return (
        f"The {group_words(group.group)} fit {verdict} than their σ predict: σ0 of the group is {sigma0:.2f} "
        f"(redundancy {redundancy:,.0f})."
    )


def rejected_control_words(names: Sequence[str]) -> str:
    """Which control points were rejected."""
    return (
        f"Rejected control points: {some_names(names)}. They were not used as control; check their "
        "coordinates and their measurement in the images."
    )


def some_names(names: Sequence[str], most: int = _MOST_NAMES) -> str:
    """The first names, and how many more there are."""
    more = len(names) - most
    return f"{', '.join(names[:most])}{f' and {more:,} more' if more > 0 else ''}"
