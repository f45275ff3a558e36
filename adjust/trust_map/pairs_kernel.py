"""Pairs of images that see a point, and which of them is the best one, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.solve.covisibility_kernel import find_block
from adjust.trust_map.groups_kernel import largest_step, same_images
from adjust.trust_map.joint_kernel import products_of_six, six_of, times_block
from adjust.trust_map.lane_kernel import LANES, set_six_rows, six_rows

# Pairs that have been looked at are remembered by their keys modulo this number.
_RECENT = 1 << 14


@kernel
def missing_pairs(start, image, row_start, column, images):
    """Keys row · images + column of pairs of images that see a cell and have no block; with few repetitions.

    Only pairs that do not see the cell before, too, are looked at.
    """
    found, count, most = np.empty(1024, np.int64), 0, largest_step(start)
    recent, new = np.full(_RECENT, -1, np.int64), np.zeros(most, np.bool_)
    for j in range(start.shape[0] - 1):
        first, last, before = start[j], start[j + 1], start[max(j - 1, 0)]
        if j > 0 and same_images(first, last, before, first, image):
            continue
        for a in range(first, last):
            while before < first and image[before] < image[a]:
                before += 1
            new[a - first] = before == first or image[before] != image[a]
        for a in range(first, last):
            for b in range(a + 1, last):
                key = image[a] * images + image[b]
                if not (new[a - first] or new[b - first]) or recent[key % _RECENT] == key:
                    continue
                recent[key % _RECENT] = key
                if find_block(row_start, column, image[a], image[b]) < 0:
                    if count == found.shape[0]:
                        found = np.concatenate((found, np.empty_like(found)))
                    found[count] = key
                    count += 1
    return found[:count]


@kernel
def height_bounds(k, m, normals, variance, bounds):
    """Least variances of the third coordinate from two rays: what the image coordinates alone contribute.

    Rows 6 a … of normals are the upper triangles of the Aᵀ A of ray a; fills the rows k a + b of bounds,
    a < b, for m cells.
    """
    for a in range(k):
        for b in range(a + 1, k):
            own = (k * a + b) * LANES
            for n in range(m):
                i, j = 6 * a * LANES + n, 6 * b * LANES + n
                xx = normals[np.uintp(i)] + normals[np.uintp(j)]
                xy = normals[np.uintp(i + LANES)] + normals[np.uintp(j + LANES)]
                xz = normals[np.uintp(i + 2 * LANES)] + normals[np.uintp(j + 2 * LANES)]
                yy = normals[np.uintp(i + 3 * LANES)] + normals[np.uintp(j + 3 * LANES)]
                yz = normals[np.uintp(i + 4 * LANES)] + normals[np.uintp(j + 4 * LANES)]
                zz = normals[np.uintp(i + 5 * LANES)] + normals[np.uintp(j + 5 * LANES)]
                plan = xx * yy - xy * xy
                determinant = zz * plan - xx * yz * yz + 2.0 * xy * xz * yz - yy * xz * xz
                bounds[np.uintp(own + n)] = variance * plan / determinant if determinant > 0.0 else np.inf


@kernel
def inverses_of_pair(m, a, b, normals, rows):
    """Fill six rows with (Aᵀ A)⁻¹ of two rays of m cells, and a seventh with 0, or ∞ where it is singular."""
    for n in range(m):
        i, j = 6 * a * LANES + n, 6 * b * LANES + n
        xx, xy, xz, yy, yz, zz = six_rows(normals, i)
        uu, uv, uw, vv, vw, ww = six_rows(normals, j)
        xx, xy, xz, yy, yz, zz = xx + uu, xy + uv, xz + uw, yy + vv, yz + vw, zz + ww
        i00, i01, i02 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        determinant = xx * i00 + xy * i01 + xz * i02
        there = determinant > 1e-13 * xx * yy * zz
        factor = 1.0 / determinant if there else 0.0
        set_six_rows(
            rows, n, i00 * factor, i01 * factor, i02 * factor, (xx * zz - xz * xz) * factor,
            (xy * xz - xx * yz) * factor, (xx * yy - xy * xy) * factor,
        )  # fmt: skip
        rows[np.uintp(n + 6 * LANES)] = 0.0 if there else np.inf


@kernel
def variances_of_pair(
    k, m, a, b, c, d, space, place, of_point, own, of_exposure, of_system, crossing, both, errors, of_known,
    variance, rows, found,
):  # fmt: skip
    """Fill row c of found with the variances of coordinate c of m cells from the rays a < b; ∞: no point.

    rows has what `inverses_of_pair` fills in, and four more of scratch. The rows 3 a … of own are the
    covariances xx, xy, yy of ray a, those of crossing and both as of `system_covariances`.
    """
    u, v, w = (0, 1, 2) if c == 0 else ((1, 3, 4) if c == 1 else (2, 4, 5))
    diagonal = u if c == 0 else (v if c == 1 else w)
    at = 6 * a * d + 6 * b
    for n in range(m):
        i, j = 6 * a * LANES + n, 6 * b * LANES + n
        x, y, z = rows[np.uintp(u * LANES + n)], rows[np.uintp(v * LANES + n)], rows[np.uintp(w * LANES + n)]
        one, other = six_rows(of_point, i), six_rows(of_point, j)
        ax, ay = x * one[0] + y * one[1] + z * one[2], x * one[3] + y * one[4] + z * one[5]
        bx, by = x * other[0] + y * other[1] + z * other[2], x * other[3] + y * other[4] + z * other[5]
        o = 7 * LANES + n
        rows[np.uintp(o)], rows[np.uintp(o + LANES)] = ax, ay
        rows[np.uintp(o + 2 * LANES)], rows[np.uintp(o + 3 * LANES)] = bx, by
    for n in range(m):
        o = 7 * LANES + n
        ax, ay = rows[np.uintp(o)], rows[np.uintp(o + LANES)]
        bx, by = rows[np.uintp(o + 2 * LANES)], rows[np.uintp(o + 3 * LANES)]
        one = weighed_six(
            ax, six_of(of_exposure, 12 * a * LANES + n, 2 * LANES),
            ay, six_of(of_exposure, (12 * a + 1) * LANES + n, 2 * LANES),
        )  # fmt: skip
        other = weighed_six(
            bx, six_of(of_exposure, 12 * b * LANES + n, 2 * LANES),
            by, six_of(of_exposure, (12 * b + 1) * LANES + n, 2 * LANES),
        )  # fmt: skip
        value = 2.0 * products_of_six(times_block(one, space, at, d), other)
        i, j = 3 * a * LANES + n, 3 * b * LANES + n
        value += ax * (ax * own[np.uintp(i)] + 2.0 * ay * own[np.uintp(i + LANES)])
        value += ay * ay * own[np.uintp(i + 2 * LANES)]
        value += bx * (bx * own[np.uintp(j)] + 2.0 * by * own[np.uintp(j + LANES)])
        value += by * by * own[np.uintp(j + 2 * LANES)]
        value += variance * rows[np.uintp(diagonal * LANES + n)] + rows[np.uintp(6 * LANES + n)]
        found[np.uintp(c * LANES + n)] = value
    s, width = d - 6 * k, place.shape[1]
    for t in range(width if s > 0 else 0):
        if place[b, t] >= 0:
            add_crossed(
                m, s * a + place[b, t] - 6 * k, 7, crossing, width * b + t, 9, of_system, rows, found, c
            )
        if place[a, t] >= 0:
            add_crossed(m, s * b + place[a, t] - 6 * k, 9, both, width * a + t, 7, of_system, rows, found, c)
    for q in range(errors):
        add_crossed(m, errors * a + q, 7, of_known, errors * b + q, 9, of_known, rows, found, c)


@small_kernel
def add_crossed(m, i, of_i, one, j, of_j, other, rows, found, c):
    """Add twice the product of two pairs of rows, 2 i and 2 j, each weighed with two rows."""
    for n in range(m):
        x, y = one[2 * i * LANES + n], one[(2 * i + 1) * LANES + n]
        u, v = other[2 * j * LANES + n], other[(2 * j + 1) * LANES + n]
        p = rows[of_i * LANES + n] * x + rows[(of_i + 1) * LANES + n] * y
        found[c * LANES + n] += 2.0 * p * (rows[of_j * LANES + n] * u + rows[(of_j + 1) * LANES + n] * v)


@small_kernel
def weighed_six(p, a, q, b):
    """Sum of two times six numbers, each with its weight."""
    return (
        p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2],
        p * a[3] + q * b[3], p * a[4] + q * b[4], p * a[5] + q * b[5],
    )  # fmt: skip


@small_kernel
def number_below(m, x, at, y):
    """How many of m numbers of a row are smaller than those of another array."""
    count = 0
    for n in range(m):
        count += 1 if x[np.uintp(at + n)] < y[np.uintp(n)] else 0
    return count


@kernel
def best_pairs(
    k, m, d, guess, bounds, normals, space, place, of_point, own, of_exposure, of_system, crossing, both,
    errors, of_known, variance, rows, best, chosen, found, of_pair,
):  # fmt: skip
    """Fill three rows of of_pair with the variances from the two rays that give the smallest third one.

    chosen (m,) gets this pair a < b as k a + b, or −1 without one. The guess, the best pair of a cell beside
    or −1, is looked at first: what the orientations add is not negative, so that few others, whose bound is
    smaller, can be better. rows (11), best (1) and found (3) are scratch.
    """
    best[:], chosen[:], height = np.inf, -1, np.int64(2)
    for first in range(-1 if guess >= 0 else 0, k):
        # The guess alone, then all pairs of each image.
        begin, end = (guess % k, guess % k + 1) if first < 0 else (first + 1, k)
        a = guess // k if first < 0 else first
        for b in range(begin, end):
            pair = k * a + b
            if (first >= 0 and pair == guess) or number_below(m, bounds, pair * LANES, best) == 0:
                continue
            inverses_of_pair(m, a, b, normals, rows)
            variances_of_pair(
                k, m, a, b, height, d, space, place, of_point, own, of_exposure, of_system, crossing, both,
                errors, of_known, variance, rows, found,
            )  # fmt: skip
            for n in range(m):
                if found[2 * LANES + n] < best[n]:
                    best[n], chosen[n] = found[2 * LANES + n], pair
    for n in range(m):
        pair, of_pair[2 * LANES + n] = chosen[n], best[n]
        for before in range(n):
            if chosen[before] == pair:
                pair = -1
        if pair < 0:
            continue
        inverses_of_pair(m, pair // k, pair % k, normals, rows)
        for c in range(2):
            variances_of_pair(
                k, m, pair // k, pair % k, c, d, space, place, of_point, own, of_exposure, of_system,
                crossing, both, errors, of_known, variance, rows, found,
            )  # fmt: skip
            for lane in range(m):
                if chosen[lane] == pair:
                    of_pair[c * LANES + lane] = found[c * LANES + lane]
