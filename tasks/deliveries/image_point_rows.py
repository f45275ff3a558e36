"""The rows of ``image_points.parquet`` in the order of its key, some at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from adjust.arrays import Bools
from tasks.deliveries.measured_points import (
    Codes,
    MeasuredPoints,
    Rows,
    RowsByNumber,
    blocks,
    counted,
    ranges,
)
from tasks.tables.geometry import GEOMETRY
from tasks.tables.schemas.deliveries import IMAGE_POINTS

_OURS = {GEOMETRY, *(column.name for column in IMAGE_POINTS.columns)}
# Rows that are written together.
_GROUP = 100_000


def rays_of_points(measured: MeasuredPoints) -> NDArray[np.int64]:
    """The number of rows of each point, by its number, excluding rows that are left out."""
    rays = counted(measured.point, len(measured.points))
    left_out = measured.image < 0
    return rays - counted(measured.point[left_out], len(rays)) if left_out.any() else rays


@dataclass(frozen=True, slots=True, eq=False)
class ImagePointRows:
    """The rows that are kept.

    Attributes
    ----------
    measured : all rows.
    place : of each point in the order of the table, by number; −1: it is dropped.
    of_image : how many rows each image has, by number.
    file_names : of the files, in their order.
    extra : further columns of each file.
    """

    measured: MeasuredPoints
    place: Codes
    of_image: NDArray[np.int64]
    file_names: pa.Array
    extra: Sequence[Mapping[str, pa.Array]]

    @classmethod
    def of(
        cls,
        measured: MeasuredPoints,
        dropped: Bools,
        by_name: NDArray[np.uint64],
        extra: Sequence[Mapping[str, pa.Array]],
    ) -> ImagePointRows:
        """All rows except those of dropped points and those that are left out.

        Parameters
        ----------
        by_name : numbers of all points in the order of their names.
        """
        place = np.full(len(dropped), -1, dtype=np.int32)
        kept = by_name[~dropped[by_name]]
        place[kept] = np.arange(len(kept), dtype=np.int32)
        of_image = np.zeros(len(measured.images), dtype=np.int64)
        for rows in blocks(len(measured.point)):
            image = measured.image[rows]
            of_image += np.bincount(
                image[(place[measured.point[rows]] >= 0) & (image >= 0)], minlength=len(of_image)
            )
        return cls(measured, place, of_image, _file_names(measured), extra)

    @property
    def extra_names(self) -> tuple[str, ...]:
        """The further columns of any file, except those with a name of the table."""
        names = dict.fromkeys(name for extra in self.extra for name in extra)
        return tuple(name for name in names if name not in _OURS)

    def groups(self) -> Iterator[Mapping[str, Any]]:
        """Columns of consecutive rows."""
        by_image = RowsByNumber(self.measured.image)
        for begin, end in ranges(self.of_image):
            rows = by_image.rows(begin, end)
            place = self.place[self.measured.point[rows]]
            if place.min(initial=0) < 0:
                rows, place = rows[place >= 0], place[place >= 0]
            key = self.measured.image[rows] * np.int64(len(self.place))
            key += place
            if (key[1:] < key[:-1]).any():
                rows = rows[np.argsort(key)]
            del place, key
            for first in range(0, len(rows), _GROUP):
                yield self._columns(rows[first : first + _GROUP])

    def _columns(self, rows: Rows) -> Mapping[str, Any]:
        measured = self.measured
        xy, sigma = measured.xy_mm(rows), measured.sigma_mm(rows)
        file = measured.file_of(rows)
        return {
            "image": measured.images.take(pa.array(measured.image[rows])),
            "point": measured.points.take(pa.array(measured.point[rows])),
            "x_mm": xy[:, 0],
            "y_mm": xy[:, 1],
            "sigma_x_mm": sigma[:, 0],
            "sigma_y_mm": sigma[:, 1],
            "input_file": self.file_names.take(pa.array(file)),
            **{name: self._extra(name, rows, file) for name in self.extra_names},
        }

    def _extra(self, name: str, rows: Rows, file: NDArray[np.int64]) -> pa.Array:
        """A further column; null where a file does not have it."""
        order = np.argsort(file, kind="stable")
        begin, parts = 0, []
        for number, (own, extra) in enumerate(zip(self.measured.files, self.extra, strict=True)):
            of_file = pa.array(rows[file == number] - begin)
            nothing = pa.nulls(len(of_file), pa.string())
            parts.append(extra[name].take(of_file).cast(pa.string()) if name in extra else nothing)
            begin += len(own.line)
        back = np.empty(len(order), dtype=np.int64)
        back[order] = np.arange(len(order))
        return pa.concat_arrays(parts).take(pa.array(back))


def _file_names(measured: MeasuredPoints) -> pa.Array:
    """Names of the files, with their folder where two are alike."""
    names = [entry.file.name for entry in measured.files]
    return pa.array(
        [
            f"{entry.file.parent.name}/{name}" if names.count(name) > 1 else name
            for entry, name in zip(measured.files, names, strict=True)
        ]
    )
