"""Which points lie within which images, compiled."""

import numpy as np

from adjust.compiled import kernel


@kernel
def sorted_by(code, codes):
    """Where each of some codes begins (codes + 1,) and the places (n,) of code in their order, ascending."""
    start, order = np.zeros(codes + 1, np.int64), np.empty(code.shape[0], np.int64)
    for n in range(code.shape[0]):
        start[code[n] + 1] += 1
    for c in range(codes):
        start[c + 1] += start[c]
    at = start[:-1].copy()
    for n in range(code.shape[0]):
        order[at[code[n]]] = n
        at[code[n]] += 1
    return start, order


@kernel
def points_inside(centre, rotation, interior, half_format, low, high, columns, start, order, points):
    """Points that fall into each of n images: where those of each image begin (n + 1,), and the points.

    Looked at are those of the cells from low to high (n, 2), column and row, of each image; there are so many
    columns of cells, and order[start[c]] … are the points of cell c.
    """
    images = centre.shape[0]
    begun, most = np.zeros(images + 1, np.int64), 0
    for i in range(images):
        for row in range(low[i, 1], high[i, 1] + 1):
            if high[i, 0] >= low[i, 0]:
                most += start[row * columns + high[i, 0] + 1] - start[row * columns + low[i, 0]]
    found, count = np.empty(most, np.int64), 0
    for i in range(images):
        c, x0, y0 = interior[i, 0], interior[i, 1], interior[i, 2]
        for row in range(low[i, 1], high[i, 1] + 1):
            if high[i, 0] < low[i, 0]:
                continue
            for n in range(start[row * columns + low[i, 0]], start[row * columns + high[i, 0] + 1]):
                p = order[n]
                dx, dy = points[p, 0] - centre[i, 0], points[p, 1] - centre[i, 1]
                dz = points[p, 2] - centre[i, 2]
                down = rotation[i, 0, 2] * dx + rotation[i, 1, 2] * dy + rotation[i, 2, 2] * dz
                if down < 0.0:
                    x = rotation[i, 0, 0] * dx + rotation[i, 1, 0] * dy + rotation[i, 2, 0] * dz
                    y = rotation[i, 0, 1] * dx + rotation[i, 1, 1] * dy + rotation[i, 2, 1] * dz
                    if (
                        abs(x0 - c * x / down) < half_format[i, 0]
                        and abs(y0 - c * y / down) < half_format[i, 1]
                    ):
                        found[count] = p
                        count += 1
        begun[i + 1] = count
    return begun, found[:count]


@kernel
def by_point(begun, found, points):
    """The same by point: where the images of each point begin (points + 1,), and the images, ascending."""
    start, image = np.zeros(points + 1, np.int64), np.empty(found.shape[0], np.int64)
    for n in range(found.shape[0]):
        start[found[n] + 1] += 1
    for p in range(points):
        start[p + 1] += start[p]
    at = start[:-1].copy()
    for i in range(begun.shape[0] - 1):
        for n in range(begun[i], begun[i + 1]):
            image[at[found[n]]] = i
            at[found[n]] += 1
    return start, image
