"""Straight edges in an image, found by the gradients of small tiles.

A window of several tiles holds one straight edge if its gradients have one direction, lie on one line across
the whole window, and the line is thin. What is found is only a candidate: the adjustment of the edge
(`edge_fit`) decides, by its straightness and by the homogeneous levels at both sides.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.compiled import kernel
from adjust.image_quality.edge_samples import EdgeLine

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


@kernel
def tile_sums(grey: NDArray[Any], tile: int, threshold: float) -> NDArray[np.float32]:
    """Moments (tiles down, tiles across, 10) of the gradients of an image (rows, columns).

    Of the pixels whose gradient is larger than `threshold` (grey values/px): the sums of w, w c, w r, w c², w
    c r, w r² with w = gradient² and the place c, r in the tile, then of gc², gc gr, gr², and the largest
    gradient².
    """
    down, across = grey.shape[0] // tile, grey.shape[1] // tile
    sums = np.zeros((down, across, 10), np.float32)
    limit = threshold * threshold
    for i in range(down):
        for r in range(tile):
            row = i * tile + r
            if row == 0 or row == grey.shape[0] - 1:
                continue
            for j in range(across):
                for c in range(tile):
                    column = j * tile + c
                    if column == 0 or column == grey.shape[1] - 1:
                        continue
                    gc = 0.5 * (np.float64(grey[row, column + 1]) - np.float64(grey[row, column - 1]))
                    gr = 0.5 * (np.float64(grey[row + 1, column]) - np.float64(grey[row - 1, column]))
                    w = gc * gc + gr * gr
                    if w < limit:
                        continue
                    s = sums[i, j]
                    s[0] += w
                    s[1] += w * c
                    s[2] += w * r
                    s[3] += w * c * c
                    s[4] += w * c * r
                    s[5] += w * r * r
                    s[6] += gc * gc
                    s[7] += gc * gr
                    s[8] += gr * gr
                    s[9] = max(s[9], w)
    return sums


@kernel
def window_edges(
    sums: NDArray[np.float32],
    tiles: int,
    tile: int,
    coherent: float,
    thin: float,
    long: float,
    weakest: float,
) -> Floats:
    """Edges (windows down, across, 4) in the windows of tiles × tiles tiles: column, row, angle, strength.

    Column and row are those of the image, the angle (rad) is that of the gradients, without their sign. A
    strength (the largest gradient, grey values/px) of 0 says that the window has no edge: its gradients are
    coherent to less than `coherent`, they lie farther from a line than `thin` (px, standard deviation), less
    far along it than `long`, or none is stronger than `weakest`.
    """
    down, across = sums.shape[0] - tiles + 1, sums.shape[1] - tiles + 1
    edges = np.zeros((down, across, 4))
    for i in range(down):
        for j in range(across):
            w = c = r = cc = cr = rr = xx = xy = yy = top = 0.0
            for k in range(tiles):
                for m in range(tiles):
                    s = sums[i + k, j + m]
                    if s[0] == 0.0:
                        continue
                    dc, dr = float(m * tile), float(k * tile)
                    w += s[0]
                    c += s[1] + dc * s[0]
                    r += s[2] + dr * s[0]
                    cc += s[3] + 2.0 * dc * s[1] + dc * dc * s[0]
                    cr += s[4] + dc * s[2] + dr * s[1] + dc * dr * s[0]
                    rr += s[5] + 2.0 * dr * s[2] + dr * dr * s[0]
                    xx += s[6]
                    xy += s[7]
                    yy += s[8]
                    top = max(top, s[9])
            # Not with "<=": a window with a NaN has no edge.
            if not (top > weakest * weakest and math.hypot(xx - yy, 2.0 * xy) > coherent * (xx + yy)):
                continue
            c, r = c / w, r / w
            cc, cr, rr = cc / w - c * c, cr / w - c * r, rr / w - r * r
            half = 0.5 * math.hypot(cc - rr, 2.0 * cr)
            if 0.5 * (cc + rr) - half < thin * thin and 0.5 * (cc + rr) + half > long * long:
                edges[i, j, 0] = c + j * tile
                edges[i, j, 1] = r + i * tile
                edges[i, j, 2] = 0.5 * math.atan2(2.0 * xy, xx - yy)
                edges[i, j, 3] = math.sqrt(top)
    return edges
