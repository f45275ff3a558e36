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
from adjust.image_quality.edge_finder import WINDOW, candidates, line_at, to_bright_side
from adjust.image_quality.edge_measurement import MeasuredEdge, measured_edge
from adjust.image_quality.edge_samples import REACH, EdgeLine

#: Rows that two strips of an image share, so that an edge at their border is whole in one of them.
OVERLAP = 2 * WINDOW
_CELLS = 10
_ENOUGH, _TRIED = 4, 12

#: How far from a given point an edge is looked for, px.
NEAR = 40.0


@dataclass(frozen=True, eq=False)
class GivenEdges:
    """Positions of edges, as given by a user.

    Attributes
    ----------
    points : (n, 2) columns and rows near which an edge is looked for, px.
    lines : (m, 4) column and row of both ends of edges, px.
    """

    points: Floats
    lines: Floats


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
        places = candidates(grey, noise)
        for place, cell in zip(places, self._cells(places, first_row).tolist(), strict=True):
            if self._taken.flat[cell] >= _ENOUGH or self._tried.flat[cell] >= _TRIED:
                continue
            if self._is_near(place[:2] + np.array([0.0, first_row])):
                continue
            line = line_at(grey, place)
            found = measured_edge(grey, line)
            if self._take(found, line, first_row):
                self._taken.flat[cell] += 1
            else:
                self._tried.flat[cell] += found != "outside the image"

    def search_given(self, grey: NDArray[Any], noise: float, first_row: int, given: GivenEdges) -> None:
        """Measure the edges of a strip that are given, and the nearest one to each point that is given.

        Parameters
        ----------
        noise, first_row : as of `search`.
        given : in the coordinates of the whole image.
        """
        for ends in given.lines - np.array([0.0, first_row, 0.0, first_row]):
            line = to_bright_side(grey, EdgeLine.between(ends))
            if 0.0 <= line.row < grey.shape[0] and not self._is_near(self._place(line, first_row)):
                self._take(measured_edge(grey, line), line, first_row)
        if not len(given.points):
            return
        found = candidates(grey, noise)
        places = found[:, :2] + np.array([0.0, first_row])
        for point in given.points:
            distance = np.hypot(places[:, 0] - point[0], places[:, 1] - point[1])
            for index in np.argsort(distance, kind="stable"):
                taken = [np.hypot(*(place - point)) <= NEAR for place in self._places]
                if distance[index] > NEAR or any(taken):
                    break
                line = line_at(grey, found[index])
                self._take(measured_edge(grey, line), line, first_row)

    def _take(self, found: MeasuredEdge | str, line: EdgeLine, first_row: int) -> bool:
        """Keep an edge, or count why it is none."""
        if isinstance(found, str):
            self.refused[found] += 1
            return False
        self._places.append(self._place(line, first_row))
        self.edges.append(found.moved(first_row))
        return True

    @staticmethod
    def _place(line: EdgeLine, first_row: int) -> Floats:
        return np.array([line.column, line.row + first_row])

    def _cells(self, places: Floats, first_row: int) -> Ints:
        """Numbers (n,) of the cells of candidates, those across columns and rows apart."""
        parts = (places[:, 1] + first_row) / self.rows, places[:, 0] / self.columns
        down, across = (np.clip((_CELLS * part).astype(np.int64), 0, _CELLS - 1) for part in parts)
        along_columns = np.abs(np.cos(places[:, 2])) >= np.abs(np.sin(places[:, 2]))
        return np.asarray((down * _CELLS + across) * 2 + along_columns)

    def _is_near(self, place: Floats) -> bool:
        """Whether it may share pixels with an edge that was taken."""
        if not self._places:
            return False
        distance = np.array(self._places) - place
        return bool(np.min(np.hypot(distance[:, 0], distance[:, 1])) < np.hypot(WINDOW, REACH))
