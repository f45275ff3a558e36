"""Sub-areas of an image format: a grid of cells that respects the seams of composed images.

Between two seams all cells are equally wide, and no cell lies across a seam: the mean of what two CCD
images show would describe neither of them. Cells are numbered row by row, row 0 at the lower border
(least y), column 0 at the left one (least x).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from scipy import sparse

from adjust.arrays import Bools, Floats, Ints
from adjust.errors import InconsistentBlockError

Interpolation = Literal["bilinear", "cell"]


@dataclass(frozen=True)
class Seams:
    """Where the CCD images of a composed image meet: ascending x and y of the seams, metres, image system."""

    x: tuple[float, ...] = ()
    y: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Division:
    """The division of one side of a format.

    Attributes
    ----------
    edges : (n + 1,) ascending, metres in the image system.
    tile : (n,) number of the CCD image each of the n parts lies in.
    """

    edges: Floats
    tile: Ints

    @classmethod
    def of(cls, half: float, parts: int, seams: tuple[float, ...] = ()) -> Self:
        """`parts` parts of the side from −half to half, none of them across a seam.

        Raises
        ------
        InconsistentBlockError : if the seams are not ascending inside the format, or there are fewer parts
            than CCD images.
        """
        borders = np.array([-half, *seams, half])
        if np.any(np.diff(borders) <= 0.0):
            raise InconsistentBlockError("The seams must be ascending and lie inside the image format.")
        if parts < len(borders) - 1:
            raise InconsistentBlockError(
                f"{parts} sub-areas cannot be arranged between {len(seams)} seams; "
                f"{len(borders) - 1} are required at least."
            )
        counts = np.ones(len(borders) - 1, dtype=np.int64)
        for _ in range(parts - len(counts)):
            counts[np.argmax(np.diff(borders) / counts)] += 1
        pieces = [
            np.linspace(low, high, count + 1)[:-1]
            for low, high, count in zip(borders[:-1], borders[1:], counts, strict=True)
        ]
        return cls(np.append(np.concatenate(pieces), half), np.repeat(np.arange(len(counts)), counts))

    def finer(self, parts: int) -> Division:
        """Every part divided into equal ones."""
        pieces = self.edges[:-1, None] + np.diff(self.edges)[:, None] * np.arange(parts) / parts
        return Division(np.append(pieces, self.edges[-1]), np.repeat(self.tile, parts))

    @property
    def parts(self) -> int:
        """Number n of parts."""
        return len(self.tile)

    @property
    def middles(self) -> Floats:
        """(n,) middles of the parts."""
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))

    def part_of(self, places: Floats) -> Ints:
        """Number (r,) of the part of each place; what lies beyond the border belongs to the outermost."""
        return np.searchsorted(self.edges[1:-1], places, side="right").astype(np.int64)

    def neighbours(self, places: Floats) -> tuple[Ints, Ints, Floats]:
        """The own part (r,), the nearest other one of the same CCD image, and the weight (r,) of that.

        The weight falls linearly from ½ at the common border to zero at the middle of the own part and
        beyond it towards a border or a seam.
        """
        own, middles = self.part_of(places), self.middles
        beyond = places - middles[own]
        other = np.clip(own + np.where(beyond > 0.0, 1, -1), 0, self.parts - 1)
        other = np.where(self.tile[other] == self.tile[own], other, own)
        distance = np.abs(middles[other] - middles[own])
        weight = np.abs(beyond) / np.where(distance > 0.0, distance, np.inf)
        return own, other.astype(np.int64), np.minimum(weight, 0.5)


@dataclass(frozen=True, eq=False)
class FormatCells:
    """The cells of a format.

    Attributes
    ----------
    along_x, along_y : the divisions of its sides.
    """

    along_x: Division
    along_y: Division

    @classmethod
    def of(cls, half_format: tuple[float, float], cells: int, seams: Seams | None = None) -> Self:
        """`cells` × `cells` sub-areas of a format with sides from −half to half, metres.

        Raises
        ------
        InconsistentBlockError : as :meth:`Division.of`.
        """
        seams = seams or Seams()
        half_x, half_y = half_format
        return cls(Division.of(half_x, cells, seams.x), Division.of(half_y, cells, seams.y))

    def finer(self, parts: int) -> FormatCells:
        """Every cell divided into `parts` × `parts` equal ones."""
        return FormatCells(self.along_x.finer(parts), self.along_y.finer(parts))

    @property
    def columns(self) -> int:
        """Number of cells along x."""
        return self.along_x.parts

    @property
    def rows(self) -> int:
        """Number of cells along y."""
        return self.along_y.parts

    @property
    def count(self) -> int:
        """Number k of cells."""
        return self.rows * self.columns

    @property
    def middles(self) -> Floats:
        """(k, 2) middles of the cells, metres, image system."""
        x, y = np.meshgrid(self.along_x.middles, self.along_y.middles)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    @property
    def tile(self) -> Ints:
        """(k,) number of the CCD image each cell lies in."""
        tiles_x = int(self.along_x.tile[-1]) + 1
        return np.asarray((self.along_y.tile[:, None] * tiles_x + self.along_x.tile[None, :]).ravel())

    @property
    def place(self) -> Ints:
        """(k, 2) column and row of each cell."""
        row, column = np.divmod(np.arange(self.count, dtype=np.int64), self.columns)
        return np.stack([column, row], axis=1)

    def cell_of(self, xy: Floats) -> Ints:
        """Number (r,) of the cell of each image point (r, 2)."""
        return self.along_y.part_of(xy[:, 1]) * self.columns + self.along_x.part_of(xy[:, 0])

    def same_as(self, other: FormatCells, tolerance: float = 1e-9) -> bool:
        """Whether another format has the same cells, edge by edge (metres)."""
        return all(
            own.parts == theirs.parts and bool(np.all(np.abs(own.edges - theirs.edges) <= tolerance))
            for own, theirs in ((self.along_x, other.along_x), (self.along_y, other.along_y))
        )

    def interpolate(self, values: Floats, xy: Floats, interpolation: Interpolation) -> Floats:
        """Values (r, 2) at image points (r, 2) from values (k, 2) of the cells.

        ``cell``: that of the cell. ``bilinear``: between the middles of the four nearest cells of the same
        CCD image, constant beyond the outermost middles. Cells without a value (NaN) are not used; where
        there is none with one the result is zero. Each coordinate by itself.
        """
        total, weights = np.zeros((len(xy), 2)), np.zeros((len(xy), 2))
        for cell, share in self._shares(xy, interpolation):
            value = values[cell]
            weight = np.where(np.isfinite(value), share[:, None], 0.0)
            total += weight * np.nan_to_num(value)
            weights += weight
        return np.asarray(total / np.where(weights > 0.0, weights, 1.0))

    def interpolation_matrix(
        self, known: Bools, xy: Floats, interpolation: Interpolation
    ) -> sparse.csr_array[np.float64]:
        """The same of one coordinate as a matrix (r, k), for cells (k,) with and without a value."""
        row, shares = np.arange(len(xy)), list(self._shares(xy, interpolation))
        weights = [np.where(known[cell], share, 0.0) for cell, share in shares]
        total = np.sum(weights, axis=0)
        entries = np.concatenate(weights) / np.tile(np.where(total > 0.0, total, 1.0), len(shares))
        places = np.tile(row, len(shares)), np.concatenate([cell for cell, _ in shares])
        found = sparse.csr_array((entries, places), shape=(len(xy), self.count))
        found.eliminate_zeros()
        return found

    def _shares(self, xy: Floats, interpolation: Interpolation) -> Iterator[tuple[Ints, Floats]]:
        """The cells (r,) that image points (r, 2) get a value from, one after the other, and its weights."""
        if interpolation == "cell":
            yield self.cell_of(xy), np.ones(len(xy))
            return
        column, other_column, of_column = self.along_x.neighbours(xy[:, 0])
        row, other_row, of_row = self.along_y.neighbours(xy[:, 1])
        for c, weight_x in ((column, 1.0 - of_column), (other_column, of_column)):
            for r, weight_y in ((row, 1.0 - of_row), (other_row, of_row)):
                yield r * self.columns + c, weight_x * weight_y
