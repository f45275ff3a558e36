"""Given distances compared with the object points, where these are known."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.errors import InputError
from tasks.plain_text import some_of
from tasks.tables.places import places_of

# Approximate object points give distances to some percent; a wrong unit or a wrong point is further off.
_LIKELY = (0.5, 2.0)


def check_distances(distances: pd.DataFrame, points: tuple[str, ...], x_in_local: Floats) -> list[str]:
    """A sentence about distances that are not used.

    Parameters
    ----------
    distances : distances.parquet.
    points : names of the m object points.
    x_in_local : (m, 3) approximate coordinates; NaN where there are none.

    Raises
    ------
    InputError
        If the distances as a whole are far from those between the approximate object points.
    """
    ends = [places_of(distances[name], points) for name in ("point", "other_point")]
    known = [(row >= 0) & np.isfinite(x_in_local[row]).all(axis=1) for row in ends]
    usable = known[0] & known[1]
    problems = []
    if not usable.all():
        missing = sorted(
            {
                str(name)
                for side, has in zip(("point", "other_point"), known, strict=True)
                for name in distances[side][~has]
            }
        )
        problems.append(
            f"{int((~usable).sum())} distances are not used: {some_of(missing)} are not measured in two "
            "images, or their rays do not intersect."
        )
    if usable.any():
        between = x_in_local[ends[0][usable]] - x_in_local[ends[1][usable]]
        length = np.maximum(np.linalg.norm(between, axis=1), 1e-12)
        ratio = float(np.median(distances["distance_m"].to_numpy(np.float64)[usable] / length))
        if not _LIKELY[0] < ratio < _LIKELY[1]:
            raise InputError(
                f"The distances are {ratio:.3g} times those between the object points (median of "
                f"{int(usable.sum())}).",
                "Check `unit` in [inputs.distances], the names of the points, and the positions and "
                "control points that determine the scale.",
                entity="inputs.distances",
            )
    return problems
