"""Where each pixel of a resampled image comes from: a grid that is as fine as the map needs it.

Positions are column and row, counted from the centre of the first pixel. Nodes are 64 pixels apart, and the map
between the four of a cell is taken as bilinear. Where that misses it by more than 0.0025 pixels in the middle of the
cell or of one of its sides, the cell has nodes 8 pixels apart, and where that still does, the map of every
pixel. So the error of a smooth map is below 0.0025 pixels, that of a bend, which may lie where it is not
looked, below twice that; and a jump (at the seam of a composed image) stands between the pixels where it is.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.resampling.resampling_kernel import map_positions

#: Positions (n, 2) in the source of positions (n, 2) in the image; NaN where there is none.
SourceOf: TypeAlias = Callable[[Floats], Floats]
#: Pixels between the nodes of a cell, and of a part of it that is divided.
COARSE, FINE = 64, 8
_ENOUGH_PX = 0.0025
# So far outside the source a cell is nowhere, pixels.
_OUTSIDE_PX = 8.0
# Positions that are requested at once, so that what is needed for them stays small.
_AT_ONCE = 100_000
_CHECKED = 50_000


@dataclass(frozen=True, eq=False)
class PixelMap:
    """The source of every pixel of an image.

    Attributes
    ----------
    columns, rows : of the image.
    nodes : (R + 1, K + 1, 2) positions in the source of every 64th pixel; NaN where there is none.
    divided : (R, K) number in `fine` of a cell that is divided, else −1.
    fine : (n, 9, 9, 2) positions of every 8th pixel of divided cells.
    divided_again : (n, 8, 8) number in `finest` of a part that is divided, else −1.
    finest : (m, 8, 8, 2) positions of every pixel of them.
    reach : (R, 2) least and largest row in the source of each row of cells; NaN where there is none.
    error_px : largest difference to the map itself at pixels spread over the image that lie in the source.
    """

    columns: int
    rows: int
    nodes: Floats
    divided: Ints
    fine: Floats
    divided_again: Ints
    finest: Floats
    reach: Floats
    error_px: float = 0.0

    def source_rows(self, rows: tuple[int, int]) -> tuple[float, float]:
        """Least and largest row in the source of rows from the first to below the second; NaN: none."""
        reach = self.reach[rows[0] // COARSE : -(-rows[1] // COARSE)]
        return float(np.fmin.reduce(reach[:, 0])), float(np.fmax.reduce(reach[:, 1]))

    def source_columns(self, rows: tuple[int, int], columns: tuple[int, int]) -> tuple[float, float]:
        """Least and largest column in the source of a part of the image; NaN: none."""
        top, left = rows[0] // COARSE, columns[0] // COARSE
        bottom, right = -(-rows[1] // COARSE), -(-columns[1] // COARSE)
        divided = self.divided[top:bottom, left:right]
        fine = divided[divided >= 0]
        again = self.divided_again[fine]
        found = [
            self.nodes[top : bottom + 1, left : right + 1, 0],
            self.fine[fine, ..., 0],
            self.finest[again[again >= 0], ..., 0],
        ]
        every = np.concatenate([some.ravel() for some in found])
        return float(np.fmin.reduce(every)), float(np.fmax.reduce(every))

    def at(self, column: Ints, row: Ints) -> Floats:
        """Positions (n, 2) in the source of pixels (n,), (n,)."""
        found = np.empty((len(column), 2))
        map_positions(
            column, row, self.nodes, self.divided, self.fine, self.divided_again, self.finest, found
        )
        return found


def pixel_map(source_of: SourceOf, size: tuple[int, int], source_size: tuple[int, int]) -> PixelMap:
    """The map of an image.

    Parameters
    ----------
    size, source_size : columns and rows of the image and of the source.
    """
    along, down = (COARSE // 2 * np.arange(2 * -(-side // COARSE) + 1.0) for side in size)
    dense = _evaluated(source_of, np.stack(np.meshgrid(along, down), axis=-1))
    windows = np.lib.stride_tricks.sliding_window_view(dense, (3, 3), (0, 1))[::2, ::2]
    divided, first = _numbered(_is_missed(np.moveaxis(windows, 2, -1), source_size))
    fine, divided_again, finest = _divided_cells(source_of, first, source_size)
    nodes = np.ascontiguousarray(dense[::2, ::2])
    reach = _reach(nodes, divided, fine, divided_again, finest)
    found = PixelMap(*size, nodes, divided, fine, divided_again, finest, reach)
    return replace(found, error_px=_largest_error(found, source_of, source_size))


def _divided_cells(
    source_of: SourceOf, first: Ints, source_size: tuple[int, int]
) -> tuple[Floats, Ints, Floats]:
    """Nodes and parts of cells whose first pixels are COARSE times (n, 2)."""
    inside = _square(FINE // 2, COARSE // FINE * 2 + 1)
    count = COARSE // FINE
    fine = np.empty((len(first), count + 1, count + 1, 2))
    missed = np.zeros((len(first), count, count), dtype=bool)
    for cells in _portions(len(first), inside.size // 2):
        dense = _evaluated(source_of, COARSE * first[cells, None, None] + inside)
        fine[cells] = dense[:, ::2, ::2]
        windows = np.lib.stride_tricks.sliding_window_view(dense, (3, 3), (1, 2))[:, ::2, ::2]
        missed[cells] = _is_missed(np.moveaxis(windows, 3, -1), source_size)
    divided_again, part = _numbered(missed)
    cell = np.nonzero(missed)[0]
    place = COARSE * first[cell] + FINE * part
    return fine, divided_again, _evaluated(source_of, place[:, None, None] + _square(1, FINE))


def _reach(nodes: Floats, divided: Ints, fine: Floats, divided_again: Ints, finest: Floats) -> Floats:
    """Least and largest row (R, 2) in the source of each row of cells."""
    row_of_cell = np.nonzero(divided >= 0)[0]
    row_of_part = row_of_cell[np.nonzero(divided_again >= 0)[0]]
    found = np.empty((len(divided), 2))
    for k, least in enumerate((np.fmin, np.fmax)):
        of_nodes = least.reduce(nodes[..., 1], axis=1)
        found[:, k] = least(of_nodes[:-1], of_nodes[1:])
        least.at(found[:, k], row_of_cell, least.reduce(fine[..., 1], axis=(1, 2)))
        least.at(found[:, k], row_of_part, least.reduce(finest[..., 1], axis=(1, 2)))
    return found


def _is_missed(nine: Floats, source_size: tuple[int, int]) -> Bools:
    """(…,) whether cells of 3 × 3 positions (…, 3, 3, 2) are not bilinear, and partly in the source.

    Their order is row, column; the four at the corners are the nodes.
    """
    rows = np.stack(
        [nine[..., 0, :, :], 0.5 * (nine[..., 0, :, :] + nine[..., 2, :, :]), nine[..., 2, :, :]], -3
    )
    taken = np.stack([rows[..., 0, :], 0.5 * (rows[..., 0, :] + rows[..., 2, :]), rows[..., 2, :]], -2)
    # NaN, where a position is not known, is not small.
    missed = ~(np.abs(taken - nine) <= _ENOUGH_PX).all(axis=(-3, -2, -1))
    limit = np.array(source_size) + _OUTSIDE_PX
    within = ((nine > -_OUTSIDE_PX) & (nine < limit)).all(axis=-1).any(axis=-1).any(axis=-1)
    return np.asarray(missed & within)


def _numbered(chosen: Bools) -> tuple[Ints, Ints]:
    """Numbers of what is chosen, else −1, and column and row (n, 2) of each, the last two axes."""
    numbers = np.full(chosen.shape, -1, dtype=np.int64)
    numbers[chosen] = np.arange(np.count_nonzero(chosen))
    where = np.nonzero(chosen)
    return numbers, np.stack([where[-1], where[-2]], axis=-1).astype(np.int64)


def _square(step: int, side: int) -> Floats:
    """(side, side, 2) positions step pixels apart."""
    along = step * np.arange(float(side))
    return np.stack(np.meshgrid(along, along), axis=-1)


def _portions(count: int, of_each: int) -> list[slice]:
    """All numbers below count in turn, so many at a time that no more than is good is requested at once."""
    edges = [*range(0, count, max(_AT_ONCE // of_each, 1)), count]
    return [slice(*pair) for pair in pairwise(edges)]


def _evaluated(source_of: SourceOf, place: Floats) -> Floats:
    """Positions of an array (…, 2) of them."""
    flat = place.reshape(-1, 2)
    found = np.empty_like(flat)
    for some in _portions(len(flat), 1):
        found[some] = source_of(flat[some])
    return found.reshape(place.shape)


def _largest_error(found: PixelMap, source_of: SourceOf, source_size: tuple[int, int]) -> float:
    """Largest difference at pixels that are not nodes, of those that have a source either way."""
    pixels = found.columns * found.rows
    # Every so many pixels, by a step that has no factor in common with the distance of the nodes.
    flat = np.arange(0, pixels, max(pixels // _CHECKED, 1) | 1)
    row, column = np.divmod(flat, found.columns)
    taken, true = (
        found.at(column, row),
        _evaluated(source_of, np.stack([column, row], axis=-1).astype(np.float64)),
    )
    edges = np.array(source_size) - 0.5
    # Nothing is taken from beyond the source, where cells are not divided.
    inside = [((place >= -0.5) & (place < edges)).all(axis=-1) for place in (taken, true)]
    return float(np.nanmax(np.abs(taken - true)[inside[0] | inside[1]], initial=0.0))
