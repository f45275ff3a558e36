"""The block-sparse pattern of the reduced normal equations.

Pairs of events are joined by the object points they both see, through any of their pictures, and by errors
of their own observations that are correlated over time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adjust.arrays import Ints
from adjust.observations.image_point import ImagePoints
from adjust.solve import covisibility_kernel


@dataclass(frozen=True, eq=False)
class Covisibility:
    """Pairs (i, j), i ≤ j, of events that are joined, row by row, diagonal first.

    Attributes
    ----------
    row_start : (n + 1,) where row i begins.
    column : (blocks,) ascending within a row.
    """

    row_start: Ints
    column: Ints

    @property
    def events(self) -> int:
        """Number of events n."""
        return len(self.row_start) - 1

    @property
    def diagonal(self) -> Ints:
        """(n,) position of the diagonal blocks."""
        return self.row_start[:-1]

    @property
    def row(self) -> Ints:
        """(blocks,) row of every block."""
        return np.repeat(np.arange(self.events), np.diff(self.row_start))

    @cached_property
    def _keys(self) -> Ints:
        """(blocks,) row · n + column, ascending."""
        return self.row * self.events + self.column

    def find(self, one: Ints, other: Ints) -> Ints:
        """Positions (k,) of the blocks of pairs of events in either order; −1 where there is none."""
        wanted = np.minimum(one, other) * self.events + np.maximum(one, other)
        position = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return np.where(self._keys[position] == wanted, position, -1)

    def with_pairs(self, one: Ints, other: Ints) -> Covisibility:
        """The same pattern with more pairs (k,) of events; itself if they are all there."""
        missing = self.find(one, other) < 0
        if not missing.any():
            return self
        one, other = one[missing], other[missing]
        keys = np.union1d(self._keys, np.minimum(one, other) * self.events + np.maximum(one, other))
        row, column = np.divmod(keys, self.events)
        return Covisibility(np.searchsorted(row, np.arange(self.events + 1)).astype(np.int64), column)


def point_starts(point: Ints, points: int) -> Ints:
    """(points + 1,) where the rays of each object point begin in a list sorted by point."""
    start = np.zeros(points + 1, dtype=np.int64)
    np.cumsum(np.bincount(point, minlength=points), out=start[1:])
    return start


def covisibility(image_points: ImagePoints, events: int, points: int) -> Covisibility:
    """The pattern of a set of image points; rejected ones count, so that it serves every pass."""
    row_start, unsorted = covisibility_kernel.upper_pattern(
        image_points.event, image_points.point, point_starts(image_points.point, points), events
    )
    row = np.repeat(np.arange(events), np.diff(row_start))
    return Covisibility(row_start, np.sort(row * events + unsorted) % events)
