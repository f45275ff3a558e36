"""Differences computed − given at control and check points: in GSD, against their σ, and together."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.document_kit.table import Column, Number, components, numbers

AXES = ("dx", "dy", "dz")
HEADINGS = ("east", "north", "up")
#: What the columns of control points begin with that come from adjustments without the point.
LEFT_OUT = "loo_"


def with_ratios(table: pd.DataFrame, gsd_m: Floats, is_check: bool) -> pd.DataFrame:
    """The table of control or check points with, for each axis, the difference in GSD and over its σ.

    Columns added: is_check, gsd_m, d{x,y,z}_gsd, d{x,y,z}_ratio (|d|/σ), and ``largest`` of the ratios; for
    control points also loo_d{x,y,z}_gsd and ``loo_largest``, each from the adjustment without the point.

    Parameters
    ----------
    gsd_m : (n,) ground sampling distance at the points, metres.
    """
    found: dict[str, Floats] = {}
    for prefix in ("",) if is_check else ("", LEFT_OUT):
        ratios = []
        for axis in (f"{prefix}{axis}" for axis in AXES):
            ratios.append(ratio_to_sigma(table, f"{axis}_m"))
            d = table[f"{axis}_m"].to_numpy(np.float64)
            found |= {f"{axis}_gsd": d / gsd_m, f"{axis}_ratio": ratios[-1]}
        found[f"{prefix}largest"] = np.fmax.reduce(ratios)
    return table.assign(is_check=is_check, gsd_m=gsd_m, **found)


def ratio_to_sigma(table: pd.DataFrame, difference: str) -> Floats:
    """|d|/σ of a column; NaN where σ is not known."""
    d, sigma = (table[name].to_numpy(np.float64) for name in (difference, f"sigma_{difference}"))
    return np.asarray(np.divide(np.abs(d), sigma, out=np.full(len(d), np.nan), where=sigma > 0))


STATISTICS_COLUMNS: tuple[Column, ...] = (
    *components("{}_m", HEADINGS, "m", AXES),
    *components("{}_gsd", HEADINGS, "GSD", AXES),
)


def difference_statistics(
    table: pd.DataFrame, prefix: str = ""
) -> Iterator[tuple[str, str, tuple[Number, ...]]]:
    """Key, words and cells of root mean square, mean and largest difference, in metres and in GSD.

    Parameters
    ----------
    prefix : of the names of the columns, such as `LEFT_OUT`.
    """
    metres, in_gsd = (
        [table[f"{prefix}{axis}_{unit}"].dropna().to_numpy(np.float64) for axis in AXES]
        for unit in ("m", "gsd")
    )
    for key, words, figure in _FIGURES:
        of_metres, of_gsd = (
            [figure(own) if len(own) else None for own in values] for values in (metres, in_gsd)
        )
        plus = key == "mean"
        yield key, words, (*numbers(of_metres, 3, plus=plus), *numbers(of_gsd, 2, plus=plus))


def known_differences(table: pd.DataFrame, prefix: str = "") -> tuple[Number, ...]:
    """How many differences there are along each axis."""
    return numbers((float(table[f"{prefix}{axis}_m"].notna().sum()) for axis in AXES), 0)


_FIGURES: tuple[tuple[str, str, Callable[[Floats], float]], ...] = (
    ("rms", "RMS", lambda values: float(np.sqrt(np.mean(values**2)))),
    ("mean", "mean", lambda values: float(np.mean(values))),
    ("largest", "largest |d|", lambda values: float(np.max(np.abs(values)))),
)
