"""Square cells over a map: counting in them, and drawing them with few elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd
from markupsafe import Markup

from adjust.arrays import Floats, Ints
from tasks.document_kit import markup
from tasks.document_kit.map_plot import MapPlot


@dataclass(frozen=True)
class Raster:
    """Square cells, row 0 in the south, column 0 in the west.

    Attributes
    ----------
    west, south : outer corner, m.
    size : side of a cell, m.
    rows, columns : how many.
    """

    west: float
    south: float
    size: float
    rows: int
    columns: int

    @classmethod
    def over(cls, x: Floats, y: Floats, longest: int) -> Raster:
        """The cells over points (n,), (n,); `longest` of them along the longer side."""
        width, height = float(np.ptp(x)), float(np.ptp(y))
        size = max(width, height, 1e-6) / longest
        # A sliver more, so that the eastern- and northernmost points lie inside.
        columns, rows = (int(np.floor(extent / size + 1e-9)) + 1 for extent in (width, height))
        return cls(float(np.min(x)), float(np.min(y)), size, rows, columns)

    @property
    def centres(self) -> tuple[Floats, Floats]:
        """Middles of the cells: x (columns,) and y (rows,)."""
        x = self.west + (np.arange(self.columns) + 0.5) * self.size
        y = self.south + (np.arange(self.rows) + 0.5) * self.size
        return np.asarray(x, np.float64), np.asarray(y, np.float64)

    def cell_of(self, x: Floats, y: Floats) -> Ints:
        """Number row · columns + column of the cell (n,) of each point; all points lie inside."""
        column = np.clip(((x - self.west) / self.size).astype(np.int64), 0, self.columns - 1)
        row = np.clip(((y - self.south) / self.size).astype(np.int64), 0, self.rows - 1)
        return np.asarray(row * self.columns + column)

    def median(self, x: Floats, y: Floats, values: Floats) -> Floats:
        """Median (rows, columns) of the values in each cell; NaN where there is none."""
        result = np.full(self.rows * self.columns, np.nan)
        medians = pd.Series(values).groupby(self.cell_of(x, y)).median()
        result[medians.index.to_numpy()] = medians.to_numpy()
        return result.reshape(self.rows, self.columns)


def cells(
    raster: Raster, plot: MapPlot, classes: Ints, colours: Sequence[str], titles: Sequence[str]
) -> Markup:
    """The cells coloured by class (rows, columns), −1 not at all; equal neighbours share a rectangle."""
    # Lengths would be rounded apart from places and leave seams: all corners are absolute.
    across = [
        markup.number(plot.x.at(raster.west + column * raster.size)) for column in range(raster.columns + 1)
    ]
    up = [markup.number(plot.y.at(raster.south + row * raster.size)) for row in range(raster.rows + 1)]
    data: list[list[str]] = [[] for _ in colours]
    for row in range(raster.rows):
        values = classes[row]
        edges = np.flatnonzero(np.diff(values, prepend=values[0] - 1, append=values[-1] - 1))
        for first, behind in pairwise(edges):
            if values[first] >= 0:
                rectangle = f"M{across[first]},{up[row]}V{up[row + 1]}H{across[behind]}V{up[row]}z"
                data[values[first]].append(rectangle)
    groups = [
        markup.element("path", markup.title(words), fill=colour, d="".join(rectangles))
        for colour, rectangles, words in zip(colours, data, titles, strict=True)
        if rectangles
    ]
    return markup.group("cells", groups)


@dataclass(frozen=True)
class Classes:
    """Classes of a value for colouring.

    Attributes
    ----------
    bounds : (k − 1,) inner bounds, ascending; a value at a bound belongs to the class above it.
    words : (k,) what each class says.
    """

    bounds: tuple[float, ...]
    words: tuple[str, ...]

    @classmethod
    def between(cls, bounds: Floats, step: float) -> Classes:
        """Classes between bounds in multiples of a step, with as many digits as it needs."""
        decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
        texts = [f"{bound:.{decimals}f}" for bound in bounds]
        inner = (f"{a}–{b}" for a, b in pairwise(texts))
        return cls(tuple(map(float, bounds)), (f"< {texts[0]}", *inner, f"≥ {texts[-1]}"))

    def of(self, values: Floats) -> Ints:
        """Class of each value, −1 for NaN."""
        found = np.searchsorted(np.asarray(self.bounds), values, side="right").astype(np.int64)
        return np.where(np.isfinite(values), found, -1)
