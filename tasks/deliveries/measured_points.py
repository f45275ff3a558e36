"""Image points of all files under one numbering: two numbers per row, all else is looked up when needed.

A row has the number of its image and that of its point. What is looked at row by row is looked at in blocks,
so that millions of rows take little more memory than their coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from tasks.deliveries.image_point_units import Unit, in_millimetres, unit_mm
from tasks.errors import InputError
from tasks.formats.records import ImagePointRecords, Lines
from tasks.settings.inputs import IMAGE_POINT_SIGMA_PX, ImagePointsInput

Codes = NDArray[np.int32]
Rows = NDArray[np.int64]
#: Rows that are looked at together.
BLOCK = 250_000
# Rows whose least and largest numbers are known.
_RUN = 20_000
# So many parts at most, however many rows there are: each may look at all of them.
_PARTS = 64


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredFile:
    """The rows of a file.

    Attributes
    ----------
    file : where they stand.
    unit, sigma_of_input : what the project file declares of them.
    xy, sigma : (n, 2) as `ImagePointRecords`.
    line : (n,) of each row.
    """

    file: Path
    unit: Unit
    sigma_of_input: tuple[float, float] | None
    xy: Floats
    sigma: Floats
    line: Lines

    @classmethod
    def of(cls, source: ImagePointsInput, records: ImagePointRecords) -> MeasuredFile:
        """The rows of the records that were read."""
        return cls(records.file, source.unit, source.sigma, records.xy, records.sigma, records.line)

    @property
    def lacks_sigma(self) -> bool:
        """Whether it has no standard deviations at all: one NaN then stands for every row."""
        return self.sigma.strides == (0, 0) and bool(np.isnan(self.sigma[:1]).all())


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredPoints:
    """Image points of all files.

    Attributes
    ----------
    files : in the order of their rows.
    image : (n,) number of the image of each row; −1 where it is left out.
    point : (n,) number of the point of each row.
    images : names, by number.
    points : names, by number.
    cameras : of the project.
    camera_of_image : the number of its camera, by number of the image.
    """

    files: tuple[MeasuredFile, ...]
    image: Codes
    point: Codes
    images: pa.Array
    points: pa.Array
    cameras: tuple[FrameCamera, ...]
    camera_of_image: NDArray[np.int64]

    def xy_mm(self, rows: Rows) -> Floats:
        """Image coordinates (m, 2) of rows, mm."""
        return self._of_files(
            rows, lambda file, own, camera: in_millimetres(file.xy[own], file.unit, self.cameras, camera)
        )

    def sigma_mm(self, rows: Rows) -> Floats:
        """Standard deviations (m, 2) of rows, mm; of the input, or the usual one, where none is given."""
        pixel_mm = np.array([model.pixel_size * 1e3 for model in self.cameras])

        def given_or_usual(file: MeasuredFile, own: Rows, camera: NDArray[np.int64]) -> Floats:
            scale = unit_mm(file.unit, self.cameras)[camera][:, None]
            usual = (
                IMAGE_POINT_SIGMA_PX * pixel_mm[camera][:, None]
                if file.sigma_of_input is None
                else np.array(file.sigma_of_input) * scale
            )
            if file.lacks_sigma:
                return np.broadcast_to(usual, (len(own), 2))
            given = file.sigma[own]
            return np.where(np.isnan(given), usual, given * scale)

        return self._of_files(rows, given_or_usual)

    def file_of(self, rows: Rows) -> NDArray[np.int64]:
        """The number (m,) of the file of each row."""
        return np.searchsorted(self._ends(), rows, side="right")

    def error(self, row: int, what: str, remedy: str, entity: str | None = None) -> InputError:
        """An error at the place of a row."""
        file, line = self.place(row)
        return InputError(what, remedy, file, line, entity)

    def place(self, row: int) -> tuple[Path, int]:
        """File and line of a row."""
        number = int(self.file_of(np.array([row]))[0])
        file = self.files[number]
        return file.file, int(file.line[row - int(self._ends()[number]) + len(file.line)])

    def _ends(self) -> NDArray[np.int64]:
        return np.cumsum([len(file.line) for file in self.files])

    def _of_files(
        self, rows: Rows, values: Callable[[MeasuredFile, Rows, NDArray[np.int64]], Floats]
    ) -> Floats:
        """What a function of a file, rows of it, and their cameras gives, (m, 2)."""
        camera = self.camera_of_image[self.image[rows]]
        if len(self.files) == 1:
            return values(self.files[0], rows, camera)
        result, number = np.empty((len(rows), 2)), self.file_of(rows)
        for one, (file, end) in enumerate(zip(self.files, self._ends().tolist(), strict=True)):
            own = np.flatnonzero(number == one)
            result[own] = values(file, rows[own] - end + len(file.line), camera[own])
        return result


def blocks(rows: int) -> Iterator[slice]:
    """Consecutive rows, some at a time."""
    for begin in range(0, rows, BLOCK):
        yield slice(begin, min(begin + BLOCK, rows))


class RowsByNumber:
    """Rows by their number; fast where near rows mostly have near numbers."""

    def __init__(self, number: Codes) -> None:
        """`number` (n,) of each row."""
        self._number = number
        starts = np.arange(0, len(number), _RUN)
        self._least = np.minimum.reduceat(number, starts)
        self._most = np.maximum.reduceat(number, starts)

    def rows(self, begin: int, end: int) -> Rows:
        """The rows, ascending, with a number of begin … end − 1."""
        runs = np.flatnonzero((self._least < end) & (self._most >= begin))
        found = [np.zeros(0, dtype=np.int64)]
        for beside in np.split(runs, np.flatnonzero(np.diff(runs) > 1) + 1) if len(runs) else []:
            first = int(beside[0]) * _RUN
            own = self._number[first : (int(beside[-1]) + 1) * _RUN]
            # One comparison for both bounds: what is below the first wraps to very large.
            found.append(np.flatnonzero((own - np.int32(begin)).view(np.uint32) < end - begin) + first)
        return np.concatenate(found)


def ranges(count: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Ranges of numbers with about twice `BLOCK` rows in each, and more where there are very many.

    Parameters
    ----------
    count : rows of each number, by number.
    """
    behind = np.cumsum(count)
    if len(behind) == 0:
        return
    size, begin = max(2 * BLOCK, int(behind[-1]) // _PARTS), 0
    while begin < len(count):
        before = int(behind[begin - 1]) if begin else 0
        end = max(begin + 1, int(np.searchsorted(behind, before + size, side="right")))
        yield begin, end
        begin = end


def counted(numbers: Codes, most: int) -> NDArray[np.int64]:
    """How often each of the numbers 0 … most − 1 occurs in (n,); negative ones are ignored."""
    result = np.zeros(most, dtype=np.int64)
    step = max(BLOCK, most)
    for begin in range(0, len(numbers), step):
        some = numbers[begin : begin + step]
        result += np.bincount(some[some >= 0], minlength=most)
    return result
