"""Differences computed − given at control and check points, in GSD and against their σ."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats

AXES = ("dx", "dy", "dz")
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
            d, sigma = (table[name].to_numpy(np.float64) for name in (f"{axis}_m", f"sigma_{axis}_m"))
            ratio = np.divide(np.abs(d), sigma, out=np.full(len(d), np.nan), where=sigma > 0)
            found |= {f"{axis}_gsd": d / gsd_m, f"{axis}_ratio": ratio}
            ratios.append(ratio)
        found[f"{prefix}largest"] = np.fmax.reduce(ratios)
    return table.assign(is_check=is_check, gsd_m=gsd_m, **found)
