"""Columns that grow row by row, in little more memory than they take in the end.

A number in a Python list takes four times its eight bytes, and a name of its own in every row seventy bytes.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.formats.joined_names import joined_names
from tasks.formats.plain_records import image_points_of
from tasks.formats.records import ImagePointRecords

# Names that are looked up together.
_MANY = 100_000


class LongNames:
    """A column of names, most of which occur again."""

    def __init__(self) -> None:
        self._waiting: list[str] = []
        self._parts: list[pa.DictionaryArray] = []

    def append(self, name: str) -> None:
        """Add a row."""
        self._waiting.append(name)
        if len(self._waiting) >= _MANY:
            self._encode()

    def extend(self, names: list[str]) -> None:
        """Add rows."""
        self._waiting += names
        if len(self._waiting) >= _MANY:
            self._encode()

    def column(self) -> pa.DictionaryArray:
        """All rows, each name kept once; the column is empty then."""
        self._encode()
        return joined_names(self._parts)

    def _encode(self) -> None:
        self._parts.append(pa.array(self._waiting, pa.string()).dictionary_encode())
        self._waiting = []


def table_of(values: array[float], width: int) -> Floats:
    """Rows (n, width) of the numbers that were put one behind the other."""
    return np.frombuffer(values, dtype=np.float64).reshape(-1, width)


class LongPoints:
    """Image points that are read one after the other."""

    def __init__(self) -> None:
        self._image, self._point = LongNames(), LongNames()
        self._xy, self._line = array("d"), array("q")

    def append(self, image: str, point: str, xy: Iterable[float], line: int | None = None) -> None:
        """Add a row; without a line its number in the order of the file."""
        self._image.append(image)
        self._point.append(point)
        self._xy.extend(xy)
        self._line.append(len(self._line) + 1 if line is None else line)

    def records(self, path: Path) -> ImagePointRecords:
        """All rows; the columns are empty then.

        Raises
        ------
        InputError
            As of `image_points_of`.
        """
        xy = table_of(self._xy, 2)
        return image_points_of(path, self._image.column(), self._point.column(), xy, self._line)
