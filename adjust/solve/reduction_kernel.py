"""Accumulation of the normal equations point by point, object points eliminated, compiled.

For one object point with rays a: N_pp = Σ A_pᵀ A_p (+ what control adds), W_a = A_aᵀ A_p, and with the
Cholesky factor N_pp = L Lᵀ the Schur complement is

    S_ab −= Z_a Z_bᵀ,  Z_a = W_a L⁻ᵀ,      s_a −= Z_a z,  z = L⁻¹ b_p.

All rows are whitened. Rays with zero weight (rejected) add nothing.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.number_rows import four, minus, plus, put, six
from adjust.observations.image_point_kernel import linearize_ray
from adjust.solve.border_columns_kernel import TILE, open_tile, tiles_of_ray
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
def solve_rows(columns, first, count, lower):
    """Three rows of columns (·, ·) from the first one on are multiplied by L⁻¹ from the left."""
    for i in range(3):
        for k in range(i):
            factor = lower[i, k]
            for q in range(count):
                columns[first + i, q] -= factor * columns[first + k, q]
        factor = 1.0 / lower[i, i]
        for q in range(count):
            columns[first + i, q] *= factor


@small_kernel
def subtract_product(blocks, position, reduced, a, b):
    """Z_a Z_bᵀ (6, 6) is taken off the block at a position; reduced (3, ·) has six columns Zᵀ of each ray."""
    x = six(reduced, 0, 6 * b)
    y = six(reduced, 1, 6 * b)
    z = six(reduced, 2, 6 * b)
    for k in range(6):
        total = minus(six(blocks, 6 * position + k, 0), reduced[0, 6 * a + k], x)
        total = minus(total, reduced[1, 6 * a + k], y)
        put(blocks, 6 * position + k, 0, minus(total, reduced[2, 6 * a + k], z))


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
    """Add what one ray gives to its exposure; W_aᵀ goes to the columns 6 a … 6 a + 5 of mixed (3, ·)."""
    x = six(of_exterior, 2 * a, 0)
    y = six(of_exterior, 2 * a + 1, 0)
    total = plus(six(rhs_exposure, e, 0), misclosure[a, 0], x)
    put(rhs_exposure, e, 0, plus(total, misclosure[a, 1], y))
    for k in range(6):
        p = of_exterior[2 * a, k]
        q = of_exterior[2 * a + 1, k]
        diagonal_exposure[e, k] += p * p + q * q
        total = plus(six(blocks, 6 * diagonal + k, 0), p, x)
        put(blocks, 6 * diagonal + k, 0, plus(total, q, y))
    for k in range(3):
        p = of_point[a, 0, k]
        q = of_point[a, 1, k]
        for s in range(6):
            mixed[k, 6 * a + s] = p * of_exterior[2 * a, s] + q * of_exterior[2 * a + 1, s]


@small_kernel
def add_products(sums, row, column, x, a, y, b):
    """Add a x + b y, four numbers each, to those of the sums from (row, column) on."""
    put(sums, row, column, plus(plus(four(sums, row, column), a, x), b, y))


@small_kernel
def subtract_products(sums, row, column, x, a, y, b, z, c):
    """Subtract a x + b y + c z, four numbers each, from those of the sums from (row, column) on."""
    put(sums, row, column, minus(minus(minus(four(sums, row, column), a, x), b, y), c, z))


@small_kernel
def add_system_rows(
    a, e, count, found, tiled, misclosure, of_exterior, border, corner, rhs_border, diagonal_border,
):  # fmt: skip
    """Add what one ray gives to the system parameters it touches; of the corner the upper tiles."""
    first = 2 * found.shape[1] * a
    for i in range(count):
        column = TILE * found[a, i]
        x = four(tiled, first + 2 * i, 0)
        y = four(tiled, first + 2 * i + 1, 0)
        add_products(rhs_border, 0, column, x, misclosure[a, 0], y, misclosure[a, 1])
        for s in range(TILE):
            diagonal_border[0, column + s] += tiled[first + 2 * i, s] ** 2 + tiled[first + 2 * i + 1, s] ** 2
        for k in range(6):
            add_products(border, 6 * e + k, column, x, of_exterior[2 * a, k], y, of_exterior[2 * a + 1, k])
        for j in range(i + 1):
            row = TILE * found[a, j]
            for s in range(TILE):
                add_products(
                    corner, row + s, column, x, tiled[first + 2 * j, s], y, tiled[first + 2 * j + 1, s]
                )


@small_kernel
def add_mixed_rows(a, count, found, tiled, of_point, position, mixed):
    """Add A_pᵀ A_g of one ray to the tiles of its point, three rows (·, 4) each."""
    first = 2 * found.shape[1] * a
    for i in range(count):
        x = four(tiled, first + 2 * i, 0)
        y = four(tiled, first + 2 * i + 1, 0)
        for q in range(3):
            add_products(mixed, 3 * position[found[a, i]] + q, 0, x, of_point[a, 0, q], y, of_point[a, 1, q])


@small_kernel
def subtract_system_rows(touched, local, tiles, half, corner, rhs_border):
    """Subtract Z_g Z_hᵀ and Z_g z of the system parameters that one point touches; the upper triangle."""
    for u in range(touched):
        column = TILE * local[u]
        x = four(tiles, 3 * u, 0)
        y = four(tiles, 3 * u + 1, 0)
        z = four(tiles, 3 * u + 2, 0)
        subtract_products(rhs_border, 0, column, x, half[0], y, half[1], z, half[2])
        for v in range(touched):
            row = TILE * local[v]
            if row <= column:
                for s in range(TILE):
                    subtract_products(
                        corner, row + s, column, x, tiles[3 * v, s], y, tiles[3 * v + 1, s],
                        z, tiles[3 * v + 2, s],
                    )  # fmt: skip


@small_kernel
def subtract_exposure_rows(
    rays, event, row_start, column, reduced, half, touched, local, tiles, blocks, border, rhs_exposure,
):  # fmt: skip
    """Subtract Z_a Z_bᵀ, Z_a Z_gᵀ and Z_a z of the rays of one point."""
    count = rays[1] - rays[0]
    for a in range(count):
        e = event[rays[0] + a]
        total = minus(six(rhs_exposure, e, 0), half[0], six(reduced, 0, 6 * a))
        total = minus(total, half[1], six(reduced, 1, 6 * a))
        put(rhs_exposure, e, 0, minus(total, half[2], six(reduced, 2, 6 * a)))
        for b in range(a, count):
            f = event[rays[0] + b]
            if e <= f:
                position = find_block(row_start, column, e, f)
                subtract_product(blocks, position, reduced, a, b)
                if e == f and a != b:  # measured twice in one event: the diagonal block gets both
                    subtract_product(blocks, position, reduced, b, a)
            else:
                subtract_product(blocks, find_block(row_start, column, f, e), reduced, b, a)
        for u in range(touched):
            first = TILE * local[u]
            x = four(tiles, 3 * u, 0)
            y = four(tiles, 3 * u + 1, 0)
            z = four(tiles, 3 * u + 2, 0)
            for k in range(6):
                subtract_products(
                    border, 6 * e + k, first, x, reduced[0, 6 * a + k], y, reduced[1, 6 * a + k],
                    z, reduced[2, 6 * a + k],
                )  # fmt: skip


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
    blocks (6 blocks, 6), border (6 n, g), corner (g, g; upper triangle), rhs_exposure (n, 6), rhs_border
    (1, g) are added to, with a multiple g of four columns; diagonal_exposure (n, 6), diagonal_border (1, g)
    collect the diagonal before reduction.

    Returns (weighted squares, Σ b_pᵀ N_pp⁻¹ b_p, first point behind a camera or −1, first undetermined
    point or −1).
    """
    most = 1
    for j in range(first, last):
        most = max(most, point_start[j + 1] - point_start[j])
    tiles = border.shape[1] // TILE
    width = columns.shape[1]
    base = point_start[first]
    misclosure = np.zeros((most, 2))
    of_exterior = np.zeros((most, 2, 6))
    rows_of_exterior = of_exterior.reshape(2 * most, 6)
    of_system = np.zeros((most, 2, width))
    of_point = np.zeros((most, 2, 3))
    reduced = np.zeros((3, 6 * most))
    reduced_border = np.zeros((3 * tiles, TILE))
    found = np.zeros((most, width), np.int64)
    tiled = np.zeros((2 * most * width, TILE))
    local = np.empty(tiles, np.int64)
    position = np.full(tiles, -1, np.int64)
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
                a, e, row_start[e], misclosure, rows_of_exterior, of_point, blocks, rhs_exposure,
                diagonal_exposure, reduced,
            )  # fmt: skip
            if tiles > 0:
                count = tiles_of_ray(a, image[rays[0] + a], of_system, columns, found, tiled)
                add_system_rows(
                    a, e, count, found, tiled, misclosure, rows_of_exterior, border, corner, rhs_border,
                    diagonal_border,
                )  # fmt: skip
                for i in range(count):
                    touched = open_tile(found[a, i], touched, local, position, reduced_border, 3)
                add_mixed_rows(a, count, found, tiled, of_point, position, reduced_border)
        for i in range(coupled_start[j], coupled_start[j + 1]):
            t = coupled_column[i] // TILE
            touched = open_tile(t, touched, local, position, reduced_border, 3)
            for q in range(3):
                reduced_border[3 * position[t] + q, coupled_column[i] - TILE * t] += coupled_vector[i, q]
        solve_rows(reduced, 0, 6 * (rays[1] - rays[0]), lower)
        for u in range(touched):
            solve_rows(reduced_border, 3 * u, TILE, lower)
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
    rhs, moved = np.zeros(3), np.zeros(2)
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
                moved[c] = 0.0
                for k in range(6):
                    moved[c] += of_exterior[0, c, k] * of_exposures[e, k]
            for s in range(columns.shape[1]):
                g = columns[image[i], s]
                if g >= 0:
                    moved[0] += of_system[0, 0, s] * of_border[g]
                    moved[1] += of_system[0, 1, s] * of_border[g]
            for k in range(3):
                rhs[k] -= of_point[0, 0, k] * moved[0] + of_point[0, 1, k] * moved[1]
        for k in range(3):
            for q in range(k):
                rhs[k] -= point_factor[j, k, q] * rhs[q]
            rhs[k] /= point_factor[j, k, k]
        for k in range(2, -1, -1):
            for q in range(k + 1, 3):
                rhs[k] -= point_factor[j, q, k] * rhs[q]
            rhs[k] /= point_factor[j, k, k]
            result[j, k] = rhs[k]
