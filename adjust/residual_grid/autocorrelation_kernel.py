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
    count = np.zeros((classes, 2), np.int64)
    total = np.zeros((classes, 2))
    farthest = limits[classes - 1]
    for image in range(start.shape[0] - 1):
        # From left to right, so that most pairs that are too far apart are never looked at.
        order = start[image] + np.argsort(xy[start[image] : start[image + 1], 0])
        for a in range(len(order)):
            i = order[a]
            for b in range(a + 1, len(order)):
                j = order[b]
                dx = xy[i, 0] - xy[j, 0]
                if dx * dx >= farthest:
                    break
                dy = xy[i, 1] - xy[j, 1]
                square = dx * dx + dy * dy
                if square >= farthest:
                    continue
                k = 0
                while square >= limits[k]:
                    k += 1
                for c in range(2):
                    product = residual[i, c] * residual[j, c]
                    if product == product:
                        count[k, c] += 1
                        total[k, c] += product
    return count, total
