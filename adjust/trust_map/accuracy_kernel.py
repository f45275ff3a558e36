"""Covariances of new ground points from all images that see them and from their best pair, compiled.

With the derivatives A of the rays of a point by its coordinates and B by the orientations and system
parameters z of the images, whose joint covariance is Q, and image coordinates of variance s²,

    G = (Aᵀ A)⁻¹ Aᵀ,    F = G B,    C = s² (Aᵀ A)⁻¹ + F Q Fᵀ.

Q Fᵀ is multiplied once for each cell. It also gives G W, with the covariance W = B Q Bᵀ of the rays, and the
difference of two cells with the same images. Of W itself only what belongs to a ray, or to a pair that may be
the best one, is computed. Cells with the same images are worked on side by side (`lane_kernel`); scratch
arrays are made once for all cells.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.trust_map.joint_kernel import (
    add_systems_and_errors,
    gather,
    joint_movements,
    own_covariances,
    places,
    system_covariances,
)
from adjust.trust_map.lane_kernel import LANES, STEP, add_six_rows, set_six_rows, six_rows
from adjust.trust_map.pairs_kernel import best_pairs, height_bounds, same_images
from adjust.trust_map.rays_kernel import ROWS_OF_SLOPE, derivatives, put_cells, put_errors
from adjust.trust_map.relative_kernel import (
    common_rays,
    covariances,
    leave_out,
    of_unknowns,
    subtract,
    variances,
    variances_of_differences,
)

# Rows of what belongs to a cell: upper triangles of (Aᵀ A)⁻¹ and of Aᵀ A (then of F Q Fᵀ), the largest
# effects, coordinates whose errors show in no residual, the smallest error of one that is found, and whether
# there is a point.
_INVERSE, _NORMAL, _EXTERNAL, _UNCONTROLLED, _ERROR, _THERE = 0, 6, 12, 15, 16, 17
_ROWS_OF_CELL = 18
# Rows of a diagonal in those of the upper triangle.
_DIAGONAL = (0, 3, 5)


@kernel
def gains(k, m, of_point, normals, of_cell, gain):
    """Fill the rows 3 j + c of gain with G, and normals with the Aᵀ A of each ray; G is 0 without a point.

    Rows 3 j + c of of_point are those by coordinate c of image coordinate j = 2 a + r.
    """
    of_cell[_NORMAL * LANES : (_NORMAL + 6) * LANES] = 0.0
    for a in range(k):
        for n in range(m):
            x0, x1, x2, y0, y1, y2 = six_rows(of_point, 6 * a * LANES + n)
            xx, xy, xz = x0 * x0 + y0 * y0, x0 * x1 + y0 * y1, x0 * x2 + y0 * y2
            yy, yz, zz = x1 * x1 + y1 * y1, x1 * x2 + y1 * y2, x2 * x2 + y2 * y2
            set_six_rows(normals, 6 * a * LANES + n, xx, xy, xz, yy, yz, zz)
            add_six_rows(of_cell, _NORMAL * LANES + n, xx, xy, xz, yy, yz, zz)
    for n in range(m):
        a, b, c, d, e, f = six_rows(of_cell, _NORMAL * LANES + n)
        i00, i01, i02 = d * f - e * e, c * e - b * f, b * e - c * d
        determinant = a * i00 + b * i01 + c * i02
        there = determinant > 1e-13 * a * d * f
        factor = 1.0 / determinant if there else 0.0
        set_six_rows(
            of_cell, _INVERSE * LANES + n, i00 * factor, i01 * factor, i02 * factor, (a * f - c * c) * factor,
            (b * c - a * e) * factor, (a * d - b * b) * factor,
        )  # fmt: skip
        of_cell[np.uintp(_THERE * LANES + n)] = 1.0 if there else 0.0
    for a in range(k):
        for n in range(m):
            xx, xy, xz, yy, yz, zz = six_rows(of_cell, _INVERSE * LANES + n)
            x0, x1, x2, y0, y1, y2 = six_rows(of_point, 6 * a * LANES + n)
            set_six_rows(
                gain, 6 * a * LANES + n,
                xx * x0 + xy * x1 + xz * x2, xy * x0 + yy * x1 + yz * x2, xz * x0 + yz * x1 + zz * x2,
                xx * y0 + xy * y1 + xz * y2, xy * y0 + yy * y1 + yz * y2, xz * y0 + yz * y1 + zz * y2,
            )  # fmt: skip


@kernel
def of_all_rays(k, m, of_point, gain, own, moved, variance, critical, least_control, of_cell):
    """The largest effects of an undetected error in one of all rays.

    The residual of coordinate i has the variance (R (s² I + W) Rᵀ)_ii with R = I − A G. An error of

        ∇ = δ0 σ_v / R_ii

    is found with the power that belongs to δ0, and moves the point by G_i ∇. Coordinates with R_ii below the
    least control, whose errors show in no residual, are counted apart. moved is G W; own has the diagonal
    of W.
    """
    of_cell[_EXTERNAL * LANES : (_UNCONTROLLED + 1) * LANES] = 0.0
    for j in range(2 * k):
        diagonal = (3 * (j // 2) + 2 * (j % 2)) * LANES
        for n in range(m):
            at = np.uintp(3 * j * LANES + n)
            at1, at2 = at + np.uintp(LANES), at + np.uintp(2 * LANES)
            x, y, z = of_point[at], of_point[at1], of_point[at2]
            xx, xy, xz, yy, yz, zz = six_rows(of_cell, _NORMAL * LANES + n)
            control = 1.0 - (x * gain[at] + y * gain[at1] + z * gain[at2])
            spread = own[np.uintp(diagonal + n)] - 2.0 * (x * moved[at] + y * moved[at1] + z * moved[at2])
            spread += x * (x * xx + 2.0 * y * xy) + y * (y * yy + 2.0 * z * yz) + z * (z * zz + 2.0 * x * xz)
            controlled = control >= least_control
            error = critical * np.sqrt(max(variance * control + spread, 0.0)) / control
            of_cell[np.uintp(_ERROR * LANES + n)] = error if controlled else 0.0
            of_cell[np.uintp(_UNCONTROLLED * LANES + n)] += 0.0 if controlled else 1.0
        for n in range(m):
            for c in range(3):
                row, o = (3 * j + c) * LANES + n, (_EXTERNAL + c) * LANES + n
                effect = abs(gain[np.uintp(row)]) * of_cell[np.uintp(_ERROR * LANES + n)]
                before = of_cell[np.uintp(o)]
                of_cell[np.uintp(o)] = effect if effect > before else before


@kernel
def write_cells(count, cell, variance, of_cell, sigma, external, uncontrolled):
    """Fill in what follows from all rays."""
    for lane in range(count):
        j = cell[lane]
        if of_cell[_THERE * LANES + lane] == 0.0:
            continue
        uncontrolled[j] = int(of_cell[_UNCONTROLLED * LANES + lane])
        for c in range(3):
            diagonal = _DIAGONAL[c] * LANES + lane
            sigma[j, c] = np.sqrt(variance * of_cell[diagonal] + of_cell[_NORMAL * LANES + diagonal])
            external[j, c] = of_cell[(_EXTERNAL + c) * LANES + lane]


@kernel
def write_differences(count, cell, neighbour, variance, of_cell, total, sigma_relative, left, others):
    """Fill in the differences from cells in the next lane; the other cells with a neighbour join the left."""
    for lane in range(count):
        j = cell[lane]
        if neighbour[j] < 0:
            continue
        if lane + 1 == count or neighbour[j] != cell[lane + 1]:
            others[left] = j
            left += 1
        elif of_cell[_THERE * LANES + lane] > 0.0 and of_cell[_THERE * LANES + lane + 1] > 0.0:
            for c in range(3):
                diagonal = _DIAGONAL[c] * LANES + lane
                own = variance * (of_cell[diagonal] + of_cell[diagonal + 1])
                sigma_relative[j, c] = np.sqrt(total[c * LANES + lane] + own)
    return left


@kernel
def cell_accuracies(
    start, ordered, neighbour, x_in_local, axes, image, geometry, of_known, columns, row_start, column,
    blocks, border, corner, scale, variance, critical, least_control, sigma, sigma_of_pair, sigma_relative,
    external, uncontrolled,
):  # fmt: skip
    """Everything about the m cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

    ordered (m,) are the cells in the order in which they are worked on, best those with the same images one
    after another. geometry is what :func:`~adjust.trust_map.rays_kernel.derivatives` wants to know of
    cameras and rays. Derivatives by the cell are turned into its axes (m, 3, 3); those by system parameters
    are by the columns (n, w) of the border of each image (−1: held); of_known (r, 2, q) are the effects of
    considered parameters, with r = 0 without any. variance is s². Fills sigma, sigma_of_pair, sigma_relative
    and external (m, 3) and uncontrolled (m,); cells of fewer than two rays keep what is there.
    """
    cells, width, errors, most = start.shape[0] - 1, columns.shape[1], of_known.shape[2], 1
    for j in range(cells):
        most = max(most, start[j + 1] - start[j])
    unknowns, others = 6 * most + corner.shape[0], np.zeros(cells, np.int64)
    # Side by side.
    exposures, systems = np.zeros(12 * most * LANES), np.zeros(2 * most * width * LANES)
    points, knowns = np.zeros(6 * most * LANES), np.zeros(2 * most * errors * LANES)
    normals, gain = np.zeros(6 * most * LANES), np.zeros(6 * most * LANES)
    moved = np.zeros(6 * most * LANES)
    own, common, bounds = np.zeros(3 * most * LANES), np.zeros(most * LANES), np.zeros(most * most * LANES)
    crossing = np.zeros(2 * most * corner.shape[0] * LANES)
    both = np.zeros(2 * most * corner.shape[0] * LANES)
    # One more: the last cell is looked beyond.
    f, movement = np.zeros(3 * unknowns * LANES + 1), np.zeros(3 * unknowns * LANES + 1)
    f_errors, of_other = np.zeros(3 * errors * LANES + 1), np.zeros(3 * errors * LANES + 1)
    of_cell, other_cell = np.zeros(_ROWS_OF_CELL * LANES), np.zeros(_ROWS_OF_CELL * LANES)
    total, where, slopes = np.zeros(3 * LANES), np.zeros(12 * LANES), np.zeros(ROWS_OF_SLOPE * LANES)
    cell, next_cell = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    ray, other_ray = np.zeros(most * LANES, np.int64), np.zeros(most * LANES, np.int64)
    space, place = np.zeros(unknowns * unknowns), np.zeros((most, width), np.int64)
    used, chosen, best = np.zeros(corner.shape[0], np.int64), np.zeros(LANES, np.int64), np.zeros(LANES)
    rows, found, of_pair = np.zeros(11 * LANES), np.zeros(3 * LANES), np.zeros(3 * LANES)
    at = 0
    while at < cells:
        first = start[ordered[at]]
        k = start[ordered[at] + 1] - first
        end = at + 1
        while end < cells and same_images(
            first, first + k, start[ordered[end]], start[ordered[end] + 1], image
        ):
            end += 1
        if k < 2:
            at = end
            continue
        d = places(first, first + k, image, columns, place, used)
        known, free = space[: d * d].reshape(d, d), d > 6 * k
        gather(first, first + k, image, used, row_start, column, blocks, border, corner, scale, known)
        left, pair = 0, -1
        while at < end:
            count = min(LANES, end - at)
            m = -(-count // STEP) * STEP
            for n in range(m):
                cell[n] = ordered[at + min(n, count - 1)]
                for a in range(k):
                    ray[a * LANES + n] = start[cell[n]] + a
            put_cells(m, cell, x_in_local, axes, where)
            derivatives(k, m, first, image, ray, geometry, free, where, slopes, exposures, systems, points)
            put_errors(k, m, ray, of_known, knowns)
            gains(k, m, points, normals, of_cell, gain)
            of_unknowns(k, m, d, place, gain, exposures, systems, errors, knowns, f, f_errors)
            np.dot(known, f[: 3 * d * m].reshape(d, 3 * m), movement[: 3 * d * m].reshape(d, 3 * m))
            covariances(m, d, f, movement, errors, f_errors, of_cell, _NORMAL)
            joint_movements(k, m, place, movement, exposures, systems, errors, f_errors, knowns, moved)
            own_covariances(k, m, d, space, exposures, own)
            if free:
                system_covariances(k, m, known, place, exposures, systems, crossing, both)
            add_systems_and_errors(k, m, d - 6 * k, place, systems, crossing, both, errors, knowns, own)
            of_all_rays(k, m, points, gain, own, moved, variance, critical, least_control, of_cell)
            write_cells(count, cell, variance, of_cell, sigma, external, uncontrolled)
            variances_of_differences(m, d, f, movement, errors, f_errors, total)
            left = write_differences(
                count, cell, neighbour, variance, of_cell, total, sigma_relative, left, others
            )
            height_bounds(k, m, normals, variance, bounds)
            best_pairs(
                k, m, d, pair, bounds, normals, space, place, points, own, exposures, systems, crossing,
                both, errors, knowns, variance, rows, best, chosen, found, of_pair,
            )  # fmt: skip
            for lane in range(count):
                if chosen[lane] >= 0 and of_cell[_THERE * LANES + lane] > 0.0:
                    for c in range(3):
                        sigma_of_pair[cell[lane], c] = np.sqrt(of_pair[c * LANES + lane])
            pair = chosen[count - 1]
            at += count
        # Differences from cells that other images see, in their common images.
        for done in range(0, left, LANES):
            count = min(LANES, left - done)
            m = -(-count // STEP) * STEP
            for n in range(m):
                cell[n] = others[done + min(n, count - 1)]
                next_cell[n] = neighbour[cell[n]]
            common_rays(m, k, cell, next_cell, first, start, image, ray, other_ray, common)
            put_cells(m, cell, x_in_local, axes, where)
            derivatives(k, m, first, image, ray, geometry, free, where, slopes, exposures, systems, points)
            leave_out(m, k, common, points)
            put_errors(k, m, ray, of_known, knowns)
            gains(k, m, points, normals, of_cell, gain)
            of_unknowns(k, m, d, place, gain, exposures, systems, errors, knowns, f, f_errors)
            put_cells(m, next_cell, x_in_local, axes, where)
            derivatives(
                k, m, first, image, other_ray, geometry, free, where, slopes, exposures, systems, points
            )
            leave_out(m, k, common, points)
            put_errors(k, m, other_ray, of_known, knowns)
            gains(k, m, points, normals, other_cell, gain)
            of_unknowns(k, m, d, place, gain, exposures, systems, errors, knowns, movement, of_other)
            subtract(3 * d * m, f, movement)
            subtract(3 * errors * m, f_errors, of_other)
            np.dot(known, f[: 3 * d * m].reshape(d, 3 * m), movement[: 3 * d * m].reshape(d, 3 * m))
            variances(m, d, f, movement, errors, f_errors, total)
            for lane in range(count):
                if of_cell[_THERE * LANES + lane] > 0.0 and other_cell[_THERE * LANES + lane] > 0.0:
                    for c in range(3):
                        diagonal = _DIAGONAL[c] * LANES + lane
                        own_part = variance * (of_cell[diagonal] + other_cell[diagonal])
                        sigma_relative[cell[lane], c] = np.sqrt(total[c * LANES + lane] + own_part)
