"""Covariances of new ground points from all images that see them and from their best pair, compiled.

With the derivatives A of the rays of a point by its coordinates and B by the orientations and system
parameters z of the images, whose joint covariance is Q, and image coordinates of variance s²,

    G = (Aᵀ A)⁻¹ Aᵀ,    W = B Q Bᵀ,    C = s² (Aᵀ A)⁻¹ + G W Gᵀ.

W holds every pair of rays, so each pair of images is a part of it. Cells with the same images are worked on
side by side (`lane_kernel`); scratch arrays are made once for all cells.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.observations.image_point_kernel import linearize_ray
from adjust.trust_map.joint_kernel import (
    add_considered,
    add_systems,
    gather,
    joint_blocks,
    joint_movements,
    places,
)
from adjust.trust_map.lane_kernel import LANES, STEP
from adjust.trust_map.pairs_kernel import (
    best_pair,
    height_bounds,
    inverse_of_pair,
    same_images,
    variance_of_pair,
)
from adjust.trust_map.relative_kernel import differences, of_common_images, of_unknowns, variances

# Rows of what belongs to a cell: upper triangles of (Aᵀ A)⁻¹ and of Aᵀ A (then of G W Gᵀ), the largest
# effects, coordinates whose errors show in no residual, the smallest error of one that is found, whether
# there is a point, and the diagonal of the (Aᵀ A)⁻¹ of a difference.
_INVERSE, _NORMAL, _EXTERNAL, _UNCONTROLLED, _ERROR, _THERE, _OF_DIFFERENCE = 0, 6, 12, 15, 16, 17, 18
_ROWS_OF_CELL = 21
# Rows of a diagonal in those of the upper triangle.
_DIAGONAL = (0, 3, 5)


@kernel
def rays_of_cell(cell, first, last, image, geometry, axes, misclosure, of_exposure, of_system, of_point):
    """Derivatives of the rays of a cell, in the rows from 0 on; those by the point in the axes (3, 3)."""
    camera_of_image, centres, rotations, points, interior, ideal, slope, basis, inverse_sigma = geometry
    base = np.int64(0)
    for a in range(last - first):
        linearize_ray(
            first + a, cell, base, image, camera_of_image, centres, rotations, None, points, interior, ideal,
            slope, basis, inverse_sigma, a, misclosure, of_exposure, of_system, of_point,
        )  # fmt: skip
        for r in range(2):
            x, y, z = of_point[a, r, 0], of_point[a, r, 1], of_point[a, r, 2]
            for c in range(3):
                of_point[a, r, c] = x * axes[c, 0] + y * axes[c, 1] + z * axes[c, 2]


@kernel
def put_side_by_side(lane, count, values, rows):
    """Write the first values (count, 2, w) into row 2 (w a + s) + r of a cell."""
    width = values.shape[2]
    for a in range(count):
        for s in range(width):
            for r in range(2):
                rows[(2 * (width * a + s) + r) * LANES + lane] = values[a, r, s]


@small_kernel
def six_rows(values, at):
    """Six rows that follow each other."""
    return (
        values[np.uintp(at)], values[np.uintp(at + LANES)], values[np.uintp(at + 2 * LANES)],
        values[np.uintp(at + 3 * LANES)], values[np.uintp(at + 4 * LANES)], values[np.uintp(at + 5 * LANES)],
    )  # fmt: skip


@small_kernel
def set_six_rows(out, o, a, b, c, d, e, f):
    """Fill six rows that follow each other."""
    out[np.uintp(o)], out[np.uintp(o + LANES)], out[np.uintp(o + 2 * LANES)] = a, b, c
    out[np.uintp(o + 3 * LANES)], out[np.uintp(o + 4 * LANES)], out[np.uintp(o + 5 * LANES)] = d, e, f


@small_kernel
def add_six_rows(out, o, a, b, c, d, e, f):
    """Add to six rows that follow each other."""
    out[np.uintp(o)] += a
    out[np.uintp(o + LANES)] += b
    out[np.uintp(o + 2 * LANES)] += c
    out[np.uintp(o + 3 * LANES)] += d
    out[np.uintp(o + 4 * LANES)] += e
    out[np.uintp(o + 5 * LANES)] += f


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
def of_all_rays(k, m, of_point, gain, joint, moved, variance, critical, least_control, of_cell):
    """C − s² (Aᵀ A)⁻¹ from all rays, and the largest effects of an undetected error in one of them.

    The residual of coordinate i has the variance (R (s² I + W) Rᵀ)_ii with R = I − A G. An error of

        ∇ = δ0 σ_v / R_ii

    is found with the power that belongs to δ0, and moves the point by G_i ∇. Coordinates with R_ii below the
    least control, whose errors show in no residual, are counted apart. moved is G W.
    """
    of_cell[_NORMAL * LANES : (_UNCONTROLLED + 1) * LANES] = 0.0
    for a in range(k):
        for n in range(m):
            x0, x1, x2, y0, y1, y2 = six_rows(moved, 6 * a * LANES + n)
            u0, u1, u2, v0, v1, v2 = six_rows(gain, 6 * a * LANES + n)
            add_six_rows(
                of_cell, _NORMAL * LANES + n, x0 * u0 + y0 * v0, x0 * u1 + y0 * v1, x0 * u2 + y0 * v2,
                x1 * u1 + y1 * v1, x1 * u2 + y1 * v2, x2 * u2 + y2 * v2,
            )  # fmt: skip
    for j in range(2 * k):
        # The block of a ray with itself, its diagonal.
        diagonal = (4 * (k * (j // 2) + j // 2) + 3 * (j % 2)) * LANES
        for n in range(m):
            at = np.uintp(3 * j * LANES + n)
            at1, at2 = at + np.uintp(LANES), at + np.uintp(2 * LANES)
            x, y, z = of_point[at], of_point[at1], of_point[at2]
            xx, xy, xz, yy, yz, zz = six_rows(of_cell, _NORMAL * LANES + n)
            control = 1.0 - (x * gain[at] + y * gain[at1] + z * gain[at2])
            spread = joint[np.uintp(diagonal + n)] - 2.0 * (x * moved[at] + y * moved[at1] + z * moved[at2])
            spread += x * (x * xx + 2.0 * y * xy) + y * (y * yy + 2.0 * z * yz) + z * (z * zz + 2.0 * x * xz)
            controlled = control >= least_control
            error = critical * np.sqrt(max(variance * control + spread, 0.0)) / control
            of_cell[np.uintp(_ERROR * LANES + n)] = error if controlled else 0.0
            of_cell[np.uintp(_UNCONTROLLED * LANES + n)] += 0.0 if controlled else 1.0
        for n in range(m):
            for c in range(3):
                row, own = (3 * j + c) * LANES + n, (_EXTERNAL + c) * LANES + n
                effect = abs(gain[np.uintp(row)]) * of_cell[np.uintp(_ERROR * LANES + n)]
                before = of_cell[np.uintp(own)]
                of_cell[np.uintp(own)] = effect if effect > before else before


@kernel
def put_together(
    at, count, m, ordered, start, neighbour, axes, image, geometry, of_known, place, misclosure, of_exposure,
    of_system, of_point, common, inverses, scratch, exposures, systems, points, knowns, other_f, other_errors,
    kind, of_cell,
):  # fmt: skip
    """Derivatives of the rays of some cells with the same images side by side, and what neighbours need.

    Places beyond the cells repeat the last one. kind (m,) says of the neighbour of each cell: 1, it is the
    next one; 2, other images see it, and other_f and other_errors are filled; 0, there is none.
    """
    for lane in range(m):
        j = ordered[at + min(lane, count - 1)]
        first, last = start[j], start[j + 1]
        rays_of_cell(
            j, first, last, image, geometry, axes[j], misclosure[0], of_exposure[0], of_system[0], of_point[0]
        )
        put_side_by_side(lane, last - first, of_exposure[0], exposures)
        put_side_by_side(lane, last - first, of_system[0], systems)
        put_side_by_side(lane, last - first, of_known[first:last], knowns)
        for a in range(last - first):
            for r in range(2):
                for c in range(3):
                    points[(3 * (2 * a + r) + c) * LANES + lane] = of_point[0, a, r, c]
        other = neighbour[j]
        kind[lane] = 0
        if other < 0 or lane >= count:
            continue
        if lane + 1 < count and other == ordered[at + lane + 1]:
            kind[lane] = 1
            continue
        other_first, other_last = start[other], start[other + 1]
        rays_of_cell(
            other, other_first, other_last, image, geometry, axes[other], misclosure[1], of_exposure[1],
            of_system[1], of_point[1],
        )  # fmt: skip
        if of_common_images(
            first, last, other_first, other_last, image, place, of_exposure, of_point, of_system, of_known,
            common, inverses, scratch, other_f[lane], other_errors[lane],
        ):  # fmt: skip
            kind[lane] = 2
            for c in range(3):
                of_cell[(_OF_DIFFERENCE + c) * LANES + lane] = inverses[0, c, c] + inverses[1, c, c]


@kernel
def differences_of_sets(m, count, d, errors, kind, other_f, other_errors, shifts, shift_errors, of_cell):
    """Put the differences between cells that other images see among the others, and complete those."""
    for lane in range(count):
        if kind[lane] == 2:
            for c in range(3):
                for i in range(d):
                    shifts[(3 * i + c) * m + lane] = other_f[lane, c, i]
                for q in range(errors):
                    shift_errors[(3 * q + c) * LANES + lane] = other_errors[lane, c, q]
        elif kind[lane] == 1:
            for c in range(3):
                diagonal = _DIAGONAL[c] * LANES + lane
                of_cell[(_OF_DIFFERENCE + c) * LANES + lane] = of_cell[diagonal] + of_cell[diagonal + 1]
            if of_cell[_THERE * LANES + lane + 1] == 0.0:
                kind[lane] = 0


@kernel
def write_cells(
    at, count, k, m, pair, ordered, kind, variance, of_cell, total, bounds, normals, points, joint, scratch,
    inverse, sigma, sigma_of_pair, sigma_relative, external, uncontrolled,
):  # fmt: skip
    """Fill in the results of some cells; returns the best pair of the last one."""
    for lane in range(count):
        j = ordered[at + lane]
        if of_cell[_THERE * LANES + lane] == 0.0:
            continue
        uncontrolled[j] = int(of_cell[_UNCONTROLLED * LANES + lane])
        for c in range(3):
            diagonal = _DIAGONAL[c] * LANES + lane
            sigma[j, c] = np.sqrt(variance * of_cell[diagonal] + of_cell[_NORMAL * LANES + diagonal])
            external[j, c] = of_cell[(_EXTERNAL + c) * LANES + lane]
            if kind[lane] > 0:
                own = variance * of_cell[(_OF_DIFFERENCE + c) * LANES + lane]
                sigma_relative[j, c] = np.sqrt(total[c * m + lane] + own)
        pair = best_pair(lane, k, pair, bounds, normals, points, joint, variance, scratch, inverse)
        if pair >= 0:
            a, b = pair // k, pair % k
            inverse_of_pair(lane, a, b, normals, scratch, inverse)
            for c in range(3):
                value = variance_of_pair(lane, k, a, b, c, inverse, points, joint, variance)
                sigma_of_pair[j, c] = np.sqrt(value)
    return pair


@kernel
def cell_accuracies(
    start, ordered, neighbour, axes, image, geometry, of_known, columns, row_start, column, blocks, border,
    corner, scale, variance, critical, least_control, sigma, sigma_of_pair, sigma_relative, external,
    uncontrolled,
):  # fmt: skip
    """Everything about the m cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

    ordered (m,) are the cells in the order in which they are worked on, best those with the same images one
    after another. geometry is what :func:`~adjust.observations.image_point_kernel.linearize_ray` wants to
    know of cameras, cells and rays. Derivatives by the cell are turned into its axes (m, 3, 3); those by
    system parameters are by the columns (n, w) of the border of each image (−1: held); of_known (r, 2, q)
    are the effects of considered parameters. variance is s². Fills sigma, sigma_of_pair, sigma_relative and
    external (m, 3) and uncontrolled (m,); cells of fewer than two rays keep what is there.
    """
    cells, width, errors, most = start.shape[0] - 1, columns.shape[1], of_known.shape[2], 1
    for j in range(cells):
        most = max(most, start[j + 1] - start[j])
    unknowns = 6 * most + corner.shape[0]
    # Of a cell and of its neighbour.
    misclosure, of_point = np.empty((2, most, 2)), np.empty((2, most, 2, 3))
    of_exposure, of_system = np.empty((2, most, 2, 6)), np.empty((2, most, 2, width))
    common, inverses, scratch = np.zeros((most, 2), np.int64), np.zeros((2, 3, 3)), np.zeros((3, 3))
    other_f, other_errors = np.zeros((LANES, 3, unknowns)), np.zeros((LANES, 3, errors))
    # Side by side.
    exposures, systems = np.zeros(12 * most * LANES), np.zeros(2 * most * width * LANES)
    points, knowns = np.zeros(6 * most * LANES), np.zeros(2 * most * errors * LANES)
    normals, gain = np.zeros(6 * most * LANES), np.zeros(6 * most * LANES)
    moved = np.zeros(6 * most * LANES)
    joint, bounds = np.zeros(4 * most * most * LANES), np.zeros(most * most * LANES)
    rows, product = np.zeros(2 * unknowns * LANES), np.zeros(3 * unknowns * LANES)
    f, shifts = np.zeros(3 * unknowns * LANES + 1), np.zeros(3 * unknowns * LANES)
    pairs = np.zeros(36 * most * most)
    f_errors, total = np.zeros(3 * errors * LANES + 1), np.zeros(3 * LANES)
    shift_errors = np.zeros(3 * errors * LANES)
    of_cell = np.zeros(_ROWS_OF_CELL * LANES)
    space, place = np.zeros(unknowns * unknowns), np.zeros((most, width), np.int64)
    used, kind = np.zeros(corner.shape[0], np.int64), np.zeros(LANES, np.int64)
    at, d, pair = 0, 0, -1
    known = space[:0].reshape(0, 0)
    while at < cells:
        j = ordered[at]
        first, last = start[j], start[j + 1]
        k = last - first
        if k < 2:
            at += 1
            continue
        before = ordered[at - 1] if at > 0 else j
        if d == 0 or not same_images(first, last, start[before], start[before + 1], image):
            pair = -1
            d = places(first, last, image, columns, place, used)
            known = space[: d * d].reshape(d, d)
            gather(first, last, image, used, row_start, column, blocks, border, corner, scale, pairs, known)
        count = 1
        while count < LANES and at + count < cells:
            j = ordered[at + count]
            if not same_images(first, last, start[j], start[j + 1], image):
                break
            count += 1
        m = min(-(-count // STEP) * STEP, LANES)
        put_together(
            at, count, m, ordered, start, neighbour, axes, image, geometry, of_known, place, misclosure,
            of_exposure, of_system, of_point, common, inverses, scratch, exposures, systems, points, knowns,
            other_f, other_errors, kind, of_cell,
        )  # fmt: skip
        gains(k, m, points, normals, of_cell, gain)
        joint_blocks(k, m, pairs, exposures, joint)
        if d > 6 * k:
            add_systems(k, m, known, place, exposures, systems, rows, joint)
        add_considered(k, m, errors, knowns, joint)
        joint_movements(k, m, gain, joint, moved)
        of_unknowns(k, m, d, place, gain, exposures, systems, errors, knowns, f, f_errors)
        differences(3 * d, m, f, m, shifts)
        differences(3 * errors, m, f_errors, LANES, shift_errors)
        differences_of_sets(m, count, d, errors, kind, other_f, other_errors, shifts, shift_errors, of_cell)
        variances(m, known, shifts, errors, shift_errors, product, total)
        of_all_rays(k, m, points, gain, joint, moved, variance, critical, least_control, of_cell)
        height_bounds(k, m, normals, variance, bounds)
        pair = write_cells(
            at, count, k, m, pair, ordered, kind, variance, of_cell, total, bounds, normals, points, joint,
            scratch, inverses[0], sigma, sigma_of_pair, sigma_relative, external, uncontrolled,
        )  # fmt: skip
        at += count
