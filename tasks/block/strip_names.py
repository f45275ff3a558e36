"""Strips belong to their flights: two flights may number theirs alike."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd


def strip_names(flight: Iterable[str], strip: Iterable[str]) -> list[str]:
    """Name of the strip of every exposure (n,), another one for every strip of every flight.

    Strips with one name in several flights get the flight behind it: ``3 of flight 2024-05-02``.

    Parameters
    ----------
    flight, strip : names (n,) as delivered, empty where not known.
    """
    table = pd.DataFrame({"flight": list(flight), "strip": list(strip)}, dtype=object)
    flights = table.drop_duplicates().groupby("strip")["flight"].size()
    several = table["strip"].map(flights > 1) & (table["flight"] != "") & (table["strip"] != "")
    return table["strip"].where(~several, table["strip"] + " of flight " + table["flight"]).tolist()
