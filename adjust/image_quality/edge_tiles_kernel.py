"""Sums of gradients over tiles of an image, and the straight edges in windows of tiles; compiled."""

import math

import numpy as np

from adjust.compiled import kernel


@kernel
def tile_sums(grey, tile, threshold):
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
def window_edges(sums, tiles, tile, coherent, thin, long, weakest):
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
