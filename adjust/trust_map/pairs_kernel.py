"""Pairs of images that see a point, and which of them is the best one, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.solve.covisibility_kernel import find_block
from adjust.trust_map.lane_kernel import LANES


@small_kernel
def same_images(first, last, other_first, other_last, image):
    """Whether the rays of two cells are in the same images."""
    same = other_last - other_first == last - first
    if same:
        for a in range(last - first):
            same = same and image[first + a] == image[other_first + a]
    return same


@kernel
def runs_of_images(start, image):
    """Runs of cells with the same images: first and last + 1 cell (n, 2), and a hash of these images (n,)."""
    cells = start.shape[0] - 1
    runs, keys = np.empty((cells, 2), np.int64), np.empty(cells, np.int64)
    count = 0
    for j in range(cells):
        first, last = start[j], start[j + 1]
        if count and same_images(first, last, start[j - 1], first, image):
            runs[count - 1, 1] = j + 1
            continue
        key = 0
        for a in range(first, last):
            key = (key * 1_000_003 + image[a] + 1) % 2_147_483_647
        runs[count, 0], runs[count, 1], keys[count] = j, j + 1, key
        count += 1
    return runs[:count], keys[:count]


@kernel
def missing_pairs(start, image, row_start, column, images):
    """Keys row · images + column of pairs of images that see a cell and have no block; with repetitions.

    A cell with the images of the one before is not looked at.
    """
    found = np.empty(0, np.int64)
    for fill in range(2):
        count = 0
        for j in range(start.shape[0] - 1):
            first, last = start[j], start[j + 1]
            if j > 0 and same_images(first, last, start[j - 1], first, image):
                continue
            for a in range(first, last):
                for b in range(a + 1, last):
                    if find_block(row_start, column, image[a], image[b]) < 0:
                        if fill == 1:
                            found[count] = image[a] * images + image[b]
                        count += 1
        if fill == 0:
            found = np.empty(count, np.int64)
    return found


@small_kernel
def invert(matrix, inverse):
    """Inverse of a symmetric 3 × 3 matrix by its adjugate; false where it is singular to rounding."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    i00, i01, i02 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * i00 + b * i01 + c * i02
    if not determinant > 1e-13 * a * d * f:
        return False
    factor = 1.0 / determinant
    inverse[0, 0] = i00 * factor
    inverse[0, 1] = inverse[1, 0] = i01 * factor
    inverse[0, 2] = inverse[2, 0] = i02 * factor
    inverse[1, 1] = (a * f - c * c) * factor
    inverse[1, 2] = inverse[2, 1] = (b * c - a * e) * factor
    inverse[2, 2] = (a * d - b * b) * factor
    return True


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
def inverse_of_pair(lane, a, b, normals, normal, inverse):
    """Fill inverse with (Aᵀ A)⁻¹ of two rays; false where it is singular. normal (3, 3) is scratch."""
    at = 0
    for c in range(3):
        for q in range(c, 3):
            normal[c, q] = normals[(6 * a + at) * LANES + lane] + normals[(6 * b + at) * LANES + lane]
            at += 1
    return invert(normal, inverse)


@kernel
def variance_of_pair(lane, k, a, b, c, inverse, of_point, joint, variance):
    """Variance of coordinate c of a cell's point from the rays a and b, whose normals have the inverse."""
    i, j = 6 * a * LANES + lane, 6 * b * LANES + lane
    x, y, z = inverse[c, 0], inverse[c, 1], inverse[c, 2]
    ax = x * of_point[i] + y * of_point[i + LANES] + z * of_point[i + 2 * LANES]
    ay = x * of_point[i + 3 * LANES] + y * of_point[i + 4 * LANES] + z * of_point[i + 5 * LANES]
    bx = x * of_point[j] + y * of_point[j + LANES] + z * of_point[j + 2 * LANES]
    by = x * of_point[j + 3 * LANES] + y * of_point[j + 4 * LANES] + z * of_point[j + 5 * LANES]
    one, both = 4 * (k * a + a) * LANES + lane, 4 * (k * a + b) * LANES + lane
    other = 4 * (k * b + b) * LANES + lane
    value = ax * (ax * joint[one] + 2.0 * ay * joint[one + LANES]) + ay * ay * joint[one + 3 * LANES]
    value += bx * (bx * joint[other] + 2.0 * by * joint[other + LANES]) + by * by * joint[other + 3 * LANES]
    value += 2.0 * ax * (bx * joint[both] + by * joint[both + LANES])
    value += 2.0 * ay * (bx * joint[both + 2 * LANES] + by * joint[both + 3 * LANES])
    return variance * inverse[c, c] + value


@kernel
def best_pair(lane, k, guess, bounds, normals, of_point, joint, variance, normal, inverse):
    """The two rays a < b with the smallest variance of the third coordinate, as k a + b; −1 without.

    The guess, the best pair of a cell beside or −1, is looked at first: what the orientations add is not
    negative, so that few others, whose bound is smaller, can be better.
    """
    best, found = np.inf, -1
    if guess >= 0:
        a, b = guess // k, guess % k
        if bounds[guess * LANES + lane] < best and inverse_of_pair(lane, a, b, normals, normal, inverse):
            best = variance_of_pair(lane, k, a, b, 2, inverse, of_point, joint, variance)
            found = guess
    for a in range(k):
        for b in range(a + 1, k):
            pair = k * a + b
            if pair == guess or bounds[pair * LANES + lane] >= best:
                continue
            if inverse_of_pair(lane, a, b, normals, normal, inverse):
                value = variance_of_pair(lane, k, a, b, 2, inverse, of_point, joint, variance)
                if value < best:
                    best, found = value, pair
    return found
