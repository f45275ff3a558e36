"""Straight edges in an image, found by the gradients of small tiles.

A window of several tiles holds one straight edge if its gradients have one direction, lie on one line across
the whole window, and the line is thin. What is found is only a candidate: the adjustment of the edge
(`edge_fit`) decides, by its straightness and by the homogeneous levels at both sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.image_quality.edge_samples import EdgeLine
from adjust.image_quality.edge_tiles_kernel import tile_sums

#: Side of a tile, and tiles along a side of a window.
TILE, TILES = 8, 4
WINDOW = TILE * TILES
_COHERENT = 0.9
_THIN = 2.0
#: A line through the whole window has WINDOW/√12 at least; a little less where it begins or ends in it.
_LONG = 0.85 * WINDOW / np.sqrt(12.0)
#: Gradient of noise that is left out, in its standard deviations (σ/√2 in each direction).
_NOISE_GRADIENTS = 3.5


@dataclass(frozen=True)
class Candidate:
    """A window that may hold an edge.

    Attributes
    ----------
    line : in the coordinates of the image it was found in.
    strength : the largest gradient, grey values/px.
    """

    line: EdgeLine
    strength: float


def candidates(grey: NDArray[Any], noise: float) -> list[Candidate]:
    """Windows of an image (rows, columns) that may hold one straight edge, the strongest first.

    A window with a pixel that is NaN holds none.

    Parameters
    ----------
    noise : standard deviation of the noise, grey values.
    """
    if min(grey.shape) < WINDOW or not np.isfinite(noise):
        return []
    sums = tile_sums(np.ascontiguousarray(grey), TILE, _NOISE_GRADIENTS * max(noise, 0.3) / np.sqrt(2.0))
    windows = _windows(sums.astype(np.float64))
    weight = np.maximum(windows[..., 0], 1e-30)
    tensor = windows[..., 6:9]
    trace = tensor[..., 0] + tensor[..., 2]
    spread = np.hypot(tensor[..., 0] - tensor[..., 2], 2.0 * tensor[..., 1])
    column, row = windows[..., 1] / weight, windows[..., 2] / weight
    cc = windows[..., 3] / weight - column**2
    cr = windows[..., 4] / weight - column * row
    rr = windows[..., 5] / weight - row**2
    half = 0.5 * np.hypot(cc - rr, 2.0 * cr)
    wide, thin = 0.5 * (cc + rr) + half, 0.5 * (cc + rr) - half
    found = (
        (spread > _COHERENT * np.maximum(trace, 1e-30))
        & (thin < _THIN**2)
        & (wide > _LONG**2)
        & (windows[..., 9] > (5.0 * noise) ** 2 / 4.0)
    )
    places = np.argwhere(found)
    angle = 0.5 * np.arctan2(2.0 * tensor[..., 1], tensor[..., 0] - tensor[..., 2])
    order = np.argsort(-windows[..., 9][found], kind="stable")
    listed = []
    for i, j in places[order]:
        line = _line(float(column[i, j]) + j * TILE, float(row[i, j]) + i * TILE, float(angle[i, j]))
        listed.append(Candidate(to_bright_side(grey, line), float(np.sqrt(windows[i, j, 9]))))
    return listed


def _windows(sums: Floats) -> Floats:
    """Moments (n, m, 10) of all windows, places counted from the first pixel of each."""
    down, across = sums.shape[0] - TILES + 1, sums.shape[1] - TILES + 1
    windows = np.zeros((down, across, 10))
    for i in range(TILES):
        for j in range(TILES):
            part = sums[i : i + down, j : j + across]
            dc, dr = j * TILE, i * TILE
            w, c, r = part[..., 0], part[..., 1], part[..., 2]
            windows[..., 0] += w
            windows[..., 1] += c + dc * w
            windows[..., 2] += r + dr * w
            windows[..., 3] += part[..., 3] + 2 * dc * c + dc * dc * w
            windows[..., 4] += part[..., 4] + dc * r + dr * c + dc * dr * w
            windows[..., 5] += part[..., 5] + 2 * dr * r + dr * dr * w
            windows[..., 6:9] += part[..., 6:9]
            np.maximum(windows[..., 9], part[..., 9], out=windows[..., 9])
    return windows


def _line(column: float, row: float, angle: float) -> EdgeLine:
    # The length that lies within the window whatever its direction.
    return EdgeLine(column, row, angle, float(WINDOW))


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
