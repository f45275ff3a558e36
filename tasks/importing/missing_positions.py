"""Approximate positions of exposures that were delivered without: along their strip."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from tasks.errors import InputError
from tasks.formats.records import ExposureRecords

_EXAMPLES = 5


def completed_positions(records: ExposureRecords) -> tuple[Floats, str | None]:
    """Positions (n, 3) with those that are missing put on the line of their neighbours, and a sentence.

    Along a strip by time, or by the order of the image names where there are no times; NaN for what has
    fewer than two neighbours with a position. They are no observations.

    Raises
    ------
    InputError
        If no row has a position.
    """
    missing: Bools = np.asarray(np.isnan(records.position).any(axis=1))
    if not missing.any():
        return records.position, None
    if missing.all():
        raise InputError(
            "None of the exposures has a position.",
            "Deliver the GNSS positions, or approximate ones with a large σ.",
            file=records.file,
        )
    position = records.position.copy()
    keys = pd.DataFrame({"flight": records.flight.to_pylist(), "strip": records.strip.to_pylist()})
    strip = keys.groupby(["flight", "strip"], dropna=False).ngroup().to_numpy()
    for number in np.unique(strip[missing & keys["strip"].notna().to_numpy()]):
        rows = np.flatnonzero(strip == number)
        known, unknown = rows[~missing[rows]], rows[missing[rows]]
        if len(known) > 1:
            position[unknown] = _on_the_line(records, rows, known, unknown)
    names = [str(records.image[int(row)]) for row in np.flatnonzero(missing)]
    listed = ", ".join(names[:_EXAMPLES]) + (", …" if len(names) > _EXAMPLES else "")
    return position, (
        f"{records.file.name}: {len(names):,} exposures have no position ({listed}): there is no GNSS "
        "observation of them, and approximate ones are taken from their strips."
    )


def _on_the_line(records: ExposureRecords, rows: Ints, known: Ints, unknown: Ints) -> Floats:
    """Positions (k, 3) on the line through the two nearest known exposures, beyond the ends, too."""
    along = np.full(len(records.image), np.nan)
    if np.isfinite(records.time_s[rows]).all():
        along[rows] = records.time_s[rows]
    else:
        names = np.array([str(records.image[int(row)]) for row in rows])
        along[rows[np.argsort(names, kind="stable")]] = np.arange(len(rows), dtype=np.float64)
    order = known[np.argsort(along[known], kind="stable")]
    right = np.clip(np.searchsorted(along[order], along[unknown]), 1, len(order) - 1)
    first, second = order[right - 1], order[right]
    step = along[second] - along[first]
    part = np.divide(along[unknown] - along[first], step, out=np.zeros(len(unknown)), where=step > 0.0)
    start, end = records.position[first], records.position[second]
    return np.asarray(start + part[:, None] * (end - start))
