"""Pairs of images that see a point, and the small matrices of its rays, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.solve.covisibility_kernel import find_block


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
