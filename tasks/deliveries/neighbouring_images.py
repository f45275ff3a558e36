"""Neighbours in a strip that hardly share a point: a file of image points that ends early, or water.

A file that was cut off at the end of a line is as well-formed as a whole one. Where its points are listed by
image or by place, the cut shows: the overlap of some strips ends at the usual distance between images.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tasks.tables.number_columns import numbers_of

# Neighbours that share less than this part of what others of their strip share stand alone.
_PART = 0.1
# So many points are shared where an overlap has points at all.
_USUAL = 10
# At more than so many times the usual distance the strip has a gap, and its overlap may end.
_FAR = 1.5
# Fewer images have no usual distance.
_LEAST = 4
_NONE = np.zeros(0, dtype=np.int64)


class SharedPoints:
    """How many points neighbouring images of strips share, counted some points at a time."""

    def __init__(self, exposures: pd.DataFrame) -> None:
        """`exposures` : exposures.parquet, whose rows are the images' numbers."""
        self._names = exposures["image"]
        placed = _neighbours(exposures) if "x_m" in exposures else (_NONE, _NONE, [])
        self._one, self._other, self._strip = placed
        #: A number (images,) of each image, one more than that of the neighbour before it in its strip, and
        #: of no two others that differ by one.
        self.position = _positions(len(exposures), self._one, self._other)
        #: More than any position by two.
        self.modulus = int(self.position.max(initial=0)) + 2
        self._shared = np.zeros(self.modulus, dtype=np.int64)

    def count(self, position: NDArray[np.int64]) -> None:
        """Count points, each for the `position` of the first of two neighbours that it is measured in."""
        self._shared += np.bincount(position, minlength=self.modulus)

    def remarks(self, measured: NDArray[np.bool_]) -> tuple[str, ...]:
        """A sentence if neighbouring images of strips share hardly any point, and others do.

        Parameters
        ----------
        measured : (images,) images with points. Pairs without such an image are beyond the measured block.
        """
        within = measured[self._one] | measured[self._other]
        shared = self._shared[self.position[self._one]][within]
        # What is usual is so in the block: half of a strip may be missing, or all of it.
        usual = float(np.median(shared[shared > 0])) if (shared > 0).any() else 0.0
        alone = np.flatnonzero(shared < _PART * usual) if usual >= _USUAL else _NONE
        if len(alone) == 0:
            return ()
        names, first = self._names, alone[0]
        pair = np.flatnonzero(within)[first]
        one, other = names.iloc[self._one[pair]], names.iloc[self._other[pair]]
        return (
            f"{len(alone):,} of {len(shared):,} pairs of neighbouring images share hardly any image "
            f"points, where {usual:.0f} are usual. First: '{one}' ({shared[first]} shared) and '{other}' "
            f"of strip {self._strip[pair]}. The file of image points may be incomplete, unless there is "
            "water, or the exposures extend beyond the block.",
        )


def _positions(images: int, one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """As `SharedPoints.position`; pairs are ordered along their strips, and each image is in one strip."""
    position = np.full(images, -1, dtype=np.int64)
    if len(one):
        begins = np.append(True, one[1:] != other[:-1])
        position[one] = np.arange(len(one)) + 2 * np.cumsum(begins)
        position[other] = position[one] + 1
    alone = np.flatnonzero(position < 0)
    position[alone] = position.max(initial=0) + 2 + 2 * np.arange(len(alone))
    return position


def neighbours(exposures: pd.DataFrame) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows (n,), (n,) of images that follow each other in a strip; none where no positions are known."""
    return _neighbours(exposures)[:2] if "x_m" in exposures else (_NONE, _NONE)


def _neighbours(exposures: pd.DataFrame) -> tuple[NDArray[np.int64], NDArray[np.int64], list[str]]:
    """Rows of images that follow each other in a strip at its usual distance, and its name."""
    one, other, strips = [], [], []
    everywhere, name = numbers_of(exposures, ["x_m", "y_m"]), exposures["strip"].to_numpy()
    numbered = np.flatnonzero(exposures["strip"].notna())
    groups = exposures.iloc[numbered].groupby(["flight", "strip", "camera"], dropna=False, sort=True).ngroup()
    order = np.argsort(groups.to_numpy(), kind="stable")
    begins = np.flatnonzero(np.diff(groups.to_numpy()[order])) + 1
    for own in np.split(numbered[order], begins):
        plan = everywhere[own]
        if len(own) < _LEAST or not np.isfinite(plan).all():
            continue
        along = np.linalg.svd(plan - plan.mean(axis=0), full_matrices=False)[2][0]
        order = np.argsort(plan @ along, kind="stable")
        base = np.linalg.norm(np.diff(plan[order], axis=0), axis=1)
        near = base <= _FAR * np.median(base)
        rows = own[order]
        one.append(rows[:-1][near])
        other.append(rows[1:][near])
        strips += [str(name[own[0]])] * int(near.sum())
    if not one:
        return _NONE, _NONE, []
    return np.concatenate(one), np.concatenate(other), strips
