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
def gather(first, last, image, used, cofactor, scale, known):
    """Put Q, multiplied by scale, of the images first … last − 1, ascending, into known (d, d).

    cofactor is row_start and column of the pattern with blocks, border and corner of
    :class:`~adjust.solve.factorization.ReducedCofactor`.
    """
    row_start, column, blocks, border, corner = cofactor
    k = last - first
    for a in range(k):
        for b in range(a, k):
            block = find_block(row_start, column, image[first + a], image[first + b])
            for p in range(6):
                for q in range(6):
                    value = scale * blocks[block, p, q]
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
def six_of(values, at, step):
    """Six numbers that are so far apart."""
    return (
        values[np.uintp(at)], values[np.uintp(at + step)], values[np.uintp(at + 2 * step)],
        values[np.uintp(at + 3 * step)], values[np.uintp(at + 4 * step)], values[np.uintp(at + 5 * step)],
    )  # fmt: skip


@small_kernel
def products_of_six(a, b):
    """Sum of six products."""
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5])


@small_kernel
def times_block(x, space, at, d):
    """Six numbers times a block (6, 6) of a matrix of d columns that begins at a place."""
    return (
        products_of_six(x, six_of(space, at, d)), products_of_six(x, six_of(space, at + 1, d)),
        products_of_six(x, six_of(space, at + 2, d)), products_of_six(x, six_of(space, at + 3, d)),
        products_of_six(x, six_of(space, at + 4, d)), products_of_six(x, six_of(space, at + 5, d)),
    )  # fmt: skip


@kernel
def own_covariances(k, m, d, space, of_exposure, own):
    """Covariances of x and y of every ray from its orientation: rows 3 a … of own get xx, xy, yy."""
    for a in range(k):
        at, x_row, o = 6 * a * d + 6 * a, 12 * a * LANES, 3 * a * LANES
        for n in range(m):
            x = six_of(of_exposure, x_row + n, 2 * LANES)
            y = six_of(of_exposure, x_row + LANES + n, 2 * LANES)
            of_x, of_y = times_block(x, space, at, d), times_block(y, space, at, d)
            own[np.uintp(o + n)] = products_of_six(of_x, x)
            own[np.uintp(o + LANES + n)] = products_of_six(of_x, y)
            own[np.uintp(o + 2 * LANES + n)] = products_of_six(of_y, y)


@kernel
def system_covariances(k, m, known, place, of_exposure, of_system, crossing, both):
    """What system parameters have in common with the rays: rows 2 (s a + u) + r for the s of them.

    crossing gets Q_sa B_aᵀ of the orientation alone, both that of the orientation and the system parameters.
    """
    d, width = known.shape[0], place.shape[1]
    s = d - 6 * k
    for a in range(k):
        for u in range(s):
            for r in range(2):
                own = (2 * (s * a + u) + r) * LANES
                clear(crossing, own, m)
                for q in range(6):
                    at = (2 * (6 * a + q) + r) * LANES
                    add_weighted(crossing, own, known[6 * k + u, 6 * a + q], of_exposure, at, m)
                for n in range(m):
                    both[own + n] = crossing[own + n]
                for t in range(width):
                    if place[a, t] >= 0:
                        at = (2 * (width * a + t) + r) * LANES
                        add_weighted(both, own, known[6 * k + u, place[a, t]], of_system, at, m)


@kernel
def add_systems_and_errors(k, m, s, place, of_system, crossing, both, errors, of_known, own):
    """Add to own what s system parameters and considered errors do to every ray."""
    width = place.shape[1]
    for a in range(k):
        for r in range(2):
            for t in range(r, 2):
                o = (3 * a + r + t) * LANES
                for c in range(width if s > 0 else 0):
                    if place[a, c] >= 0:
                        u, at = 2 * (s * a + place[a, c] - 6 * k), 2 * (width * a + c)
                        add_product(own, o, of_system, (at + t) * LANES, crossing, (u + r) * LANES, m)
                        add_product(own, o, of_system, (at + r) * LANES, both, (u + t) * LANES, m)
                for q in range(errors):
                    at = 2 * (errors * a + q)
                    add_product(own, o, of_known, (at + r) * LANES, of_known, (at + t) * LANES, m)


@kernel
def joint_movements(k, m, place, movement, of_exposure, of_system, errors, of_errors, of_known, moved):
    """Fill the rows 3 j + c of moved with G W of coordinate j = 2 a + r; movement (d, 3, m) is Q Fᵀ."""
    width = place.shape[1]
    for a in range(k):
        for r in range(2):
            for c in range(3):
                own, u = (3 * (2 * a + r) + c) * LANES, (18 * a + c) * m
                for n in range(m):
                    x = six_of(of_exposure, (12 * a + r) * LANES + n, 2 * LANES)
                    moved[np.uintp(own + n)] = products_of_six(six_of(movement, u + n, 3 * m), x)
                for s in range(width):
                    if place[a, s] >= 0:
                        u, at = (3 * place[a, s] + c) * m, (2 * (width * a + s) + r) * LANES
                        add_product(moved, own, movement, u, of_system, at, m)
                for q in range(errors):
                    at = (2 * (errors * a + q) + r) * LANES
                    add_product(moved, own, of_errors, (3 * q + c) * m, of_known, at, m)
