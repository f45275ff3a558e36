"""Calibrated quantities in the wording and units of a certificate, with the finding for each."""

from __future__ import annotations

from dataclasses import dataclass

from adjust.parameters import INTERIOR_ORIENTATION
from tasks.calibration.record import CalibratedParameter
from tasks.documents.report.correlations import natural_key
from tasks.quantities import (
    COMPONENTS,
    Shown,
    quantity_words,
    shown,
    unit_words,
)

# Of a large value that was held.
_LARGE_DECIMALS = 4


@dataclass(frozen=True)
class Quantity:
    """How a parameter is printed.

    Attributes
    ----------
    words, symbol : for people.
    value, fine : unit of the value, and of change and σ.
    """

    words: str
    symbol: str
    value: Shown
    fine: Shown


def is_of(parameter: CalibratedParameter, *families: str) -> bool:
    """Whether it belongs to one of some families."""
    known = COMPONENTS.get(parameter.parameter)
    return known is not None and known.kind.family in families


def quantity_of(parameter: CalibratedParameter) -> Quantity:
    """How a parameter is printed; one without customary units as in the record."""
    known = COMPONENTS.get(parameter.parameter)
    if known is None:
        own = Shown(unit_words(parameter.unit))
        return Quantity(quantity_words(parameter.parameter), "", own, own)
    kind, fine = known.kind, shown(parameter.unit)
    words = known.direction or kind.long or quantity_words(kind.name)
    if is_of(parameter, INTERIOR_ORIENTATION) and known.direction:
        words = f"{quantity_words(kind.name)}, {words}"
    value = Shown(parameter.unit, 1.0, _LARGE_DECIMALS) if kind.is_large else fine
    return Quantity(words, known.symbol, value, fine)


def short_name(parameter: CalibratedParameter) -> str:
    """A name for rows of matrices: ``c``, ``x0``, ``boresight roll``, ``bluh:7``."""
    known = COMPONENTS.get(parameter.parameter)
    if known is None or known.kind.short is None:
        return quantity_words(parameter.parameter)
    return f"{known.kind.short} {known.direction}" if known.kind.short else known.symbol


def in_order(parameters: tuple[CalibratedParameter, ...]) -> tuple[CalibratedParameter, ...]:
    """In the order of the families, additional parameters last; numbers by size."""
    order = {name: place for place, name in enumerate(COMPONENTS)}

    def place(item: CalibratedParameter) -> tuple[int, str, tuple[tuple[int, int, str], ...]]:
        return order.get(item.parameter, len(order)), item.entity, natural_key(item.parameter)

    return tuple(sorted(parameters, key=place))


def has_result(parameter: CalibratedParameter) -> bool:
    """Whether it was estimated and determined by this flight."""
    if parameter.sigma is None or parameter.verdict not in ("determined", "weak"):
        return False
    return parameter.status in ("significant", "not_significant")


def change_over_sigma(parameter: CalibratedParameter) -> float | None:
    """t: change against the value before over its σ; None without a result."""
    if parameter.sigma is None or not parameter.sigma > 0.0 or not has_result(parameter):
        return None
    return (parameter.value - parameter.given) / parameter.sigma


def finding(parameter: CalibratedParameter) -> str:
    """The finding for a parameter, in the wording of a certificate."""
    if parameter.status == "eliminated":
        return "eliminated"
    if parameter.verdict == "not_determinable" or parameter.status == "not_determinable":
        return "not determinable"
    if parameter.status == "prior_only":
        return "not determinable: determined by its prior only"
    if parameter.sigma is None:
        return "held"
    words = "significant" if parameter.status == "significant" else "not significant"
    return f"{words}, weakly determined" if parameter.verdict == "weak" else words
