"""Sums of products of residuals of the same image, by the distance of their image points; compiled."""

import numpy as np

from adjust.compiled import kernel


@kernel
def sums_of_products(start, xy, residual, limits):
    """Pairs (b, 2) in every class of distance, and the sums (b, 2) of the products of their residuals.

    start : (images + 1,) where the image points of each image begin.
    residual : (n, 2), NaN for a coordinate that is not used.
    limits : (b,) squares of the upper limits of the classes, ascending.
    """
    classes = limits.shape[0]
    # The last row, of pairs that are too far apart, is dropped: most branches here would be guessed wrongly.
    count = np.zeros((classes + 1, 2), np.int64)
    total = np.zeros((classes + 1, 2))
    farthest = limits[classes - 1]
    for image in range(start.shape[0] - 1):
        # From left to right, so that most pairs that are too far apart are never looked at.
        order = start[image] + np.argsort(xy[start[image] : start[image + 1], 0])
        x, y, vx, vy = xy[order, 0], xy[order, 1], residual[order, 0], residual[order, 1]
        for a in range(len(order)):
            for b in range(a + 1, len(order)):
                dx, dy = x[a] - x[b], y[a] - y[b]
                if dx * dx >= farthest:
                    break
                square, k = dx * dx + dy * dy, 0
                for limit in limits:
                    k += square >= limit
                product = vx[a] * vx[b]
                if product == product:
                    count[k, 0] += 1
                    total[k, 0] += product
                product = vy[a] * vy[b]
                if product == product:
                    count[k, 1] += 1
                    total[k, 1] += product
    return count[:classes], total[:classes]
