"""Images that were delivered twice under different names.

The same measurements counted twice promise σ that are too small by √2, and nothing else tells: a copy fits as
well as its original. Two exposures never see their points at the same places of the image to a thousandth of
a pixel; whoever copied an image, or measured it once for two names, has them all there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tasks.deliveries.measured_points import MeasuredPoints, Rows, counted

# Image coordinates that differ by less are the same, mm.
_SAME_MM = 1e-6
# Odd numbers with bits in no order; products beyond 64 bits wrap.
_MIXING = (0x1B873593CC9E2D51, 0x2545F4914F6CDD1D)
# So many points of an image at the same places are no accident, if they are most of it.
_LEAST = 3


class CopiedImages:
    """Points at the same position in two images, found a few points at a time."""

    def __init__(self, measured: MeasuredPoints) -> None:
        """`measured` : no point twice in an image."""
        self._measured = measured
        self._again = np.zeros(len(measured.point), dtype=bool)
        self._shared = np.zeros(len(measured.images), dtype=np.int64)

    def look_at(self, rows: Rows) -> None:
        """Examine all rows of some points."""
        point, place = self._measured.point[rows].astype(np.int64), self._places(rows)
        alike = _perhaps_alike(point, place)
        if len(alike) == 0:
            return
        # A point stands once in an image: equal rows are of different images.
        point, place = point[alike], place[alike]
        order = np.lexsort((place[:, 1], place[:, 0], point))
        same = (np.diff(point[order]) == 0) & (np.diff(place[order], axis=0) == 0).all(axis=1)
        again = rows[alike[order[np.append(same, False) | np.append(False, same)]]]
        self._again[again] = True
        self._shared += np.bincount(self._measured.image[again], minlength=len(self._shared))

    def refuse(self) -> None:
        """Raise if most points of an image lie in another image exactly where they lie in this one.

        Raises
        ------
        InputError
            Naming the first two such images, and how many there are.
        """
        measured, shared = self._measured, self._shared
        if not (shared >= _LEAST).any():
            return
        measurements = counted(measured.image, len(measured.images))
        copied = (shared >= _LEAST) & (shared > 0.5 * measurements)
        if not copied.any():
            return
        first = int(np.argmax(self._again & copied[measured.image]))
        of_point = np.flatnonzero(self._again & (measured.point == measured.point[first]))
        here = self._places(np.array([first]))
        same = of_point[(self._places(of_point) == here).all(axis=1)]
        one, other = (measured.images[int(measured.image[row])].as_py() for row in same[:2])
        raise measured.error(
            int(same[1]),
            f"{shared[measured.image[first]]:,} points of the image '{one}' lie in '{other}' at exactly "
            f"the same position ({int(copied.sum()):,} of {np.count_nonzero(measurements):,} images "
            "share most of their points so). This is one image under two names, which would count twice.",
            "Deliver each image once.",
            other,
        )

    def _places(self, rows: Rows) -> NDArray[np.int64]:
        return np.rint(self._measured.xy_mm(rows) / _SAME_MM).astype(np.int64)


def _perhaps_alike(point: NDArray[np.int64], place: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows with the same mixture of point and place as another: all alike ones, hardly one besides."""
    mixed = (point * _MIXING[0] + place[:, 0]) * _MIXING[1] + place[:, 1]
    # The upper half tells nearly as much, and is sorted twice as fast.
    mixed = (mixed.view(np.uint64) >> np.uint64(32)).astype(np.uint32)
    ordered = np.sort(mixed)
    double = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
    return np.flatnonzero(np.isin(mixed, double)) if len(double) else np.zeros(0, dtype=np.int64)
