"""Covariances of new ground points from all images that see them and from their best pair, compiled.

With the whitened derivatives A of the rays of a point by its coordinates and B by the orientations and system
parameters z of the images, whose joint covariance is Q,

    G = (Aᵀ A)⁻¹ Aᵀ,    W = B Q Bᵀ,    C = (Aᵀ A)⁻¹ + G W Gᵀ.

W holds every pair of rays, so each pair of images is a part of it.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.solve.covisibility_kernel import find_block


@kernel
def missing_pairs(start, image, row_start, column, images):
    """Keys row · images + column of pairs of images that see a cell and have no block; with repetitions."""
    found = np.empty(0, np.int64)
    for fill in range(2):
        count = 0
        for j in range(start.shape[0] - 1):
            for a in range(start[j], start[j + 1]):
                for b in range(a + 1, start[j + 1]):
                    if find_block(row_start, column, image[a], image[b]) < 0:
                        if fill == 1:
                            found[count] = image[a] * images + image[b]
                        count += 1
        if fill == 0:
            found = np.empty(count, np.int64)
    return found


@kernel
def invert(matrix, inverse):
    """Inverse of a symmetric 3 × 3 matrix by its adjugate; false where it is singular to rounding."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    inverse[0, 0] = d * f - e * e
    inverse[0, 1] = c * e - b * f
    inverse[0, 2] = b * e - c * d
    inverse[1, 1] = a * f - c * c
    inverse[1, 2] = b * c - a * e
    inverse[2, 2] = a * d - b * b
    determinant = a * inverse[0, 0] + b * inverse[0, 1] + c * inverse[0, 2]
    if not determinant > 1e-13 * a * d * f:
        return False
    for k in range(3):
        for q in range(k, 3):
            inverse[k, q] /= determinant
            inverse[q, k] = inverse[k, q]
    return True


@kernel
def joint_blocks(first, last, image, of_exposure, count, found, of_system, of_known,
                 row_start, column, blocks, border, corner, scale, joint):  # fmt: skip
    """Covariance W (2k, 2k) of the k rays first … last − 1 that comes from orientations and system parameters.

    Images ascend. of_system (r, 2, w) has the derivatives by the columns found (r, w) of the border, the first
    count (r,) of them; of_known (r, 2, q) the errors of considered parameters. Q is multiplied by scale.
    """
    half = np.zeros((2, 6))
    for a in range(first, last):
        e = image[a]
        for b in range(a, last):
            f = image[b]
            block = find_block(row_start, column, e, f)
            for r in range(2):
                for q in range(6):
                    value = 0.0
                    for k in range(6):
                        value += of_exposure[a, r, k] * blocks[block, k, q]
                    for s in range(count[a]):
                        value += of_system[a, r, s] * border[f, q, found[a, s]]
                    half[r, q] = value
            for r in range(2):
                for t in range(2):
                    value = 0.0
                    for q in range(6):
                        value += half[r, q] * of_exposure[b, t, q]
                    for u in range(count[b]):
                        column_b = found[b, u]
                        part = 0.0
                        for k in range(6):
                            part += of_exposure[a, r, k] * border[e, k, column_b]
                        for s in range(count[a]):
                            part += of_system[a, r, s] * corner[found[a, s], column_b]
                        value += part * of_system[b, t, u]
                    value *= scale
                    for q in range(of_known.shape[2]):
                        value += of_known[a, r, q] * of_known[b, t, q]
                    i, j = 2 * (a - first) + r, 2 * (b - first) + t
                    joint[i, j] = value
                    joint[j, i] = value


@kernel
def add_normal(of_point, a, normal):
    """Add Aᵀ A of one ray."""
    for r in range(2):
        for k in range(3):
            for q in range(3):
                normal[k, q] += of_point[a, r, k] * of_point[a, r, q]


