"""Covariances of new ground points from all images that see them and from their best pair, compiled.

With the derivatives A of the rays of a point by its coordinates and B by the orientations and system
parameters z of the images, whose joint covariance is Q, and image coordinates of variance s²,

    G = (Aᵀ A)⁻¹ Aᵀ,    W = B Q Bᵀ,    C = s² (Aᵀ A)⁻¹ + G W Gᵀ.

W holds every pair of rays, so each pair of images is a part of it. Scratch arrays are made once for all
cells.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.trust_map.joint_kernel import gather, joint_blocks
from adjust.trust_map.pairs_kernel import invert, same_images
from adjust.trust_map.relative_kernel import of_common_images, of_unknowns, sigma_of_difference


@kernel
def gains(first, last, of_point, normals, normal, inverse, gain):
    """Fill inverse with (Aᵀ A)⁻¹ and gain with G (3, 2k) of the k rays; false without a point.

    normals (k, 3, 3) gets the Aᵀ A of each ray; normal (3, 3) is scratch.
    """
    normal[:] = 0.0
    for a in range(first, last):
        for k in range(3):
            for q in range(3):
                value = of_point[a, 0, k] * of_point[a, 0, q] + of_point[a, 1, k] * of_point[a, 1, q]
                normals[a - first, k, q] = value
                normal[k, q] += value
    if not invert(normal, inverse):
        return False
    for k in range(3):
        i0, i1, i2 = inverse[k, 0], inverse[k, 1], inverse[k, 2]
        for a in range(first, last):
            for r in range(2):
                gain[k, 2 * (a - first) + r] = (
                    i0 * of_point[a, r, 0] + i1 * of_point[a, r, 1] + i2 * of_point[a, r, 2]
                )
    return True


@kernel
def of_all_rays(
    cell, first, last, of_point, joint, variance, critical, least_control, normal, inverse, gain, moved,
    sigma, external,
):  # fmt: skip
    """σ of a cell's point from all its rays, and the largest effects of an undetected error in one of them.

    The residual of coordinate i has the variance (R (s² I + W) Rᵀ)_ii with R = I − A G. An error of

        ∇ = δ0 σ_v / R_ii

    is found with the power that belongs to δ0, and moves the point by G_i ∇. Returns the number of
    coordinates with R_ii below the least control, whose errors show in no residual and are not counted.
    Fills one row of sigma and external (m, 3).
    """
    rays = 2 * (last - first)
    for j in range(rays):
        moved[0, j], moved[1, j], moved[2, j] = 0.0, 0.0, 0.0
    for i in range(rays):
        g0, g1, g2 = gain[0, i], gain[1, i], gain[2, i]
        for j in range(rays):
            moved[0, j] += g0 * joint[i, j]
            moved[1, j] += g1 * joint[i, j]
            moved[2, j] += g2 * joint[i, j]
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


@small_kernel
def of_pair(first, a, b, k, inverse, of_point, joint, variance):
    """Variance of coordinate k from the rays a and b, whose normals have the inverse."""
    value = variance * inverse[k, k]
    for r in range(2):
        one, other = 0.0, 0.0
        for q in range(3):
            one += inverse[k, q] * of_point[first + a, r, q]
            other += inverse[k, q] * of_point[first + b, r, q]
        for t in range(2):
            more, further = 0.0, 0.0
            for q in range(3):
                more += inverse[k, q] * of_point[first + a, t, q]
                further += inverse[k, q] * of_point[first + b, t, q]
            value += one * more * joint[2 * a + r, 2 * a + t]
            value += other * further * joint[2 * b + r, 2 * b + t]
            value += 2.0 * one * further * joint[2 * a + r, 2 * b + t]
    return value


@kernel
def best_pair(first, last, guess, of_point, normals, joint, variance, normal, inverse):
    """The two rays a < b with the smallest variance of the third coordinate, as a · k + b; −1 without.

    The guess, the best pair of a cell beside or −1, is looked at first, so that few others need more than
    what the image coordinates alone contribute.
    """
    k = last - first
    best, found = np.inf, -1
    for n in range(-1, k * k):
        at = guess if n < 0 else n
        a, b = at // k, at % k
        if at < 0 or b <= a or (n >= 0 and at == guess):
            continue
        xx = normals[a, 0, 0] + normals[b, 0, 0]
        xy = normals[a, 0, 1] + normals[b, 0, 1]
        yy = normals[a, 1, 1] + normals[b, 1, 1]
        xz = normals[a, 0, 2] + normals[b, 0, 2]
        yz = normals[a, 1, 2] + normals[b, 1, 2]
        zz = normals[a, 2, 2] + normals[b, 2, 2]
        plan = xx * yy - xy * xy
        determinant = zz * plan - xx * yz * yz + 2.0 * xy * xz * yz - yy * xz * xz
        # What W adds is not negative, so this pair cannot be the best one any more.
        if variance * plan >= best * determinant:
            continue
        for c in range(3):
            for q in range(3):
                normal[c, q] = normals[a, c, q] + normals[b, c, q]
        if invert(normal, inverse):
            value = of_pair(first, a, b, 2, inverse, of_point, joint, variance)
            if value < best:
                best, found = value, at
    return found


@kernel
def of_best_pair(cell, first, last, pair, of_point, normals, joint, variance, normal, inverse, sigma):
    """Fill one row of sigma (m, 3) with σ of a cell's point from two of its rays."""
    k = last - first
    a, b = pair // k, pair % k
    for c in range(3):
        for q in range(3):
            normal[c, q] = normals[a, c, q] + normals[b, c, q]
    invert(normal, inverse)
    for c in range(3):
        sigma[cell, c] = np.sqrt(of_pair(first, a, b, c, inverse, of_point, joint, variance))


