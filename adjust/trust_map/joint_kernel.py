"""The joint cofactor of the images of a cell, and what it makes of their rays, compiled.

Neighbouring cells are mostly seen by the same images, so the cofactor Q of z, their orientations and system
parameters, is gathered into one dense matrix for as many cells as it holds. Products with it then run along
its rows.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.solve.covisibility_kernel import find_block


@kernel
def gather(first, last, image, columns, row_start, column, blocks, border, corner, place, used, known):
    """Put Q of the k images of the rays first … last − 1 into known (d, d); images ascend.

    z has six rows for each image, then one for each column of the border that they have, in the order in
    which they come; columns (n, w) are those of each image, −1 held. Fills place (k, w), the row of each of
    them in z or −1. Block (a, b) of two images is there for a ≤ b only. used (g,) is scratch. Returns d.
    """
    k = last - first
    d = 6 * k
    used[:] = -1
    for a in range(k):
        for s in range(columns.shape[1]):
            c = columns[image[first + a], s]
            if c >= 0 and used[c] < 0:
                used[c] = d
                d += 1
            place[a, s] = used[c] if c >= 0 else -1
    for a in range(k):
        for b in range(a, k):
            block = find_block(row_start, column, image[first + a], image[first + b])
            for p in range(6):
                for q in range(6):
                    known[6 * a + p, 6 * b + q] = blocks[block, p, q]
    for c in range(used.shape[0]):
        u = used[c]
        if u >= 0:
            for a in range(k):
                for p in range(6):
                    value = border[image[first + a], p, c]
                    known[6 * a + p, u] = value
                    known[u, 6 * a + p] = value
            for e in range(used.shape[0]):
                if used[e] >= 0:
                    known[u, used[e]] = corner[c, e]
    return d


@small_kernel
def along(row, i, values, ray, r):
    """Product of six numbers of a row from i on and values[ray, r] (6,); written out, nothing is stored."""
    return (
        (row[i] * values[ray, r, 0] + row[i + 1] * values[ray, r, 1])
        + (row[i + 2] * values[ray, r, 2] + row[i + 3] * values[ray, r, 3])
        + (row[i + 4] * values[ray, r, 4] + row[i + 5] * values[ray, r, 5])
    )


@kernel
def joint_blocks(
    first, last, d, known, place, of_exposure, of_system, of_known, scale, row_x, row_y, joint,
):  # fmt: skip
    """Covariance W (2k, 2k) of the k rays first … last − 1 from orientations and system parameters.

    of_system (r, 2, w) has the derivatives by the columns with the rows place (k, w); of_known (r, 2, q) the
    errors of considered parameters. Q is multiplied by scale. row_x, row_y (d,) are scratch.
    """
    k = last - first
    for a in range(k):
        ray, own = first + a, 6 * a
        x0, x1, x2 = of_exposure[ray, 0, 0], of_exposure[ray, 0, 1], of_exposure[ray, 0, 2]
        x3, x4, x5 = of_exposure[ray, 0, 3], of_exposure[ray, 0, 4], of_exposure[ray, 0, 5]
        y0, y1, y2 = of_exposure[ray, 1, 0], of_exposure[ray, 1, 1], of_exposure[ray, 1, 2]
        y3, y4, y5 = of_exposure[ray, 1, 3], of_exposure[ray, 1, 4], of_exposure[ray, 1, 5]
        # Unsigned, so that no index is tested for being negative and the loop runs several columns at once.
        for j in range(d - own):
            i = np.uintp(own + j)
            q0, q1, q2 = known[own, i], known[own + 1, i], known[own + 2, i]
            q3, q4, q5 = known[own + 3, i], known[own + 4, i], known[own + 5, i]
            row_x[i] = ((x0 * q0 + x1 * q1) + (x2 * q2 + x3 * q3)) + (x4 * q4 + x5 * q5)
            row_y[i] = ((y0 * q0 + y1 * q1) + (y2 * q2 + y3 * q3)) + (y4 * q4 + y5 * q5)
        for s in range(place.shape[1]):
            u, x0, y0 = place[a, s], of_system[ray, 0, s], of_system[ray, 1, s]
            if u >= 0 and (x0 != 0.0 or y0 != 0.0):
                for j in range(d - own):
                    i = np.uintp(own + j)
                    row_x[i] += x0 * known[u, i]
                    row_y[i] += y0 * known[u, i]
        for b in range(a, k):
            other = first + b
            xx, xy = along(row_x, 6 * b, of_exposure, other, 0), along(row_x, 6 * b, of_exposure, other, 1)
            yx, yy = along(row_y, 6 * b, of_exposure, other, 0), along(row_y, 6 * b, of_exposure, other, 1)
            for s in range(place.shape[1]):
                u, x0, y0 = place[b, s], of_system[other, 0, s], of_system[other, 1, s]
                if u >= 0 and (x0 != 0.0 or y0 != 0.0):
                    xx += row_x[u] * x0
                    xy += row_x[u] * y0
                    yx += row_y[u] * x0
                    yy += row_y[u] * y0
            xx, xy, yx, yy = scale * xx, scale * xy, scale * yx, scale * yy
            for q in range(of_known.shape[2]):
                xx += of_known[ray, 0, q] * of_known[other, 0, q]
                xy += of_known[ray, 0, q] * of_known[other, 1, q]
                yx += of_known[ray, 1, q] * of_known[other, 0, q]
                yy += of_known[ray, 1, q] * of_known[other, 1, q]
            joint[2 * a, 2 * b], joint[2 * a, 2 * b + 1] = xx, xy
            joint[2 * a + 1, 2 * b], joint[2 * a + 1, 2 * b + 1] = yx, yy
            joint[2 * b, 2 * a], joint[2 * b + 1, 2 * a] = xx, xy
            joint[2 * b, 2 * a + 1], joint[2 * b + 1, 2 * a + 1] = yx, yy