@kernel
def of_all_rays(first, last, of_point, joint, critical, least_control, gain, moved, sigma, external):
    """σ (3,) of a point from all its rays, and largest effects (3,) of an undetected error in one of them.

    The residual of coordinate i has the variance (R (I + W) Rᵀ)_ii with R = I − A G. An error of

        ∇ = δ0 σ_v / R_ii

    is found with the power that belongs to δ0, and moves the point by G_i ∇. Returns the number of coordinates
    with R_ii below the least control, whose errors show in no residual and are not counted; −1 where
    the rays do not determine the point.
    """
    rays = 2 * (last - first)
    normal, inverse, inside = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for a in range(first, last):
        add_normal(of_point, a, normal)
    if not invert(normal, inverse):
        return -1
    for i in range(rays):
        a, r = first + i // 2, i % 2
        for k in range(3):
            value = 0.0
            for q in range(3):
                value += inverse[k, q] * of_point[a, r, q]
            gain[k, i] = value
    for k in range(3):
        for j in range(rays):
            value = 0.0
            for i in range(rays):
                value += gain[k, i] * joint[i, j]
            moved[k, j] = value
    for k in range(3):
        for q in range(3):
            value = 0.0
            for i in range(rays):
                value += moved[k, i] * gain[q, i]
            inside[k, q] = value
        sigma[k] = np.sqrt(inverse[k, k] + inside[k, k])
        external[k] = 0.0
    uncontrolled = 0
    for i in range(rays):
        a, r = first + i // 2, i % 2
        hat, variance = 0.0, joint[i, i]
        for k in range(3):
            hat += of_point[a, r, k] * gain[k, i]
            variance -= 2.0 * of_point[a, r, k] * moved[k, i]
            for q in range(3):
                variance += of_point[a, r, k] * inside[k, q] * of_point[a, r, q]
        control = 1.0 - hat
        if control < least_control:
            uncontrolled += 1
            continue
        error = critical * np.sqrt(max(control + variance, 0.0)) / control
        for k in range(3):
            external[k] = max(external[k], abs(gain[k, i]) * error)
    return uncontrolled


@kernel
def of_best_pair(first, last, of_point, joint, sigma):
    """σ (3,) of a point from the two rays that give the smallest σ of its third coordinate; unchanged without."""
    normal, inverse = np.zeros((3, 3)), np.zeros((3, 3))
    gain, moved = np.zeros((3, 4)), np.zeros((3, 4))
    place = np.zeros(4, np.int64)
    best = np.inf
    for a in range(first, last):
        for b in range(a + 1, last):
            normal[:] = 0.0
            add_normal(of_point, a, normal)
            add_normal(of_point, b, normal)
            # The rest of the covariance is not negative, so this pair cannot be the best one any more.
            if not invert(normal, inverse) or inverse[2, 2] >= best:
                continue
            for r in range(2):
                place[r], place[2 + r] = 2 * (a - first) + r, 2 * (b - first) + r
                for k in range(3):
                    one, other = 0.0, 0.0
                    for q in range(3):
                        one += inverse[k, q] * of_point[a, r, q]
                        other += inverse[k, q] * of_point[b, r, q]
                    gain[k, r], gain[k, 2 + r] = one, other
            for k in range(3):
                variance = inverse[k, k]
                for i in range(4):
                    for j in range(4):
                        variance += gain[k, i] * joint[place[i], place[j]] * gain[k, j]
                moved[k, 0] = variance
            if moved[2, 0] < best:
                best = moved[2, 0]
                for k in range(3):
                    sigma[k] = np.sqrt(moved[k, 0])


