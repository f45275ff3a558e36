"""Strips belong to their flights: two flights may number theirs alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable


def strip_names(flight: Iterable[str], strip: Iterable[str]) -> list[str]:
    """Name of the strip of every exposure (n,), another one for every strip of every flight.

    Strips with one name in several flights get the flight behind it: ``3 of flight 2024-05-02``.

    Parameters
    ----------
    flight, strip : names (n,) as delivered, empty where not known.
    """
    named = list(zip(flight, strip, strict=True))
    flights = Counter(name for _, name in set(named))
    return [f"{name} of flight {of}" if flights[name] > 1 and name and of else name for of, name in named]
