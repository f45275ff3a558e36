"""Differences of neighbouring cells that not the same images see, from the images that both see, compiled."""

import numpy as np

from adjust.compiled import kernel
from adjust.trust_map.gains_kernel import DIAGONAL, ROWS_OF_CELL, THERE, gains, scratch
from adjust.trust_map.groups_kernel import largest_step, leave_out, rays_of_group
from adjust.trust_map.joint_kernel import gather, places
from adjust.trust_map.lane_kernel import LANES, STEP
from adjust.trust_map.rays_kernel import derivatives, put_cells, put_errors
from adjust.trust_map.relative_kernel import of_unknowns, subtract, variances


@kernel
def of_common_rays(
    k, m, d, first, seen, cell, ray, there, x_in_local, axes, geometry, free, of_known, place, where, slopes,
    exposures, systems, points, knowns, normals, of_cell, gain, f, f_errors,
):  # fmt: skip
    """F of m cells from rays that are there, and what `gains` says of them."""
    errors = of_known.shape[2]
    put_cells(m, cell, x_in_local, axes, where)
    derivatives(k, m, first, seen, ray, geometry, free, where, slopes, exposures, systems, points)
    put_errors(k, m, ray, of_known, knowns)
    leave_out(k, m, there, place.shape[1], errors, exposures, points, systems, knowns)
    gains(k, m, points, normals, of_cell, gain)
    of_unknowns(k, m, d, place, gain, exposures, systems, errors, knowns, f, f_errors)


@kernel
def differences_in_common_images(
    start, image, groups, one, other, x_in_local, axes, geometry, of_known, columns, cofactor, scale,
    variance, sigma_relative,
):  # fmt: skip
    """Fill in sigma_relative of cells (n,) and others, from their common images.

    groups are those of the pairs with their common images; the rest as of :func:`cell_accuracies`.
    """
    pairs, pair_start, seen, seen_start = groups
    border, errors = cofactor[4].shape[0], of_known.shape[2]
    of_rays, of_unknown, of_cells, places_of_rays, joint, products, _ = scratch(
        largest_step(seen_start), columns.shape[1], errors, border
    )
    exposures, systems, points, knowns, normals, gain = of_rays
    f, movement, f_errors, of_other = of_unknown
    of_cell, total, where, slopes, cell, next_cell = of_cells
    ray, other_ray, scan = places_of_rays
    space, place, used = joint
    there, other_cell = products[5], np.zeros(ROWS_OF_CELL * LANES)
    other_there = np.zeros_like(there)
    for group in range(pair_start.shape[0] - 1):
        first, end = seen_start[group], pair_start[group + 1]
        k = seen_start[group + 1] - first
        d = places(first, first + k, seen, columns, place, used)
        known, free = space[: d * d].reshape(d, d), d > 6 * k
        gather(first, first + k, seen, used, cofactor, scale, known)
        for at in range(pair_start[group], end, LANES):
            count = min(LANES, end - at)
            m = -(-count // STEP) * STEP
            for n in range(m):
                cell[n] = one[pairs[at + min(n, count - 1)]]
                next_cell[n] = other[pairs[at + min(n, count - 1)]]
            rays_of_group(k, m, cell, first, seen, start, image, scan, ray, there)
            rays_of_group(k, m, next_cell, first, seen, start, image, scan, other_ray, other_there)
            for n in range(LANES * k):
                there[n] *= other_there[n]
            of_common_rays(
                k, m, d, first, seen, cell, ray, there, x_in_local, axes, geometry, free, of_known, place,
                where, slopes, exposures, systems, points, knowns, normals, of_cell, gain, f, f_errors,
            )  # fmt: skip
            of_common_rays(
                k, m, d, first, seen, next_cell, other_ray, there, x_in_local, axes, geometry, free, of_known,
                place, where, slopes, exposures, systems, points, knowns, normals, other_cell, gain, movement,
                of_other,
            )  # fmt: skip
            subtract(3 * d * m, f, movement)
            subtract(3 * errors * m, f_errors, of_other)
            np.dot(known, f[: 3 * d * m].reshape(d, 3 * m), movement[: 3 * d * m].reshape(d, 3 * m))
            variances(m, d, f, movement, errors, f_errors, total)
            for lane in range(count):
                if of_cell[THERE * LANES + lane] > 0.0 and other_cell[THERE * LANES + lane] > 0.0:
                    for c in range(3):
                        diagonal = DIAGONAL[c] * LANES + lane
                        own = variance * (of_cell[diagonal] + other_cell[diagonal])
                        sigma_relative[cell[lane], c] = np.sqrt(total[c * LANES + lane] + own)
