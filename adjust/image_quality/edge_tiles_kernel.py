"""Sums of gradients over tiles of an image, from which straight edges are found; compiled."""

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
