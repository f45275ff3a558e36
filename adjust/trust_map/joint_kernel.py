"""The joint cofactor of the images of a cell, and what it makes of their rays, compiled.

Cells with the same images have the same cofactor Q of z, their orientations and system parameters: it is
gathered once into a dense matrix, and serves all of them side by side (`lane_kernel`).
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.solve.covisibility_kernel import find_block
from adjust.trust_map.lane_kernel import LANES, add_product, add_weighted, clear


@kernel
def places(first, last, image, columns, place, used):
    """Fill place (k, w), the row in z of each column of the border that the k images of some rays have.

    z has six rows for each image, then one for each column, in the order in which they come; columns (n, w)
    are those of each image, −1 held. used (g,) gets the row of each column or −1. Returns the rows d of z.
    """
    d = 6 * (last - first)
    used[:] = -1
    for a in range(last - first):
        for s in range(columns.shape[1]):
            c = columns[image[first + a], s]
            if c >= 0 and used[c] < 0:
                used[c] = d
                d += 1
            place[a, s] = used[c] if c >= 0 else -1
    return d


@kernel
def gather(first, last, image, used, row_start, column, blocks, border, corner, scale, pairs, known):
    """Put Q, multiplied by scale, of the rays first … last − 1 into known (d, d); images ascend.

    The block (6, 6) of the images a ≤ b is also at pairs[36 (k a + b)] …, row after row.
    """
    k = last - first
    for a in range(k):
        for b in range(a, k):
            block = find_block(row_start, column, image[first + a], image[first + b])
            at = 36 * (k * a + b)
            for p in range(6):
                for q in range(6):
                    value = scale * blocks[block, p, q]
                    pairs[at + 6 * p + q] = value
                    known[6 * a + p, 6 * b + q] = value
                    known[6 * b + q, 6 * a + p] = value
    for c in range(used.shape[0]):
        u = used[c]
        if u >= 0:
            for a in range(k):
                for p in range(6):
                    value = scale * border[image[first + a], p, c]
                    known[6 * a + p, u] = value
                    known[u, 6 * a + p] = value
            for e in range(used.shape[0]):
                if used[e] >= 0:
                    known[u, used[e]] = scale * corner[c, e]


@small_kernel
def column_of_six(x0, x1, x2, x3, x4, x5, matrix, at):
    """Six numbers times a column of a matrix with six columns."""
    return (
        (x0 * matrix[np.uintp(at)] + x1 * matrix[np.uintp(at + 6)])
        + (x2 * matrix[np.uintp(at + 12)] + x3 * matrix[np.uintp(at + 18)])
        + (x4 * matrix[np.uintp(at + 24)] + x5 * matrix[np.uintp(at + 30)])
    )


@small_kernel
def six_of(values, at):
    """Every second of twelve rows."""
    return (
        values[np.uintp(at)], values[np.uintp(at + 2 * LANES)], values[np.uintp(at + 4 * LANES)],
        values[np.uintp(at + 6 * LANES)], values[np.uintp(at + 8 * LANES)], values[np.uintp(at + 10 * LANES)],
    )  # fmt: skip


@small_kernel
def products_of_six(a, b):
    """Sum of six products."""
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])


@kernel
def joint_blocks(k, m, pairs, of_exposure, joint):
    """Covariance W of the k rays of m cells from their orientations; blocks a ≤ b.

    Fills the rows 4 (k a + b) + 2 r + t of joint from those 2 (6 a + q) + r of of_exposure, the derivatives,
    with r = 0 for x and 1 for y of ray a.
    """
    for a in range(k):
        for b in range(a, k):
            at = 36 * (k * a + b)
            for n in range(m):
                x0, x1, x2, x3, x4, x5 = six_of(of_exposure, 12 * a * LANES + n)
                y0, y1, y2, y3, y4, y5 = six_of(of_exposure, (12 * a + 1) * LANES + n)
                x = (
                    column_of_six(x0, x1, x2, x3, x4, x5, pairs, at),
                    column_of_six(x0, x1, x2, x3, x4, x5, pairs, at + 1),
                    column_of_six(x0, x1, x2, x3, x4, x5, pairs, at + 2),
                    column_of_six(x0, x1, x2, x3, x4, x5, pairs, at + 3),
                    column_of_six(x0, x1, x2, x3, x4, x5, pairs, at + 4),
                    column_of_six(x0, x1, x2, x3, x4, x5, pairs, at + 5),
                )
                y = (
                    column_of_six(y0, y1, y2, y3, y4, y5, pairs, at),
                    column_of_six(y0, y1, y2, y3, y4, y5, pairs, at + 1),
                    column_of_six(y0, y1, y2, y3, y4, y5, pairs, at + 2),
                    column_of_six(y0, y1, y2, y3, y4, y5, pairs, at + 3),
                    column_of_six(y0, y1, y2, y3, y4, y5, pairs, at + 4),
                    column_of_six(y0, y1, y2, y3, y4, y5, pairs, at + 5),
                )
                other_x = six_of(of_exposure, 12 * b * LANES + n)
                other_y = six_of(of_exposure, (12 * b + 1) * LANES + n)
                own = 4 * (k * a + b) * LANES + n
                joint[np.uintp(own)] = products_of_six(x, other_x)
                joint[np.uintp(own + LANES)] = products_of_six(x, other_y)
                joint[np.uintp(own + 2 * LANES)] = products_of_six(y, other_x)
                joint[np.uintp(own + 3 * LANES)] = products_of_six(y, other_y)


@kernel
def add_systems(k, m, known, place, of_exposure, of_system, rows, joint):
    """Add what system parameters do to W: of_system has the rows 2 (w a + s) + r by the places (k, w) in z.

    rows is scratch, of 2 d rows.
    """
    d, width = known.shape[0], place.shape[1]
    for a in range(k):
        clear(rows, 12 * a * LANES, 2 * (d - 6 * a) * LANES)
        for i in range(6 * a, d):
            for r in range(2):
                own = (2 * i + r) * LANES
                if i >= 6 * k:
                    for q in range(6):
                        at = (2 * (6 * a + q) + r) * LANES
                        add_weighted(rows, own, known[i, 6 * a + q], of_exposure, at, m)
                for s in range(width):
                    if place[a, s] >= 0:
                        at = (2 * (width * a + s) + r) * LANES
                        add_weighted(rows, own, known[i, place[a, s]], of_system, at, m)
        for b in range(a, k):
            for r in range(2):
                for t in range(2):
                    own = (4 * (k * a + b) + 2 * r + t) * LANES
                    for q in range(6):
                        one, other = (2 * (6 * b + q) + r) * LANES, (2 * (6 * b + q) + t) * LANES
                        add_product(joint, own, rows, one, of_exposure, other, m)
                    for s in range(width):
                        if place[b, s] >= 0:
                            one, other = (2 * place[b, s] + r) * LANES, (2 * (width * b + s) + t) * LANES
                            add_product(joint, own, rows, one, of_system, other, m)


@kernel
def add_considered(k, m, errors, of_known, joint):
    """Add what considered parameters do to W: of_known has the rows 2 (errors · a + q) + r."""
    for a in range(k):
        for b in range(a, k):
            for r in range(2):
                for t in range(2):
                    own = (4 * (k * a + b) + 2 * r + t) * LANES
                    for q in range(errors):
                        one, other = 2 * (errors * a + q) + r, 2 * (errors * b + q) + t
                        add_product(joint, own, of_known, one * LANES, of_known, other * LANES, m)


@small_kernel
def add_movements(moved, own, gain, at, joint, w00, w10, w01, w11, m):
    """Add to six rows what the gains of a ray make of a block of W."""
    for n in range(m):
        i = at + n
        x0, x1, x2 = gain[np.uintp(i)], gain[np.uintp(i + LANES)], gain[np.uintp(i + 2 * LANES)]
        y0, y1, y2 = (
            gain[np.uintp(i + 3 * LANES)], gain[np.uintp(i + 4 * LANES)], gain[np.uintp(i + 5 * LANES)],
        )  # fmt: skip
        a, b = joint[np.uintp(w00 + n)], joint[np.uintp(w10 + n)]
        c, d = joint[np.uintp(w01 + n)], joint[np.uintp(w11 + n)]
        o = own + n
        moved[np.uintp(o)] += x0 * a + y0 * b
        moved[np.uintp(o + LANES)] += x1 * a + y1 * b
        moved[np.uintp(o + 2 * LANES)] += x2 * a + y2 * b
        moved[np.uintp(o + 3 * LANES)] += x0 * c + y0 * d
        moved[np.uintp(o + 4 * LANES)] += x1 * c + y1 * d
        moved[np.uintp(o + 5 * LANES)] += x2 * c + y2 * d


@kernel
def joint_movements(k, m, gain, joint, moved):
    """Fill the rows 3 j + c of moved with G W; those of gain are 3 j + c, too, of coordinate j = 2 a + r."""
    clear(moved, 0, 6 * k * LANES)
    for a in range(k):
        for b in range(a, k):
            xx = 4 * (k * a + b) * LANES
            xy, yx, yy = xx + LANES, xx + 2 * LANES, xx + 3 * LANES
            add_movements(moved, 6 * b * LANES, gain, 6 * a * LANES, joint, xx, yx, xy, yy, m)
            if b > a:
                add_movements(moved, 6 * a * LANES, gain, 6 * b * LANES, joint, xx, xy, yx, yy, m)