@kernel
def cell_accuracies(
    start, runs, neighbour, axes, image, of_exposure, of_point, of_system, of_known, columns, row_start,
    column, blocks, border, corner, scale, variance, critical, least_control, sigma, sigma_of_pair,
    sigma_relative, external, uncontrolled,
):  # fmt: skip
    """Everything about the m cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

    runs (n, 2): first and last + 1 of cells with the same images; equal images best one after another.
    Derivatives: of_exposure (r, 2, 6), of_point (r, 2, 3) in the frame of the block, turned here into the
    axes (m, 3, 3) of the cells, of_system (r, 2, w) by the columns (n, w) of the border of each image
    (−1: held), of_known (r, 2, q) the effects of considered parameters. variance is s².
    Fills sigma, sigma_of_pair, sigma_relative and external (m, 3) and uncontrolled (m,); cells of fewer
    than two rays keep what is there.
    """
    cells, width = start.shape[0] - 1, columns.shape[1]
    most = 1
    for j in range(cells):
        most = max(most, start[j + 1] - start[j])
        for a in range(start[j], start[j + 1]):
            for r in range(2):
                x, y, z = of_point[a, r, 0], of_point[a, r, 1], of_point[a, r, 2]
                for k in range(3):
                    of_point[a, r, k] = x * axes[j, 0, k] + y * axes[j, 1, k] + z * axes[j, 2, k]
    unknowns = 6 * most + corner.shape[0]
    known, used = np.zeros((unknowns, unknowns)), np.zeros(corner.shape[0], np.int64)
    place, common = np.zeros((most, width), np.int64), np.zeros((most, 2), np.int64)
    joint, moved = np.zeros((2 * most, 2 * most)), np.zeros((3, 2 * most))
    row_x, row_y = np.zeros(unknowns), np.zeros(unknowns)
    normal, scratch = np.zeros((3, 3)), np.zeros((3, 3))
    difference, products = np.zeros((3, unknowns)), np.zeros((3, unknowns))
    common_inverses, errors = np.zeros((2, 3, 3)), np.zeros((3, of_known.shape[2]))
    # Of this cell and of its neighbour, which is mostly the next one.
    normals, inverses, gain = np.zeros((2, most, 3, 3)), np.zeros((2, 3, 3)), np.zeros((2, 3, 2 * most))
    f, of_errors = np.zeros((2, 3, unknowns)), np.zeros((2, 3, of_known.shape[2]))
    now, begun, gathered, d, pair = 0, -1, -1, 0, -1
    run, j = 0, runs[0, 0] - 1 if cells else 0
    for _ in range(cells):
        j += 1
        if j == runs[run, 1]:
            run += 1
            j = runs[run, 0]
        first, last = start[j], start[j + 1]
        if last - first < 2:
            continue
        if gathered < 0 or not same_images(first, last, start[gathered], start[gathered + 1], image):
            pair = -1
            d = gather(
                first, last, image, columns, row_start, column, blocks, border, corner, place, used, known
            )
        gathered = j
        if begun == j:
            now = 1 - now
        elif not gains(first, last, of_point, normals[now], normal, inverses[now], gain[now]):
            continue
        else:
            of_unknowns(
                first, last, d, place, gain[now], of_exposure, of_system, of_known, f[now], of_errors[now]
            )
        joint_blocks(
            first, last, d, known, place, of_exposure, of_system, of_known, scale, row_x, row_y, joint,
        )  # fmt: skip
        uncontrolled[j] = of_all_rays(
            j, first, last, of_point, joint, variance, critical, least_control, normal, inverses[now],
            gain[now], moved, sigma, external,
        )  # fmt: skip
        pair = best_pair(first, last, pair, of_point, normals[now], joint, variance, normal, scratch)
        if pair >= 0:
            of_best_pair(
                j, first, last, pair, of_point, normals[now], joint, variance, normal, scratch, sigma_of_pair
            )
        other = neighbour[j]
        if other < 0:
            continue
        other_first, other_last, to = start[other], start[other + 1], 1 - now
        if not same_images(first, last, other_first, other_last, image):
            there = of_common_images(
                first, last, other_first, other_last, image, place, of_exposure, of_point, of_system,
                of_known, common, common_inverses, normal, difference, errors,
            )  # fmt: skip
            if there:
                sigma_of_difference(
                    j, first, last, d, known, difference, errors, common_inverses, scale, variance,
                    products, sigma_relative,
                )  # fmt: skip
        elif gains(other_first, other_last, of_point, normals[to], normal, inverses[to], gain[to]):
            begun = other
            of_unknowns(
                other_first, other_last, d, place, gain[to], of_exposure, of_system, of_known, f[to],
                of_errors[to],
            )  # fmt: skip
            for c in range(3):
                for i in range(d):
                    difference[c, i] = f[0, c, i] - f[1, c, i]
                for i in range(errors.shape[1]):
                    errors[c, i] = of_errors[0, c, i] - of_errors[1, c, i]
            sigma_of_difference(
                j, first, last, d, known, difference, errors, inverses, scale, variance, products,
                sigma_relative,
            )  # fmt: skip
