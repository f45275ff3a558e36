"""Accumulation of the normal equations point by point, object points eliminated, compiled.

For one object point with rays a: N_pp = Σ A_pᵀ A_p (+ what control adds), W_a = A_aᵀ A_p, and with the
Cholesky factor N_pp = L Lᵀ the Schur complement is

    S_ab −= Z_a Z_bᵀ,  Z_a = W_a L⁻ᵀ,      s_a −= Z_a z,  z = L⁻¹ b_p.

All rows are whitened. Rays with zero weight (rejected) add nothing.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.observations.image_point_kernel import linearize_ray
from adjust.solve.covisibility_kernel import find_block

# A pivot below this part of the original diagonal element means that the point is not determined.
_PIVOT = 1e-13


@kernel
def factorize_point(normal, lower):
    """Lower Cholesky factor of a 3 × 3 matrix; False if it is singular."""
    for i in range(3):
        for j in range(i + 1):
            value = normal[i, j]
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            if i == j:
                if not value > _PIVOT * normal[i, i]:
                    return False
                lower[i, i] = np.sqrt(value)
            else:
                lower[i, j] = value / lower[j, j]
        for j in range(i + 1, 3):
            lower[i, j] = 0.0
    return True


@kernel
def times_inverse_transpose(rows, lower, result, count):
    """Result = rows · L⁻ᵀ for the first ``count`` rows (count, 3)."""
    for i in range(count):
        for j in range(3):
            value = rows[i, j]
            for k in range(j):
                value -= result[i, k] * lower[j, k]
            result[i, j] = value / lower[j, j]


@kernel
def subtract_product(block, left, right):
    """Block (6, 6) −= left rightᵀ, both (6, 3)."""
    for q in range(6):
        r0 = right[q, 0]
        r1 = right[q, 1]
        r2 = right[q, 2]
        for k in range(6):
            block[k, q] -= left[k, 0] * r0 + left[k, 1] * r1 + left[k, 2] * r2


@kernel
def point_normals(
    rays, base, image, camera_of_image, centres, rotations, x_in_local, interior, ideal, slope, basis,
    inverse_sigma, misclosure, of_exterior, of_system, of_point, normal, rhs,
):  # fmt: skip
    """Linearise the rays of one point and add A_pᵀ A_p and A_pᵀ l to normal (3, 3) and rhs (3,).

    rays is the pair (first, last + 1) of the point's image points; the row arrays are filled from 0.
    ideal, slope and basis count from the image point ``base``; one slope alone holds for all.
    Returns the weighted square of the misclosures, or −1 if the point lies behind a camera.
    """
    total = 0.0
    for a in range(rays[1] - rays[0]):
        i = rays[0] + a
        e = image[i]
        front = linearize_ray(
            centres[e], rotations[e], x_in_local, interior[camera_of_image[e]], ideal[i - base],
            slope[min(i - base, slope.shape[0] - 1)], basis[i - base], inverse_sigma[i],
            misclosure[a], of_exterior[a], of_system[a], of_point[a],
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


@kernel
def nonzero_columns(of_system, columns, values, found):
    """Free parameters of a ray with a derivative other than zero; returns how many.

    Their derivatives go to values (2, 3 + t), their columns to found (3 + t,), in ascending order. Most
    terms of composed images are zero outside one CCD.
    """
    count = 0
    for s in range(columns.shape[0]):
        if columns[s] >= 0 and (of_system[0, s] != 0.0 or of_system[1, s] != 0.0):
            values[0, count] = of_system[0, s]
            values[1, count] = of_system[1, s]
            found[count] = columns[s]
            count += 1
    return count


@kernel
def add_system_rows(
    count, values, found, misclosure, of_exterior, border, corner, rhs_border, diagonal_border,
):  # fmt: skip
    """Add what one ray gives to the system parameters it touches; of the corner the upper triangle."""
    for s in range(count):
        g = found[s]
        s0 = values[0, s]
        s1 = values[1, s]
        rhs_border[g] += s0 * misclosure[0] + s1 * misclosure[1]
        diagonal_border[g] += s0 * s0 + s1 * s1
        for k in range(6):
            border[k, g] += of_exterior[0, k] * s0 + of_exterior[1, k] * s1
        for t in range(s, count):
            corner[g, found[t]] += s0 * values[0, t] + s1 * values[1, t]


@kernel
def subtract_system_rows(touched, local, reduced_border, half, corner, rhs_border):
    """Subtract Z_g Z_hᵀ and Z_g z of the system parameters that one point touches; the upper triangle."""
    for u in range(touched):
        g = local[u]
        zg = reduced_border[u]
        rhs_border[g] -= zg[0] * half[0] + zg[1] * half[1] + zg[2] * half[2]
        for v in range(u, touched):
            zh = reduced_border[v]
            h = local[v]
            product = zg[0] * zh[0] + zg[1] * zh[1] + zg[2] * zh[2]
            if g <= h:
                corner[g, h] -= product
            else:
                corner[h, g] -= product


@kernel
def subtract_exposure_rows(
    rays, image, row_start, column, reduced, half, touched, local, reduced_border,
    blocks, border, rhs_exposure,
):  # fmt: skip
    """Subtract Z_a Z_bᵀ, Z_a Z_gᵀ and Z_a z of the rays of one point."""
    count = rays[1] - rays[0]
    for a in range(count):
        e = image[rays[0] + a]
        za = reduced[a]
        for k in range(6):
            rhs_exposure[e, k] -= za[k, 0] * half[0] + za[k, 1] * half[1] + za[k, 2] * half[2]
        for b in range(a, count):
            f = image[rays[0] + b]
            zb = reduced[b]
            if e <= f:
                block = blocks[find_block(row_start, column, e, f)]
                subtract_product(block, za, zb)
                if e == f and a != b:  # measured twice in one image: the diagonal block gets both
                    subtract_product(block, zb, za)
            else:
                subtract_product(blocks[find_block(row_start, column, f, e)], zb, za)
        if touched > 0:
            of_image = border[e]
            for k in range(6):
                for u in range(touched):
                    zg = reduced_border[u]
                    of_image[k, local[u]] -= za[k, 0] * zg[0] + za[k, 1] * zg[1] + za[k, 2] * zg[2]


@kernel
def reduce_points(
    first, last, point_start, image, camera_of_image, centres, rotations, points, interior, ideal, slope,
    basis, inverse_sigma, active_point, columns, damping, row_start, column,
    blocks, border, corner, rhs_exposure, rhs_border, diagonal_exposure, diagonal_border,
    point_normal, point_rhs,
):  # fmt: skip
    """Add the image points of the object points first … last − 1 to the reduced normal equations.

    point_normal (m, 3, 3) and point_rhs (m, 3) hold on entry what other groups add to the object
    points, on return the lower Cholesky factors of N_pp and the full right-hand sides b_p.
    ideal (r, 2), slope (r or 1, 2, 2) and basis (r, 2, t) are those of the lane's image points alone;
    columns (n, 3 + t) says where the system parameters of each image stand.
    blocks (blocks, 6, 6), border (n, 6, g), corner (g, g; upper triangle), rhs_exposure (n, 6), rhs_border
    (g) are added to; diagonal_exposure (n, 6), diagonal_border (g) collect the diagonal before reduction.

    Returns (weighted squares, Σ b_pᵀ N_pp⁻¹ b_p, first point behind a camera or −1, first undetermined
    point or −1).
    """
    most = 1
    for j in range(first, last):
        most = max(most, point_start[j + 1] - point_start[j])
    borders = border.shape[2]
    width = 3 + basis.shape[2]
    base = point_start[first]
    misclosure = np.zeros((most, 2))
    of_exterior = np.zeros((most, 2, 6))
    of_system = np.zeros((most, 2, width))
    of_point = np.zeros((most, 2, 3))
    mixed = np.zeros((6, 3))
    reduced = np.zeros((most, 6, 3))
    mixed_border = np.zeros((borders, 3))
    reduced_border = np.zeros((borders, 3))
    values = np.zeros((2, width))
    found = np.zeros(width, np.int64)
    local = np.empty(borders, np.int64)
    position = np.full(borders, -1, np.int64)
    lower = np.zeros((3, 3))
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
        normal = point_normal[j]
        rhs = point_rhs[j]
        squares = point_normals(
            rays, base, image, camera_of_image, centres, rotations, points[j], interior, ideal, slope, basis,
            inverse_sigma, misclosure, of_exterior, of_system, of_point, normal, rhs,
        )  # fmt: skip
        if squares < 0.0:
            if behind < 0:
                behind = j
            continue
        total += squares
        for k in range(3):
            normal[k, k] *= 1.0 + damping
        if not factorize_point(normal, lower):
            if undetermined < 0:
                undetermined = j
            continue
        normal[:, :] = lower
        for k in range(3):
            value = rhs[k]
            for q in range(k):
                value -= lower[k, q] * half[q]
            half[k] = value / lower[k, k]
            eliminated += half[k] * half[k]
        touched = 0
        for a in range(rays[1] - rays[0]):
            e = image[rays[0] + a]
            ae = of_exterior[a]
            diagonal_block = blocks[row_start[e]]
            for k in range(6):
                l0 = ae[0, k]
                l1 = ae[1, k]
                rhs_exposure[e, k] += l0 * misclosure[a, 0] + l1 * misclosure[a, 1]
                diagonal_exposure[e, k] += l0 * l0 + l1 * l1
                for q in range(6):
                    diagonal_block[k, q] += l0 * ae[0, q] + l1 * ae[1, q]
                for q in range(3):
                    mixed[k, q] = l0 * of_point[a, 0, q] + l1 * of_point[a, 1, q]
            times_inverse_transpose(mixed, lower, reduced[a], 6)
            if borders > 0:
                count = nonzero_columns(of_system[a], columns[e], values, found)
                add_system_rows(
                    count, values, found, misclosure[a], ae, border[e], corner, rhs_border, diagonal_border
                )
                for s in range(count):
                    g = found[s]
                    if position[g] < 0:
                        position[g] = touched
                        local[touched] = g
                        mixed_border[touched, :] = 0.0
                        touched += 1
                    for q in range(3):
                        mixed_border[position[g], q] += (
                            values[0, s] * of_point[a, 0, q] + values[1, s] * of_point[a, 1, q]
                        )
        times_inverse_transpose(mixed_border, lower, reduced_border, touched)
        subtract_exposure_rows(
            rays, image, row_start, column, reduced, half, touched, local, reduced_border,
            blocks, border, rhs_exposure,
        )  # fmt: skip
        subtract_system_rows(touched, local, reduced_border, half, corner, rhs_border)
        for u in range(touched):
            position[local[u]] = -1
    return total, eliminated, behind, undetermined


@kernel
def substitute_back(
    first, last, point_start, image, camera_of_image, centres, rotations, points, interior, ideal, slope,
    basis, inverse_sigma, active_point, columns, point_factor, point_rhs, of_exposures, of_border, result,
):  # fmt: skip
    """Increments dp = N_pp⁻¹ (b_p − Σ W_aᵀ dq_a) of the object points first … last − 1, to result (m, 3)."""
    misclosure = np.zeros(2)
    of_exterior = np.zeros((2, 6))
    of_system = np.zeros((2, 3 + basis.shape[2]))
    of_point = np.zeros((2, 3))
    rhs = np.zeros(3)
    base = point_start[first]
    for j in range(first, last):
        if not active_point[j]:
            continue
        rhs[:] = point_rhs[j]
        for i in range(point_start[j], point_start[j + 1]):
            e = image[i]
            linearize_ray(
                centres[e], rotations[e], points[j], interior[camera_of_image[e]], ideal[i - base],
                slope[min(i - base, slope.shape[0] - 1)], basis[i - base], inverse_sigma[i],
                misclosure, of_exterior, of_system, of_point,
            )  # fmt: skip
            for c in range(2):
                moved = 0.0
                for k in range(6):
                    moved += of_exterior[c, k] * of_exposures[e, k]
                for s in range(columns.shape[1]):
                    g = columns[e, s]
                    if g >= 0:
                        moved += of_system[c, s] * of_border[g]
                for k in range(3):
                    rhs[k] -= of_point[c, k] * moved
        lower = point_factor[j]
        for k in range(3):
            for q in range(k):
                rhs[k] -= lower[k, q] * rhs[q]
            rhs[k] /= lower[k, k]
        for k in range(2, -1, -1):
            for q in range(k + 1, 3):
                rhs[k] -= lower[q, k] * rhs[q]
            rhs[k] /= lower[k, k]
        result[j, :] = rhs
