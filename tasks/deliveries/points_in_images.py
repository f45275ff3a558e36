"""All rows of each point together: twice in an image, at one place in two images, shared by neighbours."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tasks.deliveries.measured_points import MeasuredPoints, Rows, RowsByNumber, blocks, counted, ranges
from tasks.deliveries.neighbouring_images import SharedPoints
from tasks.deliveries.source_rows import given_twice
from tasks.files.in_turn import in_turn

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


def look_through(measured: MeasuredPoints, exposures: pd.DataFrame) -> tuple[str, ...]:
    """A sentence if neighbouring images share hardly any point.

    Parameters
    ----------
    exposures : exposures.parquet, a row for each image, in the order of their numbers.

    Raises
    ------
    InputError
        If a point is measured twice in an image, or an image was delivered under two names.
    """
    if len(measured.point) > len(measured.images) * len(measured.points):
        # More than can be different; side by side they would need much memory.
        _refuse_rows_again(measured, *_again_by_table(measured))
    shared = SharedPoints(exposures)
    copied = CopiedImages(measured)

    def examined(part: tuple[Rows, NDArray[np.int64]]) -> bool:
        """Whether a point is twice in an image; if not, its rows are counted."""
        rows, key = part
        key.sort()
        step = np.diff(key)
        if (step == 0).any():
            return True
        shared.count(key[:-1][step == 1] % shared.modulus)
        copied.look_at(rows)
        return False

    # While the rows of some points are examined, those of the next ones are found.
    if any(in_turn(examined, _by_point(measured, shared), threads=1)):
        _refuse_duplicates(measured, shared)
    copied.refuse()
    return shared.remarks(counted(measured.image, len(measured.images)) > 0)


def _by_point(measured: MeasuredPoints, shared: SharedPoints) -> Iterator[tuple[Rows, NDArray[np.int64]]]:
    """All rows of some points, and a number for each row, unique to its point and position in the image."""
    by_point = RowsByNumber(measured.point)
    for begin, end in ranges(counted(measured.point, len(measured.points))):
        rows = by_point.rows(begin, end)
        image = measured.image[rows]
        if image.min(initial=0) < 0:
            rows, image = rows[image >= 0], image[image >= 0]
        key = (measured.point[rows] - np.int64(begin)) * shared.modulus
        key += shared.position[image]
        yield rows, key


def _refuse_duplicates(measured: MeasuredPoints, shared: SharedPoints) -> None:
    """Raise, naming the first row that repeats the point and image of an earlier row."""
    second, again = len(measured.point), 0
    for rows, key in _by_point(measured, shared):
        order = np.argsort(key, kind="stable")
        repeated = order[1:][np.diff(key[order]) == 0]
        again += len(repeated)
        second = min(second, int(rows[repeated].min(initial=second)))
    _refuse_rows_again(measured, second, again)


def _again_by_table(measured: MeasuredPoints) -> tuple[int, int]:
    """The first row that repeats point and image of an earlier one, and the number of such rows; by table."""
    images, count = len(measured.images), len(measured.point)
    seen = np.zeros(images * len(measured.points), dtype=bool)
    second, again = count, 0
    for block in blocks(count):
        rows = np.flatnonzero(measured.image[block] >= 0)
        key = (measured.point[block][rows] * np.int64(images)) + measured.image[block][rows]
        known, first = np.unique(key, return_index=True)
        repeated = np.ones(len(rows), dtype=bool)
        repeated[first[~seen[known]]] = False
        seen[known] = True
        again += int(np.count_nonzero(repeated))
        second = min(second, int(rows[repeated].min(initial=count)) + block.start)
    return second, again


def _refuse_rows_again(measured: MeasuredPoints, second: int, again: int) -> None:
    """Raise if rows repeat point and image of an earlier row; `second` is the first of them."""
    if again == 0:
        return
    image, point = measured.image[second], measured.point[second]
    first = int(np.argmax((measured.image == image) & (measured.point == point)))
    number_of_file = measured.file_of(np.array([first, second]))
    other = measured.place(first)[0] if number_of_file[0] != number_of_file[1] else None
    what, remedy = given_twice("image point", measured.place(first)[1], other, again - 1)
    raise measured.error(
        second, what, remedy, f"'{measured.points[int(point)]}' in '{measured.images[int(image)]}'"
    )
