"""Columns that grow row by row, in little more memory than they take in the end.

A number in a Python list takes four times its eight bytes, and a name of its own in every row seventy bytes.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.formats.joined_names import joined_names
from tasks.formats.plain_records import control_of, degrees_of_rotations, exposures_of, image_points_of
from tasks.formats.records import ControlRecords, ExposureRecords, FileStatement, ImagePointRecords

_SHAPES = {"rotation": (3, 3), "transform": (4, 4), "quaternion": (4,)}
# Parts that position and rotation are computed from.
_POSES = ("transform", "quaternion", "shift")
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


class LongRows:
    """Named rows that are read one after the other: exposures with their cameras, or points with their roles.

    Attributes
    ----------
    names : of the images or points.
    texts : of each row its camera or role; None: not stated.
    line : of the file.

    Parameters
    ----------
    parts : what a row has, such as position, angles, rotation, sigma.
    """

    def __init__(self, *parts: str) -> None:
        self.names: list[str] = []
        self.texts: list[str | None] = []
        self.line = array("q")
        self._numbers = {part: array("d") for part in parts}

    def append(
        self, name: str, *numbers: Iterable[float], text: str | None = None, line: int | None = None
    ) -> None:
        """Add a row with the numbers of each part; without a line its number in the order of the file."""
        self.names.append(name)
        self.texts.append(text)
        self.line.append(len(self.names) if line is None else line)
        for column, values in zip(self._numbers.values(), numbers, strict=True):
            column.extend(values)

    def __getitem__(self, part: str) -> Floats:
        """A part of all rows: (n, 3); (n, 3, 3) of a rotation, (n, 4, 4) of a transform."""
        return np.frombuffer(self._numbers[part]).reshape(-1, *_SHAPES.get(part, (3,)))

    def exposures(
        self,
        path: Path,
        states: FileStatement | None = None,
        *,
        strip: Sequence[str | None] | None = None,
        unit: Literal["deg"] | None = None,
        remarks: tuple[str, ...] = (),
        **parts: Floats,
    ) -> ExposureRecords:
        """All rows as exposures, with angles instead of rotations ground from camera.

        Transforms, quaternions and shifts are left out.

        Parameters
        ----------
        parts : those that replace the ones that were read, or are added to them.

        Raises
        ------
        InputError
            As of `exposures_of` and `degrees_of_rotations`.
        """
        known: dict[str, Any] = {part: self[part] for part in self._numbers if part not in _POSES} | parts
        if "rotation" in known:
            unit = "deg"
            known["angles"] = degrees_of_rotations(path, known.pop("rotation"), self.names, self.line)
        return exposures_of(
            path,
            self.names,
            known.pop("position"),
            known.pop("angles", None),
            self.line,
            camera=self.texts,
            strip=strip,
            unit=unit,
            states=states,
            remarks=remarks,
            **known,
        )

    def control(
        self,
        path: Path,
        states: FileStatement | None = None,
        remarks: tuple[str, ...] = (),
        **parts: Floats,
    ) -> ControlRecords:
        """All rows as surveyed points; `parts` and errors as of `exposures`."""
        known: dict[str, Any] = {part: self[part] for part in self._numbers} | parts
        place = known.pop("position")
        return control_of(
            path, self.names, place, self.line, role=self.texts, states=states, remarks=remarks, **known
        )


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
