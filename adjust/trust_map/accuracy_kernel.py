"""Covariances of new ground points from all images that see them and from their best pair, compiled.

With the derivatives A of the rays of a point by its coordinates and B by the orientations and system
parameters z of the images, whose joint covariance is Q, and image coordinates of variance s²,

    G = (Aᵀ A)⁻¹ Aᵀ,    W = B Q Bᵀ,    C = s² (Aᵀ A)⁻¹ + G W Gᵀ.

W holds every pair of rays, so each pair of images is a part of it. Scratch arrays are made once for all
cells.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.trust_map.pairs_kernel import along_row, find_positions, invert
from adjust.trust_map.relative_kernel import relative


@kernel
def joint_blocks(
    first, last, image, position, of_exposure, count, found, of_system, of_known, blocks, border, corner,
    scale, of_pair, joint,
):  # fmt: skip
    """Covariance W (2k, 2k) of the k rays first … last − 1 from orientations and system parameters.

    of_system (r, 2, w) has the derivatives by the columns found (r, w) of the border, the first count (r,) of
    them; of_known (r, 2, q) the errors of considered parameters. Q is multiplied by scale.
    """
    for a in range(first, last):
        e = image[a]
        for b in range(a, last):
            f = image[b]
            block = position[a - first, b - first]
            xx, xy, yx, yy = 0.0, 0.0, 0.0, 0.0
            for k in range(6):
                x = along_row(blocks, block, k, of_exposure, b, 0)
                y = along_row(blocks, block, k, of_exposure, b, 1)
                xx += of_exposure[a, 0, k] * x
                xy += of_exposure[a, 0, k] * y
                yx += of_exposure[a, 1, k] * x
                yy += of_exposure[a, 1, k] * y
            of_pair[0, 0], of_pair[0, 1], of_pair[1, 0], of_pair[1, 1] = xx, xy, yx, yy
            for r in range(2):
                for t in range(2):
                    value = of_pair[r, t]
                    for s in range(count[a]):
                        for q in range(6):
                            value += of_system[a, r, s] * border[f, q, found[a, s]] * of_exposure[b, t, q]
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
def normals_of_rays(first, last, of_point, normals):
    """Aᵀ A (k, 3, 3) of each of the k rays."""
    for a in range(first, last):
        for k in range(3):
            for q in range(3):
                normals[a - first, k, q] = (
                    of_point[a, 0, k] * of_point[a, 0, q] + of_point[a, 1, k] * of_point[a, 1, q]
                )


@kernel
def of_all_rays(
    cell, first, last, of_point, normals, joint, variance, critical, least_control, normal, inverse, gain,
    moved, sigma, external,
):  # fmt: skip
    """σ of a cell's point from all its rays, and the largest effects of an undetected error in one of them.

    The residual of coordinate i has the variance (R (s² I + W) Rᵀ)_ii with R = I − A G. An error of

        ∇ = δ0 σ_v / R_ii

    is found with the power that belongs to δ0, and moves the point by G_i ∇. Returns the number of
    coordinates with R_ii below the least control, whose errors show in no residual and are not counted;
    −1 where the rays do not determine the point. Fills one row of sigma and external (m, 3).
    """
    rays = 2 * (last - first)
    normal[:] = 0.0
    for a in range(last - first):
        for k in range(3):
            for q in range(3):
                normal[k, q] += normals[a, k, q]
    if not invert(normal, inverse):
        return -1
    for i in range(rays):
        a, r = first + i // 2, i % 2
        for k in range(3):
            gain[k, i] = (
                inverse[k, 0] * of_point[a, r, 0]
                + inverse[k, 1] * of_point[a, r, 1]
                + inverse[k, 2] * of_point[a, r, 2]
            )
    for k in range(3):
        for j in range(rays):
            moved[k, j] = 0.0
        for i in range(rays):
            for j in range(rays):
                moved[k, j] += gain[k, i] * joint[i, j]
    # From here on ``normal`` is G W Gᵀ.
    for k in range(3):
        for q in range(3):
            value = 0.0
            for i in range(rays):
                value += moved[k, i] * gain[q, i]
            normal[k, q] = value
        sigma[cell, k] = np.sqrt(variance * inverse[k, k] + normal[k, k])
        external[cell, k] = 0.0
    uncontrolled = 0
    for i in range(rays):
        a, r = first + i // 2, i % 2
        hat, spread = 0.0, joint[i, i]
        for k in range(3):
            hat += of_point[a, r, k] * gain[k, i]
            spread -= 2.0 * of_point[a, r, k] * moved[k, i]
            for q in range(3):
                spread += of_point[a, r, k] * normal[k, q] * of_point[a, r, q]
        control = 1.0 - hat
        if control < least_control:
            uncontrolled += 1
            continue
        error = critical * np.sqrt(max(variance * control + spread, 0.0)) / control
        for k in range(3):
            external[cell, k] = max(external[cell, k], abs(gain[k, i]) * error)
    return uncontrolled


@kernel
def of_best_pair(cell, first, last, of_point, normals, joint, variance, normal, inverse, gain, sigma):
    """σ of a cell's point from the two rays with the smallest σ of its third coordinate; unchanged without.

    Fills one row of sigma (m, 3).
    """
    best = np.inf
    for a in range(last - first):
        for b in range(a + 1, last - first):
            for k in range(3):
                for q in range(3):
                    normal[k, q] = normals[a, k, q] + normals[b, k, q]
            # What W adds is not negative, so this pair cannot be the best one any more.
            if not invert(normal, inverse) or variance * inverse[2, 2] >= best:
                continue
            for component in range(2, -1, -1):
                for r in range(2):
                    one, other = 0.0, 0.0
                    for q in range(3):
                        one += inverse[component, q] * of_point[first + a, r, q]
                        other += inverse[component, q] * of_point[first + b, r, q]
                    gain[0, r], gain[1, r] = one, other
                value = variance * inverse[component, component]
                for r in range(2):
                    for t in range(2):
                        value += gain[0, r] * gain[0, t] * joint[2 * a + r, 2 * a + t]
                        value += gain[1, r] * gain[1, t] * joint[2 * b + r, 2 * b + t]
                        value += 2.0 * gain[0, r] * gain[1, t] * joint[2 * a + r, 2 * b + t]
                if component == 2:
                    if value >= best:
                        break
                    best = value
                sigma[cell, component] = np.sqrt(value)


@kernel
def cell_accuracies(
    start, neighbour, axes, image, of_exposure, of_point, of_system, of_known, columns, row_start, column,
    blocks, border, corner, scale, variance, critical, least_control, sigma, sigma_of_pair, sigma_relative,
    external, uncontrolled,
):  # fmt: skip
    """Everything about the m cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

    Derivatives: of_exposure (r, 2, 6), of_point (r, 2, 3) in the frame of the block, turned here into the
    axes (m, 3, 3) of the cells, of_system (r, 2, w) by the columns (n, w) of the border of each image
    (−1: held), of_known (r, 2, q) the effects of considered parameters. variance is s².
    Fills sigma, sigma_of_pair, sigma_relative and external (m, 3) and uncontrolled (m,); cells of fewer
    than two rays keep what is there.
    """
    cells, rays, width = start.shape[0] - 1, image.shape[0], columns.shape[1]
    count, found = np.zeros(rays, np.int64), np.zeros((rays, width), np.int64)
    for a in range(rays):
        for s in range(width):
            g = columns[image[a], s]
            if g >= 0 and (of_system[a, 0, s] != 0.0 or of_system[a, 1, s] != 0.0):
                of_system[a, 0, count[a]] = of_system[a, 0, s]
                of_system[a, 1, count[a]] = of_system[a, 1, s]
                found[a, count[a]] = g
                count[a] += 1
    most = 1
    for j in range(cells):
        most = max(most, start[j + 1] - start[j])
        for a in range(start[j], start[j + 1]):
            for r in range(2):
                x, y, z = of_point[a, r, 0], of_point[a, r, 1], of_point[a, r, 2]
                for k in range(3):
                    of_point[a, r, k] = x * axes[j, 0, k] + y * axes[j, 1, k] + z * axes[j, 2, k]
    joint, gain, moved = np.zeros((2 * most, 2 * most)), np.zeros((3, 2 * most)), np.zeros((3, 2 * most))
    normals, normal, inverse = np.zeros((most, 3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    position, common = np.zeros((most, most), np.int64), np.zeros((most, 2), np.int64)
    inverses, of_images = np.zeros((2, 3, 3)), np.zeros((most, 3, 6))
    of_border, of_columns = np.zeros((most, 3, 2 * width)), np.zeros((most, 2 * width), np.int64)
    counts, of_errors = np.zeros(most, np.int64), np.zeros((3, of_known.shape[2]))
    of_pair, total = np.zeros((2, 2)), np.zeros(3)
    placed = -1  # the cell of which ``position`` is
    for j in range(cells):
        first, last = start[j], start[j + 1]
        if last - first < 2:
            continue
        same = placed >= 0 and start[placed + 1] - start[placed] == last - first
        if same:
            for a in range(last - first):
                same = same and image[first + a] == image[start[placed] + a]
        if not same:
            find_positions(first, last, image, row_start, column, position)
        placed = j
        joint_blocks(
            first, last, image, position, of_exposure, count, found, of_system, of_known, blocks, border,
            corner, scale, of_pair, joint,
        )  # fmt: skip
        normals_of_rays(first, last, of_point, normals)
        uncontrolled[j] = of_all_rays(
            j, first, last, of_point, normals, joint, variance, critical, least_control, normal, inverse,
            gain, moved, sigma, external,
        )  # fmt: skip
        of_best_pair(j, first, last, of_point, normals, joint, variance, normal, inverse, gain, sigma_of_pair)
        other = neighbour[j]
        if other >= 0:
            relative(
                j, first, last, start[other], start[other + 1], image, position, of_exposure, of_point, count,
                found, of_system, of_known, blocks, border, corner, scale, variance, common, inverses, normal,
                of_images, of_border, of_columns, counts, of_errors, total, sigma_relative,
            )  # fmt: skip
