"""Covariances of new ground points from all images that see them and from their best pair, compiled.

With the derivatives A of the rays of a point by its coordinates and B by the orientations and system
parameters z of the images, whose joint covariance is Q, and image coordinates of variance s²,

    G = (Aᵀ A)⁻¹ Aᵀ,    F = G B,    C = s² (Aᵀ A)⁻¹ + F Q Fᵀ.

Q Fᵀ is multiplied once for each cell. It also gives G W, with the covariance W = B Q Bᵀ of the rays, and the
difference of two cells with the same images. Of W itself only what belongs to a ray, or to a pair that may be
the best one, is computed. Cells with nearly the same images are worked on side by side (`lane_kernel`,
`groups`); scratch arrays are made once for all cells.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.trust_map.gains_kernel import (
    DIAGONAL,
    ERROR,
    EXTERNAL,
    NORMAL,
    THERE,
    UNCONTROLLED,
    gains,
    scratch,
)
from adjust.trust_map.groups_kernel import largest_step, leave_out, rays_of_group
from adjust.trust_map.joint_kernel import (
    add_systems_and_errors,
    gather,
    joint_movements,
    own_covariances,
    places,
    system_covariances,
)
from adjust.trust_map.lane_kernel import LANES, STEP, six_rows
from adjust.trust_map.pairs_kernel import best_pairs, height_bounds
from adjust.trust_map.rays_kernel import derivatives, put_cells, put_errors
from adjust.trust_map.relative_kernel import (
    covariances,
    of_unknowns,
    variances_of_differences,
)


@kernel
def of_all_rays(k, m, of_point, gain, own, moved, variance, critical, least_control, of_cell):
    """The largest effects of an undetected error in one of all rays.

    The residual of coordinate i has the variance (R (s² I + W) Rᵀ)_ii with R = I − A G. An error of

        ∇ = δ0 σ_v / R_ii

    is found with the power that belongs to δ0, and moves the point by G_i ∇. Coordinates with R_ii below the
    least control, whose errors show in no residual, are counted apart. moved is G W; own has the diagonal
    of W.
    """
    of_cell[EXTERNAL * LANES : (UNCONTROLLED + 1) * LANES] = 0.0
    for j in range(2 * k):
        diagonal = (3 * (j // 2) + 2 * (j % 2)) * LANES
        for n in range(m):
            at = np.uintp(3 * j * LANES + n)
            at1, at2 = at + np.uintp(LANES), at + np.uintp(2 * LANES)
            x, y, z = of_point[at], of_point[at1], of_point[at2]
            xx, xy, xz, yy, yz, zz = six_rows(of_cell, NORMAL * LANES + n)
            control = 1.0 - (x * gain[at] + y * gain[at1] + z * gain[at2])
            spread = own[np.uintp(diagonal + n)] - 2.0 * (x * moved[at] + y * moved[at1] + z * moved[at2])
            spread += x * (x * xx + 2.0 * y * xy) + y * (y * yy + 2.0 * z * yz) + z * (z * zz + 2.0 * x * xz)
            controlled = control >= least_control
            error = critical * np.sqrt(max(variance * control + spread, 0.0)) / control
            of_cell[np.uintp(ERROR * LANES + n)] = error if controlled else 0.0
            of_cell[np.uintp(UNCONTROLLED * LANES + n)] += 0.0 if controlled else 1.0
        for n in range(m):
            for c in range(3):
                row, o = (3 * j + c) * LANES + n, (EXTERNAL + c) * LANES + n
                effect = abs(gain[np.uintp(row)]) * of_cell[np.uintp(ERROR * LANES + n)]
                before = of_cell[np.uintp(o)]
                of_cell[np.uintp(o)] = effect if effect > before else before


@kernel
def write_cells(count, cell, variance, of_cell, sigma, sigma_of_block, external, uncontrolled):
    """Fill in what follows from all rays."""
    for lane in range(count):
        j = cell[lane]
        if of_cell[THERE * LANES + lane] == 0.0:
            continue
        uncontrolled[j] = int(of_cell[UNCONTROLLED * LANES + lane])
        for c in range(3):
            diagonal = DIAGONAL[c] * LANES + lane
            of_block = of_cell[NORMAL * LANES + diagonal]
            sigma[j, c] = np.sqrt(variance * of_cell[diagonal] + of_block)
            sigma_of_block[j, c] = np.sqrt(of_block)
            external[j, c] = of_cell[(EXTERNAL + c) * LANES + lane]


@kernel
def write_differences(
    k, count, cell, whole, there, neighbour, variance, of_cell, total, sigma_relative, left, others
):  # fmt: skip
    """Fill in the differences from cells in the next lane; the other cells with a neighbour join the left."""
    for lane in range(count):
        j = cell[lane]
        if neighbour[j] < 0:
            continue
        beside = lane + 1 < count and neighbour[j] == cell[lane + 1]
        if beside and not whole:
            for a in range(k):
                beside = beside and there[a * LANES + lane] == there[a * LANES + lane + 1]
        if not beside:
            others[left] = j
            left += 1
        elif of_cell[THERE * LANES + lane] > 0.0 and of_cell[THERE * LANES + lane + 1] > 0.0:
            for c in range(3):
                diagonal = DIAGONAL[c] * LANES + lane
                own = variance * (of_cell[diagonal] + of_cell[diagonal + 1])
                sigma_relative[j, c] = np.sqrt(total[c * LANES + lane] + own)
    return left


@kernel
def write_pairs(count, cell, chosen, of_cell, of_pair, sigma_of_pair):
    """Fill in what follows from the best pairs."""
    for lane in range(count):
        if chosen[lane] >= 0 and of_cell[THERE * LANES + lane] > 0.0:
            for c in range(3):
                sigma_of_pair[cell[lane], c] = np.sqrt(of_pair[c * LANES + lane])


@kernel
def cell_accuracies(
    start, image, groups, neighbour, x_in_local, axes, geometry, of_known, columns, cofactor, scale,
    variance, critical, least_control, sigma, sigma_of_block, sigma_of_pair, sigma_relative, external,
    uncontrolled,
):  # fmt: skip
    """Everything about the m cells whose rays start[j] … start[j + 1] − 1 are, images ascending.

    groups are those of :class:`~adjust.trust_map.groups.CellGroups`. geometry is what
    :func:`~adjust.trust_map.rays_kernel.derivatives` wants to know of cameras and rays. Derivatives by the
    cell are turned into its axes (m, 3, 3); those by system parameters are by the columns (n, w) of the
    border of each image (−1: held); of_known (r, 2, q) are the effects of considered parameters, with r = 0
    without any. cofactor is what :func:`~adjust.trust_map.joint_kernel.gather` wants; variance is s². Fills
    sigma, sigma_of_block, sigma_of_pair, sigma_relative and external (m, 3) and uncontrolled (m,). Returns
    the cells whose difference from the next one is left to do.
    """
    cells, cell_start, seen, seen_start = groups
    border, errors = cofactor[4].shape[0], of_known.shape[2]
    # Not a literal, for which callees would be compiled once more.
    left, others = np.int64(0), np.empty(start.shape[0] - 1, np.int64)
    of_rays, of_unknown, of_cells, places_of_rays, joint, products, of_pairs = scratch(
        largest_step(seen_start), columns.shape[1], errors, border
    )
    exposures, systems, points, knowns, normals, gain = of_rays
    f, movement, f_errors, _ = of_unknown
    of_cell, total, where, slopes, cell, _ = of_cells
    ray, _, scan = places_of_rays
    space, place, used = joint
    moved, own, bounds, crossing, both, there = products
    chosen, best, rows, found, of_pair = of_pairs
    for group in range(cell_start.shape[0] - 1):
        first, end = seen_start[group], cell_start[group + 1]
        k = seen_start[group + 1] - first
        d = places(first, first + k, seen, columns, place, used)
        known, free, pair = space[: d * d].reshape(d, d), d > 6 * k, np.int64(-1)
        gather(first, first + k, seen, used, cofactor, scale, known)
        for at in range(cell_start[group], end, LANES):
            count = min(LANES, end - at)
            m = -(-count // STEP) * STEP
            for n in range(m):
                cell[n] = cells[at + min(n, count - 1)]
            whole = rays_of_group(k, m, cell, first, seen, start, image, scan, ray, there)
            put_cells(m, cell, x_in_local, axes, where)
            derivatives(k, m, first, seen, ray, geometry, free, where, slopes, exposures, systems, points)
            put_errors(k, m, ray, of_known, knowns)
            if not whole:
                leave_out(
                    k, m, there, columns.shape[1], errors, exposures, points, systems, knowns
                )  # fmt: skip
            gains(k, m, points, normals, of_cell, gain)
            of_unknowns(k, m, d, place, gain, exposures, systems, errors, knowns, f, f_errors)
            np.dot(known, f[: 3 * d * m].reshape(d, 3 * m), movement[: 3 * d * m].reshape(d, 3 * m))
            covariances(m, d, f, movement, errors, f_errors, of_cell, NORMAL)
            joint_movements(k, m, place, movement, exposures, systems, errors, f_errors, knowns, moved)
            own_covariances(k, m, d, space, exposures, own)
            if free:
                system_covariances(k, m, known, place, exposures, systems, crossing, both)
            add_systems_and_errors(k, m, d - 6 * k, place, systems, crossing, both, errors, knowns, own)
            of_all_rays(k, m, points, gain, own, moved, variance, critical, least_control, of_cell)
            write_cells(count, cell, variance, of_cell, sigma, sigma_of_block, external, uncontrolled)
            variances_of_differences(m, d, f, movement, errors, f_errors, total)
            left = write_differences(
                k, count, cell, whole, there, neighbour, variance, of_cell, total, sigma_relative, left,
                others,
            )  # fmt: skip
            height_bounds(k, m, normals, variance, bounds)
            best_pairs(
                k, m, d, pair, bounds, normals, space, place, points, own, exposures, systems, crossing,
                both, errors, knowns, variance, rows, best, chosen, found, of_pair,
            )  # fmt: skip
            write_pairs(count, cell, chosen, of_cell, of_pair, sigma_of_pair)
            pair = chosen[count - 1]
    return others[:left]
