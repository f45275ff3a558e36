"""Straight edges in an image, found by the gradients of small tiles.

A window of several tiles holds one straight edge if its gradients have one direction, lie on one line across
the whole window, and the line is thin. What is found is only a candidate: the adjustment of the edge
(`edge_fit`) decides, by its straightness and by the homogeneous levels at both sides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.image_quality.edge_samples import EdgeLine
from adjust.image_quality.edge_tiles_kernel import tile_sums, window_edges

#: Side of a tile, and tiles along a side of a window.
TILE, TILES = 8, 4
WINDOW = TILE * TILES
_COHERENT = 0.9
_THIN = 2.0
#: A line through the whole window has WINDOW/√12 at least; a little less where it begins or ends in it.
_LONG = 0.85 * WINDOW / np.sqrt(12.0)
#: Gradient of noise that is left out, in its standard deviations (σ/√2 in each direction).
_NOISE_GRADIENTS = 3.5
#: The largest gradient of an edge at least, in standard deviations of the noise.
_STRONG = 2.5


def candidates(grey: NDArray[Any], noise: float) -> Floats:
    """Windows of an image (rows, columns) that may hold one straight edge, the strongest first.

    A window with a pixel that is NaN holds none.

    Parameters
    ----------
    noise : standard deviation of the noise, grey values.

    Returns
    -------
    places : (n, 4) column and row of the edge, angle of its normal (rad, to either side), largest gradient
        (grey values/px).
    """
    if min(grey.shape) < WINDOW or not np.isfinite(noise):
        return np.empty((0, 4))
    sums = tile_sums(np.ascontiguousarray(grey), TILE, _NOISE_GRADIENTS * max(noise, 0.3) / np.sqrt(2.0))
    edges = window_edges(sums, TILES, TILE, _COHERENT, _THIN, _LONG, _STRONG * noise).reshape(-1, 4)
    found = edges[edges[:, 3] > 0.0]
    return np.asarray(found[np.argsort(-found[:, 3], kind="stable")])


def line_at(grey: NDArray[Any], place: Floats) -> EdgeLine:
    """The edge at a place (4,) of `candidates`, as long as lies within the window whatever its direction."""
    column, row, angle, _ = place.tolist()
    return to_bright_side(grey, EdgeLine(column, row, angle, float(WINDOW)))


def to_bright_side(grey: NDArray[Any], line: EdgeLine) -> EdgeLine:
    """The line with the normal that points to the brighter side, which the gradients leave open."""
    step = 3.0 * np.array([np.sin(line.angle), np.cos(line.angle)])
    ends = [np.rint([line.row, line.column] + side * step).astype(int) for side in (1.0, -1.0)]
    (r1, c1), (r2, c2) = (np.clip(end, 0, np.array(grey.shape) - 1) for end in ends)
    if float(grey[r1, c1]) >= float(grey[r2, c2]):
        return line
    return EdgeLine(
        line.column, line.row, line.angle + np.pi * (1.0 if line.angle <= 0 else -1.0), line.length
    )
