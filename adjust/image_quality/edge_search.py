"""Edges spread over the format of an image: found, measured, and no more of them in one place than it takes.

The format is divided into cells. In each, edges that show the resolution along the columns' and along the
rows' direction are counted apart, and the strongest candidates are tried until there are enough or too many
failed.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats, Ints
from adjust.image_quality.edge_finder import WINDOW, candidates
from adjust.image_quality.edge_measurement import MeasuredEdge, measured_edge
from adjust.image_quality.edge_samples import REACH, EdgeLine

#: Rows that two strips of an image share, so that an edge at their border is whole in one of them.
OVERLAP = 2 * WINDOW
_CELLS = 10
_ENOUGH, _TRIED = 4, 12


@dataclass(eq=False)
class EdgeSearch:
    """The search for edges in one band of an image, strip by strip from the top.

    Attributes
    ----------
    rows, columns : of the whole image.
    edges : those that were taken, in the coordinates of the whole image.
    refused : candidates that were tried and not taken, by reason.
    """

    rows: int
    columns: int
    edges: list[MeasuredEdge] = field(default_factory=list)
    refused: Counter[str] = field(default_factory=Counter)
    _taken: Ints = field(default_factory=lambda: np.zeros((_CELLS, _CELLS, 2), np.int64))
    _tried: Ints = field(default_factory=lambda: np.zeros((_CELLS, _CELLS, 2), np.int64))
    _places: list[Floats] = field(default_factory=list)

    def search(self, grey: NDArray[Any], noise: float, first_row: int = 0) -> None:
        """Search a strip (rows, columns) that begins at a row of the image.

        Parameters
        ----------
        noise : standard deviation of the noise in the strip, grey values.
        """
        for candidate in candidates(grey, noise):
            line = candidate.line
            cell = self._cell(line, first_row)
            if self._taken[cell] >= _ENOUGH or self._tried[cell] >= _TRIED:
                continue
            place = np.array([line.column, line.row + first_row])
            if self._is_near(place):
                continue
            found = measured_edge(grey, line)
            if isinstance(found, str):
                self.refused[found] += 1
                self._tried[cell] += found != "beside the image"
                continue
            self._taken[cell] += 1
            self._places.append(place)
            self.edges.append(found.moved(first_row))

    def _cell(self, line: EdgeLine, first_row: int) -> tuple[int, int, int]:
        down = int((line.row + first_row) * _CELLS / self.rows)
        across = int(line.column * _CELLS / self.columns)
        return min(down, _CELLS - 1), min(across, _CELLS - 1), int(line.crosses_columns)

    def _is_near(self, place: Floats) -> bool:
        """Whether it may share pixels with an edge that was taken."""
        if not self._places:
            return False
        distance = np.array(self._places) - place
        return bool(np.min(np.hypot(distance[:, 0], distance[:, 1])) < np.hypot(WINDOW, REACH))
