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
def points_near(low, high, columns, start):
    """How many points are in the cells from low to high (n, 2), column and row, of each image."""
    count = 0
    for i in range(low.shape[0]):
        for row in range(low[i, 1], high[i, 1] + 1):
            if high[i, 0] >= low[i, 0]:
                count += start[row * columns + high[i, 0] + 1] - start[row * columns + low[i, 0]]
    return count


@kernel
def points_inside(
    centre, rotation, interior, half_format, low, high, columns, start, order, x_of, y_of, z_of, found
):  # fmt: skip
    """Points that fall into each of n images: where those of each image begin (n + 1,); fills found.

    Looked at are those of the cells from low to high (n, 2), column and row, of each image; there are so many
    columns of cells, order[start[c]] … are the points of cell c, and x_of, y_of, z_of the coordinates in this
    order. found has room for all that are looked at.
    """
    images = centre.shape[0]
    begun, count = np.zeros(images + 1, np.int64), 0
    for i in range(images):
        c, x0, y0 = interior[i, 0], interior[i, 1], interior[i, 2]
        r00, r10, r20 = rotation[i, 0, 0], rotation[i, 1, 0], rotation[i, 2, 0]
        r01, r11, r21 = rotation[i, 0, 1], rotation[i, 1, 1], rotation[i, 2, 1]
        r02, r12, r22 = rotation[i, 0, 2], rotation[i, 1, 2], rotation[i, 2, 2]
        for row in range(low[i, 1], high[i, 1] + 1):
            if high[i, 0] < low[i, 0]:
                continue
            for n in range(start[row * columns + low[i, 0]], start[row * columns + high[i, 0] + 1]):
                dx, dy, dz = x_of[n] - centre[i, 0], y_of[n] - centre[i, 1], z_of[n] - centre[i, 2]
                down = r02 * dx + r12 * dy + r22 * dz
                x, y = r00 * dx + r10 * dy + r20 * dz, r01 * dx + r11 * dy + r21 * dz
                # Written in any case, and kept if it is inside: a branch would be guessed wrongly too often.
                found[count] = order[n]
                inside = abs(x0 - c * x / down) < half_format[i, 0]
                inside &= abs(y0 - c * y / down) < half_format[i, 1]
                count += 1 if inside & (down < 0.0) else 0
        begun[i + 1] = count
    return begun


@kernel
def by_point(begun, found, points, image):
    """The same by point: where the images of each point begin (points + 1,); fills image, ascending."""
    start = np.zeros(points + 1, np.int64)
    for n in range(found.shape[0]):
        start[found[n] + 1] += 1
    for p in range(points):
        start[p + 1] += start[p]
    at = start[:-1].copy()
    for i in range(begun.shape[0] - 1):
        for n in range(begun[i], begun[i + 1]):
            image[at[found[n]]] = i
            at[found[n]] += 1
    return start
