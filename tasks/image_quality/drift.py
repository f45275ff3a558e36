"""Change of the effective resolution since an earlier date: every mean against the same one then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.document_kit.table import Number
from tasks.errors import Location
from tasks.tables.foreign import read_foreign_table
from tasks.tables.schemas.image_quality import EDGE_DRIFT, EDGE_MEANS

#: Change in its standard deviations beyond which a mean has drifted: by chance once in a thousand times.
LIMIT = 3.29
_REMEDY = "Name the folder of results of `aerocal image-quality`."
_KEY = ["band", "direction", "zone"]


def drift_table(means: pd.DataFrame, earlier: Path) -> pd.DataFrame:
    """A row for every mean that there is at both dates.

    Raises
    ------
    InputError
        If the file is not a table of means, or has none of them.
    """
    then, _ = read_foreign_table(earlier, EDGE_MEANS, _REMEDY)
    both = means.merge(then[[*_KEY, "factor", "sigma_factor"]], on=_KEY, suffixes=("", "_then"))
    if both.empty:
        raise Location(earlier).error(
            "The earlier results have none of the bands.", "Name results of the same camera."
        )
    values = both[["factor", "factor_then", "sigma_factor", "sigma_factor_then"]].to_numpy(np.float64)
    change: Floats = values[:, 0] - values[:, 1]
    sigma: Floats = np.hypot(values[:, 2], values[:, 3])
    t: Floats = change / np.where(sigma > 0.0, sigma, np.nan)
    drift = both[_KEY].assign(
        earlier=both["factor_then"],
        factor=both["factor"],
        change=change,
        sigma_change=sigma,
        t=t,
        drifted=np.abs(t) > LIMIT,
    )
    return drift[[column.name for column in EDGE_DRIFT.columns]]


def drift_remarks(drift: pd.DataFrame) -> tuple[str, ...]:
    """A sentence about all edges of every band that has drifted."""
    whole = drift[(drift["direction"] == "all") & (drift["zone"] == "all") & drift["drifted"]]
    return tuple(
        f"The factor of band {row['band']} has changed by {Number(row['change'], 3, plus=True)} ± "
        f"{row['sigma_change']:.3f} "
        f"since the earlier date, from {row['earlier']:.3f} to {row['factor']:.3f}."
        for _, row in whole.iterrows()
    )
