"""Marginal cofactors of object points and of adjusted image points, compiled.

With Y = N_qp N_pp⁻¹ of one point and Q the cofactor of exposures and system parameters,

    Q_pp = N_pp⁻¹ + Yᵀ Q Y,     Q_qp = −Q Y,

and the cofactor of an adjusted, whitened image point is H = a Q_full aᵀ over the exposure, system
and point parts of its row a. Its redundancy matrix is I − H.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.observations.image_point_kernel import linearize_ray
from adjust.solve.border_columns_kernel import nonzero_columns, open_row, open_rows
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


@kernel
def point_cofactors(
    first_point, last_point, point_start, image, event, camera_of_image, centres, rotations, heads, points,
    interior, ideal, slope, basis, inverse_sigma, active_point, columns, coupled_start, coupled_column,
    coupled_vector, point_factor, row_start, column, blocks, border, corner, cofactor, hat,
):  # fmt: skip
    """Cofactors of the object points first_point … last_point − 1, and hat matrices of their image points.

    ideal (r, 2), slope (r or 1, 2, 5) and basis (r, 2, t) are those of these points' rays alone.
    Fills cofactor (m, 3, 3) and hat (n, 3), elements xx, xy, yy; inactive points keep what is there.
    """
    borders = border.shape[2]
    width = columns.shape[1]
    base = point_start[first_point]
    most = 1
    for j in range(first_point, last_point):
        most = max(most, point_start[j + 1] - point_start[j])
    misclosure = np.zeros((most, 2))
    of_exterior = np.zeros((most, 2, 6))
    of_system = np.zeros((most, 2, width))
    found = np.zeros((most, width), np.int64)
    counts = np.zeros(most, np.int64)
    through_corner = np.zeros((2, width))
    of_point = np.zeros((most, 2, 3))
    gain = np.zeros((most, 6, 3))
    moved = np.zeros((most, 6, 3))
    gain_border = np.zeros((borders, 3))
    moved_border = np.zeros((borders, 3))
    local = np.empty(borders, np.int64)
    position = np.full(borders, -1, np.int64)
    inverse = np.zeros((3, 3))
    mixed = np.zeros(3)
    to_point = np.zeros((2, 3))
    for j in range(first_point, last_point):
        if not active_point[j]:
            continue
        first = point_start[j]
        count = point_start[j + 1] - first
        inverse_from_factor(point_factor[j], inverse)
        touched = 0
        for a in range(count):
            i = first + a
            linearize_ray(
                i, j, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
                basis, inverse_sigma, a, misclosure, of_exterior, of_system, of_point,
            )  # fmt: skip
            counts[a] = nonzero_columns(a, image[i], of_system, columns, found)
            for k in range(6):
                for q in range(3):
                    mixed[q] = (
                        of_exterior[a, 0, k] * of_point[a, 0, q] + of_exterior[a, 1, k] * of_point[a, 1, q]
                    )
                for q in range(3):
                    gain[a, k, q] = (
                        mixed[0] * inverse[0, q] + mixed[1] * inverse[1, q] + mixed[2] * inverse[2, q]
                    )
            touched = open_rows(a, counts[a], found, touched, local, position, gain_border)
            for s in range(counts[a]):
                g = found[a, s]
                for q in range(3):
                    mixed[q] = of_system[a, 0, s] * of_point[a, 0, q] + of_system[a, 1, s] * of_point[a, 1, q]
                for q in range(3):
                    gain_border[position[g], q] += (
                        mixed[0] * inverse[0, q] + mixed[1] * inverse[1, q] + mixed[2] * inverse[2, q]
                    )
        for i in range(coupled_start[j], coupled_start[j + 1]):
            g = coupled_column[i]
            touched = open_row(g, touched, local, position, gain_border)
            for q in range(3):
                for k in range(3):
                    gain_border[position[g], q] += coupled_vector[i, k] * inverse[k, q]
        # moved = Q Y, exposure rows of this point and system rows it touches
        moved[:count, :, :] = 0.0
        moved_border[:touched, :] = 0.0
        for a in range(count):
            e = event[first + a]
            for b in range(a, count):
                f = event[first + b]
                if e <= f:
                    block = find_block(row_start, column, e, f)
                    for k in range(6):
                        for q in range(6):
                            value = blocks[block, k, q]
                            for c in range(3):
                                moved[a, k, c] += value * gain[b, q, c]
                                if a != b:
                                    moved[b, q, c] += value * gain[a, k, c]
                else:
                    block = find_block(row_start, column, f, e)
                    for k in range(6):
                        for q in range(6):
                            value = blocks[block, k, q]
                            for c in range(3):
                                moved[b, k, c] += value * gain[a, q, c]
                                moved[a, q, c] += value * gain[b, k, c]
            for u in range(touched):
                g = local[u]
                for k in range(6):
                    value = border[e, k, g]
                    for c in range(3):
                        moved[a, k, c] += value * gain_border[u, c]
                        moved_border[u, c] += value * gain[a, k, c]
        for u in range(touched):
            for v in range(touched):
                value = corner[local[u], local[v]]
                for c in range(3):
                    moved_border[u, c] += value * gain_border[v, c]
        for k in range(3):
            for q in range(3):
                value = inverse[k, q]
                for a in range(count):
                    for c in range(6):
                        value += gain[a, c, k] * moved[a, c, q]
                for u in range(touched):
                    value += gain_border[u, k] * moved_border[u, q]
                cofactor[j, k, q] = value
        for a in range(count):
            i = first + a
            e = event[i]
            touching = counts[a]
            diagonal = row_start[e]
            for r in range(2):
                for k in range(3):
                    value = 0.0
                    for c in range(6):
                        value += of_exterior[a, r, c] * moved[a, c, k]
                    for s in range(touching):
                        value += of_system[a, r, s] * moved_border[position[found[a, s]], k]
                    to_point[r, k] = value
                for s in range(touching):
                    value = 0.0
                    for q in range(touching):
                        value += corner[found[a, s], found[a, q]] * of_system[a, r, q]
                    through_corner[r, s] = value
            slot = 0
            for r in range(2):
                for t in range(r, 2):
                    value = 0.0
                    for k in range(6):
                        for q in range(6):
                            value += of_exterior[a, r, k] * blocks[diagonal, k, q] * of_exterior[a, t, q]
                        for s in range(touching):
                            value += border[e, k, found[a, s]] * (
                                of_exterior[a, r, k] * of_system[a, t, s]
                                + of_exterior[a, t, k] * of_system[a, r, s]
                            )
                    for s in range(touching):
                        value += of_system[a, r, s] * through_corner[t, s]
                    for k in range(3):
                        value -= to_point[r, k] * of_point[a, t, k] + to_point[t, k] * of_point[a, r, k]
                        for q in range(3):
                            value += of_point[a, r, k] * cofactor[j, k, q] * of_point[a, t, q]
                    hat[i, slot] = value
                    slot += 1
        for u in range(touched):
            position[local[u]] = -1
