"""Defect pixels, clusters and columns of a sensor from bright and dark images, by the rules of a protocol.

    bright image, at half the range:  |pixel − neighbours| > 30 % of the neighbours
    dark image:                       |pixel − neighbours| > 1 % of the nominal light

Which neighbours are meant is not printed in the certificate of the DMC (2010) that has these rules. Of the
eight around a pixel, five are defects in a double column, and their median would hide it; so the median of
the 7 × 7 pixels around is taken, without those that are defects themselves.

A column with more than 12 defect pixels is defective; columns side by side count as one that is double.
Defect pixels outside of columns that touch each other, also at corners, are a cluster.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from adjust.arrays import Bools, Ints

#: Rows of an image beyond a strip that its pixels are compared with.
MARGIN = 3
_SIDE = 2 * MARGIN + 1
_ROUNDS = 4
#: Columns that a protocol allows side by side in one defect column.
DOUBLE = 2
_AT_ONCE = 100_000

Image = NDArray[np.float32]


def deviating(grey: NDArray[Any], limit: float, *, relative: bool) -> Ints:
    """Rows and columns (n, 2) of the pixels of a flat image that deviate from their neighbours.

    Parameters
    ----------
    grey : (rows, columns), at least 7 × 7.
    limit : in parts of the neighbours, or grey values.
    """
    image: Image = np.asarray(grey, dtype=np.float32)
    suspects = np.argwhere(_suspects(image, limit, relative))
    found = np.zeros(image.shape, dtype=bool)
    for _ in range(_ROUNDS):
        around = _around(image, found, suspects)
        beyond = _beyond(image[tuple(suspects.T)], around, limit, relative)
        if (found[tuple(suspects.T)] == beyond).all():
            break
        found[tuple(suspects.T)] = beyond
    return np.argwhere(found).astype(np.int64)


def _beyond(grey: Image, around: Image, limit: float, relative: bool) -> Bools:
    return np.asarray(np.abs(grey - around) > (limit * np.abs(around) if relative else limit))


def _suspects(image: Image, limit: float, relative: bool) -> Bools:
    """Pixels that deviate from one of four beyond the widest defect column; who does not is not a defect."""
    found = np.zeros(image.shape, dtype=bool)
    for axis in (0, 1):
        near = image[MARGIN:] if axis == 0 else image[:, MARGIN:]
        far = image[:-MARGIN] if axis == 0 else image[:, :-MARGIN]
        here = (slice(MARGIN, None), slice(None)) if axis == 0 else (slice(None), slice(MARGIN, None))
        there = (slice(None, -MARGIN), slice(None)) if axis == 0 else (slice(None), slice(None, -MARGIN))
        # Half the limit: the median of the others may lie between the two.
        found[here] |= _beyond(near, far, 0.5 * limit, relative)
        found[there] |= _beyond(far, near, 0.5 * limit, relative)
    return found


def _around(image: Image, found: Bools, places: Ints) -> Image:
    """Median (k,) of the pixels around places (k, 2) that are not defects; of all if there are no others."""
    sound = np.pad(np.where(found, np.nan, image), MARGIN, constant_values=np.nan)
    window, middle = np.arange(_SIDE), _SIDE * _SIDE // 2
    median: Image = np.empty(len(places), dtype=np.float32)
    for start in range(0, len(places), _AT_ONCE):
        part = places[start : start + _AT_ONCE]
        at = part[:, 0, None, None] + window[:, None], part[:, 1, None, None] + window[None, :]
        values = sound[at].reshape(-1, _SIDE * _SIDE)
        values[:, middle] = np.nan
        values[~np.isfinite(values).any(axis=1)] = np.median(image)
        median[start : start + _AT_ONCE] = np.nanmedian(values, axis=1)
    return median


@dataclass(frozen=True, eq=False)
class Defects:
    """Defects of a sensor.

    Attributes
    ----------
    pixels : (n, 2) row and column of defect pixels outside of defect columns.
    cluster : (n,) number of the cluster a pixel belongs to, from 1; 0: it is alone.
    columns : (m, 4) first row, first column, last row, last column of defect columns.
    """

    pixels: Ints
    cluster: Ints
    columns: Ints

    @property
    def clusters(self) -> int:
        """Number of clusters."""
        return int(self.cluster.max(initial=0))

    @property
    def widths(self) -> Ints:
        """(m,) number of columns side by side."""
        return np.asarray(self.columns[:, 3] - self.columns[:, 1] + 1)

    @property
    def single(self) -> int:
        """Number of single defect columns."""
        return int(np.count_nonzero(self.widths == 1))

    @property
    def double(self) -> int:
        """Number of defect columns that are two or more wide."""
        return int(np.count_nonzero(self.widths >= DOUBLE))

    @property
    def smallest_distance(self) -> int | None:
        """Columns from one defect column to the next, the smallest; None with fewer than two."""
        if len(self.columns) < 2:
            return None
        ordered = self.columns[np.argsort(self.columns[:, 1])]
        return int(np.min(ordered[1:, 1] - ordered[:-1, 3]))


def defects(found: Ints, in_column: int = 12) -> Defects:
    """Columns, pixels and clusters among deviating pixels (n, 2), each once.

    Parameters
    ----------
    in_column : defect pixels that a column may have without being defective.
    """
    count = np.bincount(found[:, 1], minlength=1)
    defective = np.flatnonzero(count > in_column)
    listed = []
    for group in np.split(defective, np.flatnonzero(np.diff(defective) > 1) + 1):
        if len(group):
            rows = found[np.isin(found[:, 1], group), 0]
            listed.append((rows.min(), group[0], rows.max(), group[-1]))
    pixels = found[~np.isin(found[:, 1], defective)]
    columns = np.array(listed, dtype=np.int64).reshape(-1, 4)
    return Defects(pixels, _clusters(pixels), columns)


def _clusters(pixels: Ints) -> Ints:
    """Numbers (n,) of the clusters of pixels (n, 2), in their order; 0 for a pixel alone."""
    if not len(pixels):
        return np.zeros(0, dtype=np.int64)
    pairs = KDTree(pixels).query_pairs(1.5, output_type="ndarray")
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(pixels),) * 2)
    _, component = connected_components(joined, directed=False)
    is_cluster = np.bincount(component) > 1
    numbers = np.where(is_cluster, np.cumsum(is_cluster), 0)
    return np.asarray(numbers[component], dtype=np.int64)
