"""Images that were delivered twice under different names.

The same measurements counted twice promise σ that are too small by √2, and nothing else tells: a copy fits as
well as its original. Two exposures never see their points at the same places of the image to a thousandth of
a pixel; whoever copied an image, or measured it once for two names, has them all there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tasks.deliveries.source_rows import Places

# Image coordinates that differ by less are the same, mm.
_SAME_MM = 1e-6
# Odd numbers with bits in no order; products beyond 64 bits wrap.
_MIXING = (0x1B873593CC9E2D51, 0x2545F4914F6CDD1D)
# So many points of an image at the same places are no accident, if they are most of it.
_LEAST = 3


def refuse_copied_images(
    places: Places,
    image: NDArray[np.int64],
    point: NDArray[np.int64],
    xy_mm: NDArray[np.float64],
    names: Sequence[str],
) -> None:
    """Raise if most points of an image lie in another image exactly where they lie in this one.

    Parameters
    ----------
    image, point : (n,) codes of the images and points.
    xy_mm : (n, 2) image coordinates, mm.
    names : of the images, by code.

    Raises
    ------
    InputError
        Naming the first two such images, and how many there are.
    """
    place = np.rint(xy_mm / _SAME_MM).astype(np.int64)
    alike = _perhaps_alike(point, place)
    rows = pd.DataFrame({"point": point[alike], "x": place[alike, 0], "y": place[alike, 1]}, index=alike)
    # A point stands once in an image: equal rows are of different images.
    again = np.zeros(len(point), dtype=bool)
    again[alike] = rows.duplicated(keep=False).to_numpy()
    shared = np.bincount(image[again], minlength=len(names))
    copied = (shared >= _LEAST) & (shared > 0.5 * np.bincount(image, minlength=len(names)))
    if not copied.any():
        return
    first = int(np.argmax(again & copied[image]))
    same = alike[(rows == rows.loc[first]).all(axis=1).to_numpy()]
    one, other = (names[int(image[row])] for row in same[:2])
    raise places.error(
        int(same[1]),
        f"{shared[image[first]]:,} points of the image '{one}' lie in '{other}' at exactly the same place "
        f"({int(copied.sum()):,} of {len(np.unique(image)):,} images share most of their points so): it is "
        "one image under two names, and would count twice.",
        "Deliver every image once.",
        other,
    )


def _perhaps_alike(point: NDArray[np.int64], place: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows with the same mixture of point and place as another: all alike ones, hardly one besides."""
    mixed = (point * _MIXING[0] + place[:, 0]) * _MIXING[1] + place[:, 1]
    ordered = np.sort(mixed)
    double = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    return np.flatnonzero(np.isin(mixed, double)) if len(double) else np.zeros(0, dtype=np.int64)
