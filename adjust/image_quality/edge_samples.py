"""The pixels around an edge: their grey values, and their places across and along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints

#: Distance to both sides of an edge within which its pixels are used, px.
REACH = 6.0


@dataclass(frozen=True)
class EdgeLine:
    """A straight edge in an image; pixel centres have whole coordinates.

    Attributes
    ----------
    column, row : its middle, px.
    angle : of its normal, which points to the bright side, against the columns' direction (to larger column
        numbers), rad; positive towards larger row numbers.
    length : px.
    """

    column: float
    row: float
    angle: float
    length: float

    @classmethod
    def between(cls, ends: Floats) -> EdgeLine:
        """The edge between two places, (4,) column and row of each; its normal points to either side."""
        across, down = float(ends[2] - ends[0]), float(ends[3] - ends[1])
        middle = 0.5 * float(ends[0] + ends[2]), 0.5 * float(ends[1] + ends[3])
        return cls(*middle, float(np.arctan2(across, -down)), float(np.hypot(across, down)))

    @property
    def slant(self) -> float:
        """Angle between the edge and the nearest of rows and columns, rad, 0 to π/4."""
        turn = abs(self.angle) % (0.5 * np.pi)
        return float(min(turn, 0.5 * np.pi - turn))

    @property
    def crosses_columns(self) -> bool:
        """Whether it shows the resolution along the columns' direction (its normal is nearer to that)."""
        return bool(abs(np.cos(self.angle)) >= abs(np.sin(self.angle)))


@dataclass(frozen=True, eq=False)
class EdgeSamples:
    """Pixels (n,) around an edge.

    Attributes
    ----------
    line : the edge.
    column, row : of the pixels, px, from the middle of the edge.
    grey : grey values.
    """

    line: EdgeLine
    column: Floats
    row: Floats
    grey: Floats

    def across(self, angle: float, offset: float = 0.0) -> Floats:
        """Distances (n,) from the line with this normal that lies `offset` from the middle, px."""
        return np.asarray(self.column * np.cos(angle) + self.row * np.sin(angle) - offset)

    def along(self, angle: float) -> Floats:
        """Places (n,) along the edge from its middle, px."""
        return np.asarray(self.row * np.cos(angle) - self.column * np.sin(angle))


def samples_of(grey: Floats, line: EdgeLine, reach: float = REACH) -> EdgeSamples:
    """The pixels of a window (rows, columns) no farther than `reach` from an edge and next to its length."""
    rows, columns = _box(grey.shape, line, reach)
    row, column = np.meshgrid(rows - line.row, columns - line.column, indexing="ij")
    across = column * np.cos(line.angle) + row * np.sin(line.angle)
    along = row * np.cos(line.angle) - column * np.sin(line.angle)
    near = (np.abs(across) <= reach) & (np.abs(along) <= 0.5 * line.length)
    values = np.asarray(grey[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1], dtype=np.float64)
    return EdgeSamples(line, column[near], row[near], values[near])


def _box(shape: tuple[int, ...], line: EdgeLine, reach: float) -> tuple[Ints, Ints]:
    """Rows and columns of the window that the pixels next to an edge lie in; at least one of each."""
    sine, cosine = abs(np.sin(line.angle)), abs(np.cos(line.angle))
    half_width = reach * cosine + 0.5 * line.length * sine
    half_height = reach * sine + 0.5 * line.length * cosine
    ranges = []
    for size, middle, half in ((shape[0], line.row, half_height), (shape[1], line.column, half_width)):
        first = int(np.clip(np.floor(middle - half), 0, size - 1))
        last = int(np.clip(np.ceil(middle + half), first, size - 1))
        ranges.append(np.arange(first, last + 1))
    return ranges[0], ranges[1]
