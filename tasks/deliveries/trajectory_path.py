"""A trajectory thinned for display: its path, its gaps, and samples that do not belong to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from tasks.coordinates.datum_change import Transfer
from tasks.formats.trajectory_records import SOLUTIONS, TrajectoryRecords

# Samples that a map can show, besides those at which something changes; and most of these.
_SAMPLES, _MOST_CHANGES = 2_000, 5_000


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryPath:
    """k samples of a trajectory.

    Attributes
    ----------
    name : of its file.
    time_s : (k,) on its clock.
    position : (k, 3) in the CRS of the input, or of the project.
    solution : kind of GNSS solution; None where it is not known.
    after_gap, is_outlier : (k,) whether a gap lies before a sample; whether it does not belong to the others.
    """

    name: str
    time_s: Floats
    position: Floats
    solution: list[str | None]
    after_gap: Bools
    is_outlier: Bools

    def in_project(self, transfer: Transfer) -> TrajectoryPath:
        """The same samples in the CRS of the project."""
        return replace(self, position=transfer.positions(self.position))


def path_of(records: TrajectoryRecords, longest_gap: float, outliers: Ints) -> TrajectoryPath:
    """The path of a trajectory.

    Parameters
    ----------
    longest_gap : longer intervals between samples are gaps, s.
    outliers : numbers of samples that do not belong to the others.
    """
    count = len(records.time_s)
    gap = np.concatenate([[False], np.diff(records.time_s) > longest_gap])
    other = gap.copy()
    if records.solution is not None:
        other[1:] |= np.diff(records.solution) != 0
    changes = np.flatnonzero(other)[:_MOST_CHANGES]
    even = np.linspace(0, count - 1, min(count, _SAMPLES)).astype(np.int64)
    kept = np.unique(np.concatenate([even, changes, np.maximum(changes - 1, 0), outliers[:_MOST_CHANGES]]))
    solution: list[str | None] = [None] * len(kept)
    if records.solution is not None:
        solution = [SOLUTIONS[int(number)] for number in records.solution[kept]]
    return TrajectoryPath(
        records.file.name,
        records.time_s[kept],
        records.position[kept],
        solution,
        gap[kept],
        np.isin(kept, outliers),
    )


def path_columns(paths: Sequence[TrajectoryPath]) -> Mapping[str, Any]:
    """Columns of ``trajectories.parquet`` of paths in the CRS of the project."""
    position = np.concatenate([path.position for path in paths])
    return {
        "trajectory": [path.name for path in paths for _ in path.time_s],
        "time_s": np.concatenate([path.time_s for path in paths]),
        **dict(zip(("x_m", "y_m", "z_m"), position.T, strict=True)),
        "solution": [solution for path in paths for solution in path.solution],
        "after_gap": np.concatenate([path.after_gap for path in paths]),
        "is_outlier": np.concatenate([path.is_outlier for path in paths]),
    }
