"""An adjustment by dense algebra (Gauss-Newton), of a project in a map without a projection."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from tests.golden.delivered_block import ANGLES, PLACE, Applied, Array, Delivered, Solved


def at_minimum(project: Path, folder: Path, tables: Mapping[str, pd.DataFrame]) -> Solved:
    """The block at the minimum, from tables of orientations, points and parameters to begin with."""
    for _ in range(10):
        solved = Solved(Delivered(project, Applied(folder, tables)), lambda _: True)
        b = -solved.a.T @ solved.p @ solved.v
        if np.sqrt(b @ solved.q @ b) < 1e-9:
            return solved
        tables = _moved(tables, solved, solved.q @ b)
    raise AssertionError("no minimum")


def _moved(tables: Mapping[str, pd.DataFrame], at: Solved, step: Array) -> dict[str, pd.DataFrame]:
    """The tables after a step; the axes of the map are those of the adjustment."""
    names = ("exterior_orientations", "object_points", "parameters")
    orientations, points, parameters = (tables[name].copy() for name in names)
    n, m = len(at.d.images), len(at.d.points)
    change = step[: 6 * n].reshape(n, 6)
    orientations[list(PLACE)] += change[:, :3]
    orientations[list(ANGLES)] += np.degrees(change[:, 3:])
    points[list(PLACE)] += step[6 * n : 6 * n + 3 * m].reshape(m, 3)
    of_parameters = step[6 * n + 3 * m :] / at.d.factor[at.d.free]
    for column in ("value", "change"):
        parameters.loc[at.d.free, column] += of_parameters
    return dict(zip(names, (orientations, points, parameters), strict=True))
