"""Accumulation of the normal equations point by point, object points eliminated, compiled.

For one object point with rays a: N_pp = Σ A_pᵀ A_p (+ what control adds), W_a = A_aᵀ A_p, and with the
Cholesky factor N_pp = L Lᵀ the Schur complement is

    S_ab −= Z_a Z_bᵀ,  Z_a = W_a L⁻ᵀ,      s_a −= Z_a z,  z = L⁻¹ b_p.

All rows are whitened. Rays with zero weight (rejected) add nothing.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.observations.image_point_kernel import linearize_ray
from adjust.solve.border_columns_kernel import nonzero_columns, open_row, open_rows
from adjust.solve.covisibility_kernel import find_block

# A pivot below this part of the original diagonal element means that the point is not determined.
_PIVOT = 1e-13


@small_kernel
def factorize_point(normal):
    """Overwrite a 3 × 3 matrix with its lower Cholesky factor; False if it is singular."""
    for i in range(3):
        for j in range(i + 1):
            value = normal[i, j]
            for k in range(j):
                value -= normal[i, k] * normal[j, k]
            if i == j:
                if not value > _PIVOT * normal[i, i]:
                    return False
                normal[i, i] = np.sqrt(value)
            else:
                normal[i, j] = value / normal[j, j]
        for j in range(i + 1, 3):
            normal[i, j] = 0.0
    return True


@small_kernel
def times_inverse_transpose(rows, first, last, lower):
    """The rows (·, 3) first … last − 1 are multiplied by L⁻ᵀ from the right."""
    for i in range(first, last):
        for j in range(3):
            value = rows[i, j]
            for k in range(j):
                value -= rows[i, k] * lower[j, k]
            rows[i, j] = value / lower[j, j]


@small_kernel
def subtract_product(blocks, position, reduced, a, b):
    """Z_a Z_bᵀ (6, 6) is taken off the block at a position; six rows of reduced (·, 3) for every Z."""
    for q in range(6):
        r0 = reduced[6 * b + q, 0]
        r1 = reduced[6 * b + q, 1]
        r2 = reduced[6 * b + q, 2]
        for k in range(6):
            blocks[position, k, q] -= (
                reduced[6 * a + k, 0] * r0 + reduced[6 * a + k, 1] * r1 + reduced[6 * a + k, 2] * r2
            )


@small_kernel
def point_normals(
    rays, point, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
    basis, inverse_sigma, misclosure, of_exterior, of_system, of_point, normal, rhs,
):  # fmt: skip
    """Linearise the rays of one point and add A_pᵀ A_p and A_pᵀ l to normal (3, 3) and rhs (3,).

    rays is the pair (first, last + 1) of the point's image points; the row arrays are filled from 0.
    Returns the weighted square of the misclosures, or −1 if the point lies behind a camera.
    """
    total = 0.0
    for a in range(rays[1] - rays[0]):
        i = rays[0] + a
        front = linearize_ray(
            i, point, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
            basis, inverse_sigma, a, misclosure, of_exterior, of_system, of_point,
        )  # fmt: skip
        if not front and inverse_sigma[i, 0] > 0.0:
            return -1.0
        for c in range(2):
            total += misclosure[a, c] * misclosure[a, c]
            for k in range(3):
                rhs[k] += of_point[a, c, k] * misclosure[a, c]
                for q in range(3):
                    normal[k, q] += of_point[a, c, k] * of_point[a, c, q]
    return total


@small_kernel
def add_exposure_rows(
    a, e, diagonal, misclosure, of_exterior, of_point, blocks, rhs_exposure, diagonal_exposure, mixed,
):  # fmt: skip
    """Add what one ray gives to its exposure; W_a goes to the rows 6 a … 6 a + 5 of mixed (·, 3)."""
    for k in range(6):
        l0 = of_exterior[a, 0, k]
        l1 = of_exterior[a, 1, k]
        rhs_exposure[e, k] += l0 * misclosure[a, 0] + l1 * misclosure[a, 1]
        diagonal_exposure[e, k] += l0 * l0 + l1 * l1
        for q in range(6):
            blocks[diagonal, k, q] += l0 * of_exterior[a, 0, q] + l1 * of_exterior[a, 1, q]
        for q in range(3):
            mixed[6 * a + k, q] = l0 * of_point[a, 0, q] + l1 * of_point[a, 1, q]


@small_kernel
def add_system_rows(
    a, e, count, found, misclosure, of_exterior, of_system, border, corner, rhs_border, diagonal_border,
):  # fmt: skip
    """Add what one ray gives to the system parameters it touches; of the corner the upper triangle."""
    for s in range(count):
        g = found[a, s]
        s0 = of_system[a, 0, s]
        s1 = of_system[a, 1, s]
        rhs_border[g] += s0 * misclosure[a, 0] + s1 * misclosure[a, 1]
        diagonal_border[g] += s0 * s0 + s1 * s1
        for k in range(6):
            border[e, k, g] += of_exterior[a, 0, k] * s0 + of_exterior[a, 1, k] * s1
        for t in range(s, count):
            corner[g, found[a, t]] += s0 * of_system[a, 0, t] + s1 * of_system[a, 1, t]


@small_kernel
def subtract_system_rows(touched, local, reduced_border, half, corner, rhs_border):
    """Subtract Z_g Z_hᵀ and Z_g z of the system parameters that one point touches; the upper triangle."""
    for u in range(touched):
        g = local[u]
        z0 = reduced_border[u, 0]
        z1 = reduced_border[u, 1]
        z2 = reduced_border[u, 2]
        rhs_border[g] -= z0 * half[0] + z1 * half[1] + z2 * half[2]
        for v in range(u, touched):
            h = local[v]
            product = z0 * reduced_border[v, 0] + z1 * reduced_border[v, 1] + z2 * reduced_border[v, 2]
            if g <= h:
                corner[g, h] -= product
            else:
                corner[h, g] -= product


@small_kernel
def subtract_exposure_rows(
    rays, event, row_start, column, reduced, half, touched, local, reduced_border,
    blocks, border, rhs_exposure,
):  # fmt: skip
    """Subtract Z_a Z_bᵀ, Z_a Z_gᵀ and Z_a z of the rays of one point."""
    count = rays[1] - rays[0]
    for a in range(count):
        e = event[rays[0] + a]
        for k in range(6):
            rhs_exposure[e, k] -= (
                reduced[6 * a + k, 0] * half[0]
                + reduced[6 * a + k, 1] * half[1]
                + reduced[6 * a + k, 2] * half[2]
            )
        for b in range(a, count):
            f = event[rays[0] + b]
            if e <= f:
                position = find_block(row_start, column, e, f)
                subtract_product(blocks, position, reduced, a, b)
                if e == f and a != b:  # measured twice in one event: the diagonal block gets both
                    subtract_product(blocks, position, reduced, b, a)
            else:
                subtract_product(blocks, find_block(row_start, column, f, e), reduced, b, a)
        if touched > 0:
            for k in range(6):
                for u in range(touched):
                    border[e, k, local[u]] -= (
                        reduced[6 * a + k, 0] * reduced_border[u, 0]
                        + reduced[6 * a + k, 1] * reduced_border[u, 1]
                        + reduced[6 * a + k, 2] * reduced_border[u, 2]
                    )


@kernel
def reduce_points(
    first, last, point_start, image, event, camera_of_image, centres, rotations, heads, points, interior,
    ideal, slope, basis, inverse_sigma, active_point, columns, coupled_start, coupled_column, coupled_vector,
    damping, row_start, column,
    blocks, border, corner, rhs_exposure, rhs_border, diagonal_exposure, diagonal_border,
    point_normal, point_rhs,
):  # fmt: skip
    """Add the image points of the object points first … last − 1 to the reduced normal equations.

    point_normal (m, 3, 3) and point_rhs (m, 3) hold on entry what other groups add to the object
    points, on return the lower Cholesky factors of N_pp and the full right-hand sides b_p.
    ideal (r, 2), slope (r or 1, 2, 5) and basis (r, 2, t) are those of the lane's image points alone; event
    (r,) is the exposure whose pose each ray touches; columns (n, 3 + t, or 3 + t + 7 with heads) says where
    the system parameters of each image stand; coupled_vector (c, 3) are the
    elements of N in the rows of other columns of the border, those of each object point side by side.
    blocks (blocks, 6, 6), border (n, 6, g), corner (g, g; upper triangle), rhs_exposure (n, 6), rhs_border
    (g) are added to; diagonal_exposure (n, 6), diagonal_border (g) collect the diagonal before reduction.

    Returns (weighted squares, Σ b_pᵀ N_pp⁻¹ b_p, first point behind a camera or −1, first undetermined
    point or −1).
    """
    most = 1
    for j in range(first, last):
        most = max(most, point_start[j + 1] - point_start[j])
    borders = border.shape[2]
    width = columns.shape[1]
    base = point_start[first]
    misclosure = np.zeros((most, 2))
    of_exterior = np.zeros((most, 2, 6))
    of_system = np.zeros((most, 2, width))
    of_point = np.zeros((most, 2, 3))
    reduced = np.zeros((6 * most, 3))
    reduced_border = np.zeros((borders, 3))
    found = np.zeros((most, width), np.int64)
    local = np.empty(borders, np.int64)
    position = np.full(borders, -1, np.int64)
    half = np.zeros(3)
    rays = np.zeros(2, np.int64)
    total = 0.0
    eliminated = 0.0
    behind = -1
    undetermined = -1
    for j in range(first, last):
        if not active_point[j]:
            continue
        rays[0] = point_start[j]
        rays[1] = point_start[j + 1]
        lower = point_normal[j]
        rhs = point_rhs[j]
        squares = point_normals(
            rays, j, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
            basis, inverse_sigma, misclosure, of_exterior, of_system, of_point, lower, rhs,
        )  # fmt: skip
        if squares < 0.0:
            if behind < 0:
                behind = j
            continue
        total += squares
        for k in range(3):
            lower[k, k] *= 1.0 + damping
        if not factorize_point(lower):
            if undetermined < 0:
                undetermined = j
            continue
        for k in range(3):
            value = rhs[k]
            for q in range(k):
                value -= lower[k, q] * half[q]
            half[k] = value / lower[k, k]
            eliminated += half[k] * half[k]
        touched = 0
        for a in range(rays[1] - rays[0]):
            e = event[rays[0] + a]
            add_exposure_rows(
                a, e, row_start[e], misclosure, of_exterior, of_point, blocks, rhs_exposure,
                diagonal_exposure, reduced,
            )  # fmt: skip
            if borders > 0:
                count = nonzero_columns(a, image[rays[0] + a], of_system, columns, found)
                add_system_rows(
                    a, e, count, found, misclosure, of_exterior, of_system, border, corner, rhs_border,
                    diagonal_border,
                )  # fmt: skip
                touched = open_rows(a, count, found, touched, local, position, reduced_border)
                for s in range(count):
                    g = found[a, s]
                    for q in range(3):
                        reduced_border[position[g], q] += (
                            of_system[a, 0, s] * of_point[a, 0, q] + of_system[a, 1, s] * of_point[a, 1, q]
                        )
        for i in range(coupled_start[j], coupled_start[j + 1]):
            g = coupled_column[i]
            touched = open_row(g, touched, local, position, reduced_border)
            for q in range(3):
                reduced_border[position[g], q] += coupled_vector[i, q]
        times_inverse_transpose(reduced, 0, 6 * (rays[1] - rays[0]), lower)
        times_inverse_transpose(reduced_border, 0, touched, lower)
        subtract_exposure_rows(
            rays, event, row_start, column, reduced, half, touched, local, reduced_border,
            blocks, border, rhs_exposure,
        )  # fmt: skip
        subtract_system_rows(touched, local, reduced_border, half, corner, rhs_border)
        for u in range(touched):
            position[local[u]] = -1
    return total, eliminated, behind, undetermined


@kernel
def substitute_back(
    first, last, point_start, image, event, camera_of_image, centres, rotations, heads, points, interior,
    ideal, slope, basis, inverse_sigma, active_point, columns, coupled_start, coupled_column, coupled_vector,
    point_factor, point_rhs, of_exposures, of_border, result,
):  # fmt: skip
    """Increments dp = N_pp⁻¹ (b_p − Σ W_aᵀ dq_a) of the object points first … last − 1, to result (m, 3)."""
    misclosure = np.zeros((1, 2))
    of_exterior = np.zeros((1, 2, 6))
    of_system = np.zeros((1, 2, columns.shape[1]))
    of_point = np.zeros((1, 2, 3))
    rhs = np.zeros(3)
    # Not a literal, for which linearize_ray would be compiled once more.
    row = np.int64(0)
    base = point_start[first]
    for j in range(first, last):
        if not active_point[j]:
            continue
        for k in range(3):
            rhs[k] = point_rhs[j, k]
            for i in range(coupled_start[j], coupled_start[j + 1]):
                rhs[k] -= coupled_vector[i, k] * of_border[coupled_column[i]]
        for i in range(point_start[j], point_start[j + 1]):
            e = event[i]
            linearize_ray(
                i, j, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
                basis, inverse_sigma, row, misclosure, of_exterior, of_system, of_point,
            )  # fmt: skip
            for c in range(2):
                moved = 0.0
                for k in range(6):
                    moved += of_exterior[0, c, k] * of_exposures[e, k]
                for s in range(columns.shape[1]):
                    g = columns[image[i], s]
                    if g >= 0:
                        moved += of_system[0, c, s] * of_border[g]
                for k in range(3):
                    rhs[k] -= of_point[0, c, k] * moved
        for k in range(3):
            for q in range(k):
                rhs[k] -= point_factor[j, k, q] * rhs[q]
            rhs[k] /= point_factor[j, k, k]
        for k in range(2, -1, -1):
            for q in range(k + 1, 3):
                rhs[k] -= point_factor[j, q, k] * rhs[q]
            rhs[k] /= point_factor[j, k, k]
            result[j, k] = rhs[k]
