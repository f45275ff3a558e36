"""Marginal cofactors of object points and of adjusted image points, compiled.

With Y = N_qp N_pp⁻¹ of one point and Q the cofactor of exposures and system parameters,

    Q_pp = N_pp⁻¹ + Yᵀ Q Y,     Q_qp = −Q Y,

and the cofactor of an adjusted, whitened image point is H = a Q_full aᵀ over the exposure, system
and point parts of its row a. Its redundancy matrix is I − H.

Rows (·, 4) have three numbers, one for each coordinate of the point, and a zero.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.number_rows import four, plus, put, six
from adjust.observations.image_point_kernel import linearize_ray
from adjust.solve.border_columns_kernel import TILE, open_tile, tiles_of_ray
from adjust.solve.covisibility_kernel import find_block


@kernel
def inverse_from_factor(lower, inverse):
    """Inverse = (L Lᵀ)⁻¹ of a 3 × 3 lower factor."""
    for c in range(3):
        for k in range(3):
            value = 1.0 if k == c else 0.0
            for q in range(k):
                value -= lower[k, q] * inverse[q, c]
            inverse[k, c] = value / lower[k, k]
        for k in range(2, -1, -1):
            value = inverse[k, c]
            for q in range(k + 1, 3):
                value -= lower[q, k] * inverse[q, c]
            inverse[k, c] = value / lower[k, k]


@small_kernel
def put_combined(result, row, first, a, x, b, y):
    """Write a x + b y, four numbers each, to a row of the result; the row ``first`` is added."""
    put(result, row, 0, plus(plus(first, a, x), b, y))


@small_kernel
def open_gains(a, of_exterior, of_point, inverse, count, found, tiled, position, gain, gain_border):
    """Y_a of one ray (six rows) and its part of Y_g (four rows for each tile of system parameters).

    inverse (4, 4) has N_pp⁻¹ in three rows, and a row of zeros.
    """
    nothing = four(inverse, 3, 0)
    x = plus(nothing, of_point[a, 0, 0], four(inverse, 0, 0))
    x = plus(plus(x, of_point[a, 0, 1], four(inverse, 1, 0)), of_point[a, 0, 2], four(inverse, 2, 0))
    y = plus(nothing, of_point[a, 1, 0], four(inverse, 0, 0))
    y = plus(plus(y, of_point[a, 1, 1], four(inverse, 1, 0)), of_point[a, 1, 2], four(inverse, 2, 0))
    for k in range(6):
        put_combined(gain, 6 * a + k, nothing, of_exterior[2 * a, k], x, of_exterior[2 * a + 1, k], y)
    first = 2 * found.shape[1] * a
    for i in range(count):
        for s in range(TILE):
            row = TILE * position[found[a, i]] + s
            put_combined(
                gain_border, row, four(gain_border, row, 0), tiled[first + 2 * i, s], x,
                tiled[first + 2 * i + 1, s], y,
            )  # fmt: skip


@small_kernel
def add_block(blocks, block, gain, b, moved, a):
    """Q_ab Y_b is added to the six rows of a; the block is Q_ab."""
    y0, y1, y2 = four(gain, 6 * b, 0), four(gain, 6 * b + 1, 0), four(gain, 6 * b + 2, 0)
    y3, y4, y5 = four(gain, 6 * b + 3, 0), four(gain, 6 * b + 4, 0), four(gain, 6 * b + 5, 0)
    for k in range(6):
        row = 6 * block + k
        total = plus(four(moved, 6 * a + k, 0), blocks[row, 0], y0)
        total = plus(plus(total, blocks[row, 1], y1), blocks[row, 2], y2)
        total = plus(plus(total, blocks[row, 3], y3), blocks[row, 4], y4)
        put(moved, 6 * a + k, 0, plus(total, blocks[row, 5], y5))


@small_kernel
def add_transposed(blocks, block, gain, b, moved, a):
    """Q_ab Y_b is added to the six rows of a; the block is Q_ba."""
    y0, y1, y2 = four(gain, 6 * b, 0), four(gain, 6 * b + 1, 0), four(gain, 6 * b + 2, 0)
    y3, y4, y5 = four(gain, 6 * b + 3, 0), four(gain, 6 * b + 4, 0), four(gain, 6 * b + 5, 0)
    row = 6 * block
    for k in range(6):
        total = plus(four(moved, 6 * a + k, 0), blocks[row, k], y0)
        total = plus(plus(total, blocks[row + 1, k], y1), blocks[row + 2, k], y2)
        total = plus(plus(total, blocks[row + 3, k], y3), blocks[row + 4, k], y4)
        put(moved, 6 * a + k, 0, plus(total, blocks[row + 5, k], y5))


@small_kernel
def multiply_exposures(rays, event, row_start, column, blocks, gain, moved):
    """Rows of the exposures in Q Y, as far as it comes from exposures."""
    count = rays[1] - rays[0]
    for a in range(count):
        e = event[rays[0] + a]
        for b in range(a, count):
            f = event[rays[0] + b]
            if e <= f:
                block = find_block(row_start, column, e, f)
                add_block(blocks, block, gain, b, moved, a)
                if a != b:
                    add_transposed(blocks, block, gain, a, moved, b)
            else:
                block = find_block(row_start, column, f, e)
                add_block(blocks, block, gain, a, moved, b)
                add_transposed(blocks, block, gain, b, moved, a)


@small_kernel
def multiply_border(rays, event, touched, local, border, corner, gain, gain_border, moved, moved_border):
    """Add to Q Y what the tiles of system parameters that one point touches give and get."""
    for u in range(touched):
        first = TILE * local[u]
        for a in range(rays[1] - rays[0]):
            e = event[rays[0] + a]
            for k in range(6):
                of_exposure = four(gain, 6 * a + k, 0)
                total = four(moved, 6 * a + k, 0)
                for s in range(TILE):
                    value = border[6 * e + k, first + s]
                    row = TILE * u + s
                    total = plus(total, value, four(gain_border, row, 0))
                    put(moved_border, row, 0, plus(four(moved_border, row, 0), value, of_exposure))
                put(moved, 6 * a + k, 0, total)
        for s in range(TILE):
            total = four(moved_border, TILE * u + s, 0)
            for v in range(touched):
                for q in range(TILE):
                    total = plus(
                        total, corner[first + s, TILE * local[v] + q], four(gain_border, TILE * v + q, 0)
                    )
            put(moved_border, TILE * u + s, 0, total)


@small_kernel
def add_squares(k, rows, gain, moved, own):
    """Row k of Yᵀ Q Y is added to own (3, 4), as far as it comes from so many rows."""
    total = four(own, k, 0)
    for row in range(rows):
        total = plus(total, gain[row, k], four(moved, row, 0))
    put(own, k, 0, total)


@small_kernel
def row_of_ray(
    a, r, e, diagonal, of_exterior, of_point, count, found, tiled, position, moved, moved_border, own, blocks,
    border, corner, nothing, through_point, through_exposure, through_border, mixed,
):  # fmt: skip
    """A Q_full of the row r of one ray: columns of its point, its exposure and its system parameters.

    They go to the row r of through_point (2, 4), through_exposure (2, 6) and through_border (2, ·). mixed
    (2, ·) has what the exposure gives to the last, and behind it what comes to the point from all others.
    """
    row, first = 2 * a + r, 2 * found.shape[1] * a + r
    total = four(nothing, 0, 0)
    of_images = six(nothing, 0, 0)
    for k in range(6):
        total = plus(total, -of_exterior[row, k], four(moved, 6 * a + k, 0))
        of_images = plus(of_images, of_exterior[row, k], six(blocks, 6 * diagonal + k, 0))
    put(through_exposure, r, 0, of_images)
    for i in range(count):
        here = TILE * found[a, i]
        for s in range(TILE):
            factor = -tiled[first + 2 * i, s]
            total = plus(total, factor, four(moved_border, TILE * position[found[a, i]] + s, 0))
        of_border = four(nothing, 0, 0)
        for k in range(6):
            of_border = plus(of_border, of_exterior[row, k], four(border, 6 * e + k, here))
        put(mixed, r, TILE * i, of_border)
        for j in range(count):
            for s in range(TILE):
                factor = tiled[first + 2 * j, s]
                of_border = plus(of_border, factor, four(corner, TILE * found[a, j] + s, here))
        put(through_border, r, TILE * i, of_border)
    put(mixed, r, TILE * count, total)
    for k in range(3):
        total = plus(total, of_point[a, r, k], four(own, k, 0))
    put(through_point, r, 0, total)


@small_kernel
def element_of_hat(
    a,
    r,
    t,
    of_exterior,
    of_point,
    count,
    width,
    tiled,
    through_point,
    through_exposure,
    through_border,
    mixed,
):
    """Element (r, t) of A Q_full Aᵀ of one ray."""
    value = 0.0
    for k in range(6):
        value += through_exposure[r, k] * of_exterior[2 * a + t, k]
    for k in range(3):
        value += through_point[r, k] * of_point[a, t, k] + mixed[t, TILE * count + k] * of_point[a, r, k]
    first = 2 * width * a
    for i in range(count):
        for s in range(TILE):
            value += through_border[r, TILE * i + s] * tiled[first + 2 * i + t, s]
            value += mixed[t, TILE * i + s] * tiled[first + 2 * i + r, s]
    return value


@kernel
def point_cofactors(
    first_point, last_point, point_start, image, event, camera_of_image, centres, rotations, heads, points,
    interior, ideal, slope, basis, inverse_sigma, active_point, columns, coupled_start, coupled_column,
    coupled_vector, point_factor, row_start, column, blocks, border, corner, cofactor, hat,
):  # fmt: skip
    """Cofactors of the object points first_point … last_point − 1, and hat matrices of their image points.

    ideal (r, 2), slope (r or 1, 2, 5) and basis (r, 2, t) are those of these points' rays alone; columns as
    of ``reduce_points``. Q is in blocks (6 blocks, 6), border (6 n, g) and corner (g, g), with a multiple g
    of four columns. Fills cofactor (m, 3, 3) and hat (n, 3), elements xx, xy, yy; inactive points keep what
    is there.
    """
    most = 1
    for j in range(first_point, last_point):
        most = max(most, point_start[j + 1] - point_start[j])
    tiles, width = border.shape[1] // TILE, columns.shape[1]
    misclosure, of_point = np.zeros((most, 2)), np.zeros((most, 2, 3))
    of_exterior, of_system = np.zeros((most, 2, 6)), np.zeros((most, 2, width))
    rows = of_exterior.reshape(2 * most, 6)
    found, counts = np.zeros((most, width), np.int64), np.zeros(most, np.int64)
    tiled = np.zeros((2 * most * width, TILE))
    gain, moved = np.zeros((6 * most, 4)), np.zeros((6 * most, 4))
    gain_border, moved_border = np.zeros((TILE * tiles, 4)), np.zeros((TILE * tiles, 4))
    local, position = np.empty(tiles, np.int64), np.full(tiles, -1, np.int64)
    inverse, own, nothing = np.zeros((4, 4)), np.zeros((3, 4)), np.zeros((1, 6))
    through_point, through_exposure = np.zeros((2, 4)), np.zeros((2, 6))
    through_border, mixed = np.zeros((2, TILE * width)), np.zeros((2, TILE * (width + 1)))
    rays = np.zeros(2, np.int64)
    for j in range(first_point, last_point):
        if not active_point[j]:
            continue
        rays[0], rays[1] = point_start[j], point_start[j + 1]
        count = rays[1] - rays[0]
        inverse_from_factor(point_factor[j], inverse)
        touched = 0
        for a in range(count):
            i = rays[0] + a
            linearize_ray(
                i, j, point_start[first_point], image, camera_of_image, centres, rotations, heads, points,
                interior, ideal, slope, basis, inverse_sigma, a, misclosure, of_exterior, of_system, of_point,
            )  # fmt: skip
            if tiles > 0:
                counts[a] = tiles_of_ray(a, image[i], of_system, columns, found, tiled)
                for t in range(counts[a]):
                    touched = open_tile(found[a, t], touched, local, position, gain_border, TILE)
            open_gains(a, rows, of_point, inverse, counts[a], found, tiled, position, gain, gain_border)
        for i in range(coupled_start[j], coupled_start[j + 1]):
            t = coupled_column[i] // TILE
            touched = open_tile(t, touched, local, position, gain_border, TILE)
            row = TILE * position[t] + coupled_column[i] - TILE * t
            for k in range(3):
                total = plus(four(gain_border, row, 0), coupled_vector[i, k], four(inverse, k, 0))
                put(gain_border, row, 0, total)
        moved[: 6 * count, :] = 0.0
        moved_border[: TILE * touched, :] = 0.0
        multiply_exposures(rays, event, row_start, column, blocks, gain, moved)
        multiply_border(rays, event, touched, local, border, corner, gain, gain_border, moved, moved_border)
        for k in range(3):
            put(own, k, 0, four(inverse, k, 0))
            add_squares(k, 6 * count, gain, moved, own)
            add_squares(k, TILE * touched, gain_border, moved_border, own)
            for q in range(3):
                cofactor[j, k, q] = own[k, q]
        for a in range(count):
            i = rays[0] + a
            for r in range(2):
                row_of_ray(
                    a, r, event[i], row_start[event[i]], rows, of_point, counts[a], found, tiled, position,
                    moved, moved_border, own, blocks, border, corner, nothing, through_point,
                    through_exposure, through_border, mixed,
                )  # fmt: skip
            for slot in range(3):
                hat[i, slot] = element_of_hat(
                    a, slot // 2, (slot + 1) // 2, rows, of_point, counts[a], width, tiled, through_point,
                    through_exposure, through_border, mixed,
                )  # fmt: skip
        for u in range(touched):
            position[local[u]] = -1