@kernel
def relative(first, last, other_first, other_last, image, of_exposure, of_point, count, found, of_system,
             of_known, row_start, column, blocks, border, corner, scale, sigma):  # fmt: skip
    """σ (3,) of the difference of two points, both measured in the images that see both; unchanged without two.

    C = M_a⁻¹ + M_b⁻¹ + F Q Fᵀ with F = G_a B_a − G_b B_b, image by image.
    """
    common = np.empty((last - first, 2), np.int64)
    k, b = 0, other_first
    for a in range(first, last):
        while b < other_last and image[b] < image[a]:
            b += 1
        if b < other_last and image[b] == image[a]:
            common[k, 0], common[k, 1] = a, b
            k += 1
    if k < 2:
        return
    width, known = of_system.shape[2], of_known.shape[2]
    inverses = np.zeros((2, 3, 3))
    for side in range(2):
        normal = np.zeros((3, 3))
        for i in range(k):
            add_normal(of_point, common[i, side], normal)
        if not invert(normal, inverses[side]):
            return
    of_images = np.zeros((k, 3, 6))
    of_border = np.zeros((k, 3, 2 * width))
    columns = np.zeros((k, 2 * width), np.int64)
    counts = np.zeros(k, np.int64)
    of_errors = np.zeros((3, known))
    gain = np.zeros((3, 2))
    for i in range(k):
        for side in range(2):
            ray, sign = common[i, side], 1.0 - 2.0 * side
            for r in range(2):
                for c in range(3):
                    value = 0.0
                    for q in range(3):
                        value += inverses[side, c, q] * of_point[ray, r, q]
                    gain[c, r] = sign * value
            for c in range(3):
                for r in range(2):
                    for q in range(6):
                        of_images[i, c, q] += gain[c, r] * of_exposure[ray, r, q]
                    for q in range(known):
                        of_errors[c, q] += gain[c, r] * of_known[ray, r, q]
            for s in range(count[ray]):
                columns[i, counts[i]] = found[ray, s]
                for c in range(3):
                    of_border[i, c, counts[i]] = (
                        gain[c, 0] * of_system[ray, 0, s] + gain[c, 1] * of_system[ray, 1, s]
                    )
                counts[i] += 1
    for c in range(3):
        variance = 0.0
        for i in range(k):
            e = image[common[i, 0]]
            for j in range(i, k):
                f = image[common[j, 0]]
                block = find_block(row_start, column, e, f)
                part = 0.0
                for p in range(6):
                    for q in range(6):
                        part += of_images[i, c, p] * blocks[block, p, q] * of_images[j, c, q]
                    for s in range(counts[j]):
                        part += of_images[i, c, p] * border[e, p, columns[j, s]] * of_border[j, c, s]
                    for s in range(counts[i]):
                        part += of_border[i, c, s] * border[f, p, columns[i, s]] * of_images[j, c, p]
                for s in range(counts[i]):
                    for t in range(counts[j]):
                        part += of_border[i, c, s] * corner[columns[i, s], columns[j, t]] * of_border[j, c, t]
                variance += part if i == j else 2.0 * part
        variance *= scale
        for q in range(known):
            variance += of_errors[c, q] ** 2
        sigma[c] = np.sqrt(variance + inverses[0, c, c] + inverses[1, c, c])


@kernel
def cell_accuracies(
    start, neighbour, image, of_exposure, of_point, of_system, of_known, columns, row_start, column, blocks,
    border, corner, scale, critical, least_control, sigma, sigma_of_pair, sigma_relative, external, uncontrolled,
):  # fmt: skip
    """Everything about the m cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

    Derivatives are whitened: of_exposure (r, 2, 6), of_point (r, 2, 3), of_system (r, 2, w) by the columns
    (n, w) of the border of each image (−1: held), of_known (r, 2, q) the effects of considered parameters.
    Fills sigma, sigma_of_pair, sigma_relative and external (m, 3) and uncontrolled (m,); cells of fewer than two
    rays keep what is there.
    """
    rays, width = image.shape[0], columns.shape[1]
    count, found = np.zeros(rays, np.int64), np.zeros((rays, width), np.int64)
    for a in range(rays):
        for s in range(width):
            g = columns[image[a], s]
            if g >= 0 and (of_system[a, 0, s] != 0.0 or of_system[a, 1, s] != 0.0):
                of_system[a, 0, count[a]] = of_system[a, 0, s]
                of_system[a, 1, count[a]] = of_system[a, 1, s]
                found[a, count[a]] = g
                count[a] += 1
    most = 0
    for j in range(start.shape[0] - 1):
        most = max(most, 2 * (start[j + 1] - start[j]))
    joint, gain, moved = np.zeros((most, most)), np.zeros((3, most)), np.zeros((3, most))
    for j in range(start.shape[0] - 1):
        first, last = start[j], start[j + 1]
        if last - first < 2:
            continue
        joint_blocks(
            first, last, image, of_exposure, count, found, of_system, of_known, row_start, column, blocks,
            border, corner, scale, joint,
        )  # fmt: skip
        uncontrolled[j] = of_all_rays(
            first, last, of_point, joint, critical, least_control, gain, moved, sigma[j], external[j]
        )
        of_best_pair(first, last, of_point, joint, sigma_of_pair[j])
        other = neighbour[j]
        if other >= 0:
            relative(
                first, last, start[other], start[other + 1], image, of_exposure, of_point, count, found,
                of_system, of_known, row_start, column, blocks, border, corner, scale, sigma_relative[j],
            )  # fmt: skip
