"""Right-hand sides of the reduced normal equations point by point, without their matrix, compiled.

With y = N_pp⁻¹ b_p the object point stands where its rays want it, the exposures being as they are. What
is left of the misclosures, l − A_p y, gives the reduced right-hand sides: s_a = A_aᵀ (l_a − A_p y).
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.number_rows import plus, put, six
from adjust.solve.reduction_kernel import factorize_point, point_normals


@small_kernel
def solve_point(lower, rhs, solved):
    """Write (L Lᵀ)⁻¹ rhs (3,) to solved (3,); returns rhsᵀ (L Lᵀ)⁻¹ rhs."""
    squares = 0.0
    for k in range(3):
        value = rhs[k]
        for q in range(k):
            value -= lower[k, q] * solved[q]
        solved[k] = value / lower[k, k]
        squares += solved[k] * solved[k]
    for k in range(2, -1, -1):
        for q in range(k + 1, 3):
            solved[k] -= lower[q, k] * solved[q]
        solved[k] /= lower[k, k]
    return squares


@small_kernel
def add_right_hand_sides(
    a, e, i, columns, misclosure, of_exterior, of_system, of_point, moved, rhs_exposure, rhs_border
):
    """Add what the ray a of a point gives, e its event and i its picture, once the point has moved (3,)."""
    x = misclosure[a, 0]
    y = misclosure[a, 1]
    for k in range(3):
        x -= of_point[a, 0, k] * moved[k]
        y -= of_point[a, 1, k] * moved[k]
    total = plus(six(rhs_exposure, e, 0), x, six(of_exterior, 2 * a, 0))
    put(rhs_exposure, e, 0, plus(total, y, six(of_exterior, 2 * a + 1, 0)))
    for s in range(columns.shape[1]):
        g = columns[i, s]
        if g >= 0:
            rhs_border[g] += of_system[a, 0, s] * x + of_system[a, 1, s] * y


@kernel
def reduce_right_hand_sides(
    first, last, point_start, image, event, camera_of_image, centres, rotations, heads, points, interior,
    ideal, slope, basis, inverse_sigma, active_point, columns, coupled_start, coupled_column, coupled_vector,
    point_normal, point_rhs, rhs_exposure, rhs_border,
):  # fmt: skip
    """Add the image points of the object points first … last − 1 to the reduced right-hand sides.

    point_normal (m, 3, 3) and point_rhs (m, 3) hold on entry what other groups add to the object points, on
    return the lower Cholesky factors of N_pp and the full right-hand sides b_p. rhs_exposure (n, 6) and
    rhs_border (g,) are added to.

    Returns (weighted squares, Σ b_pᵀ N_pp⁻¹ b_p, whether no point is behind a camera or undetermined).
    """
    most = 1
    for j in range(first, last):
        most = max(most, point_start[j + 1] - point_start[j])
    misclosure, of_point = np.zeros((most, 2)), np.zeros((most, 2, 3))
    of_exterior = np.zeros((most, 2, 6))
    rows_of_exterior = of_exterior.reshape(2 * most, 6)
    of_system = np.zeros((most, 2, columns.shape[1]))
    rays, moved = np.zeros(2, np.int64), np.zeros(3)
    total, eliminated, sound = 0.0, 0.0, True
    for j in range(first, last):
        if not active_point[j]:
            continue
        rays[0], rays[1] = point_start[j], point_start[j + 1]
        lower, rhs = point_normal[j], point_rhs[j]
        squares = point_normals(
            rays, j, point_start[first], image, camera_of_image, centres, rotations, heads, points, interior,
            ideal, slope, basis, inverse_sigma, misclosure, of_exterior, of_system, of_point, lower, rhs,
        )  # fmt: skip
        if squares < 0.0 or not factorize_point(lower):
            sound = False
            continue
        total += squares
        eliminated += solve_point(lower, rhs, moved)
        for a in range(rays[1] - rays[0]):
            i = rays[0] + a
            add_right_hand_sides(
                a, event[i], image[i], columns, misclosure, rows_of_exterior, of_system, of_point,
                moved, rhs_exposure, rhs_border,
            )  # fmt: skip
        for i in range(coupled_start[j], coupled_start[j + 1]):
            for k in range(3):
                rhs_border[coupled_column[i]] -= coupled_vector[i, k] * moved[k]
    return total, eliminated, sound
