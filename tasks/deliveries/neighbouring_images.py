"""Neighbours in a strip that hardly share a point: a file of image points that ends early, or water.

A file that was cut off at the end of a line is as well-formed as a whole one. Where its points are listed by
image or by place, the cut shows: the overlap of some strips ends at the usual distance between images.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.sparse import csr_array

# Neighbours that share less than this part of what others of their strip share stand alone.
_PART = 0.1
# So many points are shared where an overlap has points at all.
_USUAL = 10
# At more than so many times the usual distance the strip has a gap, and its overlap may end.
_FAR = 1.5
# Fewer images have no usual distance.
_LEAST = 4


def about_neighbours(
    exposures: pd.DataFrame, image: NDArray[np.int64], point: NDArray[np.int64]
) -> tuple[str, ...]:
    """A sentence if neighbouring images of strips share hardly any point, and others do.

    Parameters
    ----------
    exposures : exposures.parquet.
    image : (n,) row of the exposures of each image point.
    point : (n,) number of the point of each image point.
    """
    if "x_m" not in exposures or len(point) == 0:
        return ()
    one, other, strip = _neighbours(exposures)
    if len(one) == 0:
        return ()
    shape = (len(exposures), int(point.max()) + 1)
    seen = csr_array((np.ones(len(point), dtype=np.int32), (image, point)), shape=shape)
    shared: NDArray[np.int64] = np.asarray(seen[one].multiply(seen[other]).sum(axis=1)).ravel()
    # What is usual is so in the block: half of a strip may be missing, or all of it.
    usual = float(np.median(shared[shared > 0])) if (shared > 0).any() else 0.0
    alone = np.flatnonzero(shared < _PART * usual) if usual >= _USUAL else np.zeros(0, dtype=np.int64)
    if len(alone) == 0:
        return ()
    names, first = exposures["image"], alone[0]
    return (
        f"{len(alone):,} of {len(one):,} pairs of neighbouring images share hardly any image point, where "
        f"{usual:.0f} are usual: first '{names.iloc[one[first]]}' ({shared[first]} shared) and "
        f"'{names.iloc[other[first]]}' of strip {strip[first]}. The file of image points may end early, if "
        "there is no water.",
    )


def _neighbours(exposures: pd.DataFrame) -> tuple[NDArray[np.int64], NDArray[np.int64], list[str]]:
    """Rows of images that follow each other in a strip at its usual distance, and its name."""
    one, other, strips = [], [], []
    numbered = exposures.reset_index(drop=True)
    numbered = numbered[numbered["strip"].notna()]
    for (_, strip, _), own in numbered.groupby(["flight", "strip", "camera"], dropna=False, sort=True):
        plan = own[["x_m", "y_m"]].to_numpy(np.float64)
        if len(own) < _LEAST or not np.isfinite(plan).all():
            continue
        along = np.linalg.svd(plan - plan.mean(axis=0), full_matrices=False)[2][0]
        order = np.argsort(plan @ along, kind="stable")
        base = np.linalg.norm(np.diff(plan[order], axis=0), axis=1)
        near = base <= _FAR * np.median(base)
        rows = own.index.to_numpy()[order]
        one.append(rows[:-1][near])
        other.append(rows[1:][near])
        strips += [str(strip)] * int(near.sum())
    if not one:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), []
    return np.concatenate(one), np.concatenate(other), strips
