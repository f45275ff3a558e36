"""Elimination of the object points from right-hand sides alone, compiled.

The matrix is factorised already; what is left of s = b_q − N_qp N_pp⁻¹ b_p for another b is a walk over
the rays: N_qp b = Σ A_qᵀ (A_p b), ray by ray.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.observations.image_point_kernel import linearize_ray


@kernel
def subtract_eliminated(
    first_point, last_point, point_start, image, event, camera_of_image, centres, rotations, heads, points,
    interior, ideal, slope, basis, inverse_sigma, active_point, compact, coupled_start, coupled_column,
    coupled_vector, point_factor, rhs_point, rhs_exposure, rhs_border,
):  # fmt: skip
    """Subtract N_qp N_pp⁻¹ b_p of the object points first_point … last_point − 1.

    rhs_point (m, 3, d) is b_p; rhs_exposure (n, 6, d) and rhs_border (k, d), of the columns that rays and
    couplings touch, are changed. ideal, slope and basis are those of these points' rays alone.
    """
    width = rhs_point.shape[2]
    misclosure = np.zeros((1, 2))
    of_exterior = np.zeros((1, 2, 6))
    of_system = np.zeros((1, 2, compact.shape[1]))
    of_point = np.zeros((1, 2, 3))
    solved, seen = np.zeros((3, width)), np.zeros(width)
    # Not a literal, for which linearize_ray would be compiled once more.
    row = np.int64(0)
    base = point_start[first_point]
    for j in range(first_point, last_point):
        if not active_point[j]:
            continue
        lower = point_factor[j]
        for t in range(width):
            for k in range(3):
                value = rhs_point[j, k, t]
                for q in range(k):
                    value -= lower[k, q] * solved[q, t]
                solved[k, t] = value / lower[k, k]
            for k in range(2, -1, -1):
                value = solved[k, t]
                for q in range(k + 1, 3):
                    value -= lower[q, k] * solved[q, t]
                solved[k, t] = value / lower[k, k]
        for i in range(coupled_start[j], coupled_start[j + 1]):
            for k in range(3):
                for t in range(width):
                    rhs_border[coupled_column[i], t] -= coupled_vector[i, k] * solved[k, t]
        for i in range(point_start[j], point_start[j + 1]):
            e = event[i]
            linearize_ray(
                i, j, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
                basis, inverse_sigma, row, misclosure, of_exterior, of_system, of_point,
            )  # fmt: skip
            # The vectors innermost: they lie side by side in memory.
            for c in range(2):
                for t in range(width):
                    seen[t] = (
                        of_point[0, c, 0] * solved[0, t]
                        + of_point[0, c, 1] * solved[1, t]
                        + of_point[0, c, 2] * solved[2, t]
                    )
                for k in range(6):
                    for t in range(width):
                        rhs_exposure[e, k, t] -= of_exterior[0, c, k] * seen[t]
                for s in range(compact.shape[1]):
                    g = compact[image[i], s]
                    if g >= 0:
                        for t in range(width):
                            rhs_border[g, t] -= of_system[0, c, s] * seen[t]


@kernel
def substitute_forward(point_factor, active_point, vectors):
    """Overwrite vectors b (m, 3, d) at the object points that are used with L⁻¹ b."""
    for j in range(vectors.shape[0]):
        if not active_point[j]:
            continue
        for t in range(vectors.shape[2]):
            for i in range(3):
                value = vectors[j, i, t]
                for k in range(i):
                    value -= point_factor[j, i, k] * vectors[j, k, t]
                vectors[j, i, t] = value / point_factor[j, i, i]
