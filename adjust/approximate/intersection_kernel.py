"""Intersection of the rays of object points with given orientations, compiled."""

import numpy as np

from adjust.compiled import kernel
from adjust.observations.image_point_kernel import linearize_ray
from adjust.solve.reduction_kernel import factorize_point

_REFINEMENTS = 8


@kernel
def solve_factorized(lower, rhs):
    """Overwrite rhs (3,) with (L Lᵀ)⁻¹ rhs."""
    for k in range(3):
        for q in range(k):
            rhs[k] -= lower[k, q] * rhs[q]
        rhs[k] /= lower[k, k]
    for k in range(2, -1, -1):
        for q in range(k + 1, 3):
            rhs[k] -= lower[q, k] * rhs[q]
        rhs[k] /= lower[k, k]


@kernel
def intersect(point_start, image, camera_of_image, centres, rotations, interior, ideal, inverse_sigma):
    """Least-squares intersection of the rays of every point.

    Starts from the point nearest to all rays, Σ (I − d dᵀ) X = Σ (I − d dᵀ) X0, and refines it on the
    collinearity equations. Returns points (m, 3), the largest angle between two rays (m,) in radians,
    and a status (m,): 0 intersected, 1 fewer than two rays, 2 rays parallel, 3 behind a camera.
    """
    m = point_start.shape[0] - 1
    points = np.full((m, 3), np.nan)
    angle = np.zeros(m)
    status = np.zeros(m, np.int64)
    most = 1
    for j in range(m):
        most = max(most, point_start[j + 1] - point_start[j])
    directions = np.empty((most, 3))
    normal = np.empty((3, 3))
    rhs = np.empty(3)
    misclosure = np.zeros((1, 2))
    of_exterior = np.zeros((1, 2, 6))
    of_system = np.zeros((1, 2, 3))
    of_point = np.zeros((1, 2, 3))
    no_slope = np.zeros((1, 2, 5))
    no_basis = np.zeros((1, 2, 0))
    # Not a literal, for which linearize_ray would be compiled once more.
    zero = np.int64(0)
    for j in range(m):
        first = point_start[j]
        count = point_start[j + 1] - first
        if count < 2:
            status[j] = 1
            continue
        normal[:, :] = 0.0
        rhs[:] = 0.0
        for a in range(count):
            e = image[first + a]
            inner = interior[camera_of_image[e]]
            x = ideal[first + a, 0] - inner[1]
            y = ideal[first + a, 1] - inner[2]
            length = np.sqrt(x * x + y * y + inner[0] * inner[0])
            for k in range(3):
                directions[a, k] = (
                    rotations[e, k, 0] * x + rotations[e, k, 1] * y - rotations[e, k, 2] * inner[0]
                ) / length
            for k in range(3):
                for q in range(3):
                    part = (1.0 if k == q else 0.0) - directions[a, k] * directions[a, q]
                    normal[k, q] += part
                    rhs[k] += part * centres[e, q]
            for b in range(a):
                cx = directions[a, 1] * directions[b, 2] - directions[a, 2] * directions[b, 1]
                cy = directions[a, 2] * directions[b, 0] - directions[a, 0] * directions[b, 2]
                cz = directions[a, 0] * directions[b, 1] - directions[a, 1] * directions[b, 0]
                sine = np.sqrt(cx * cx + cy * cy + cz * cz)
                angle[j] = max(angle[j], np.arcsin(min(1.0, sine)))
        if angle[j] < 1e-6 or not factorize_point(normal):
            status[j] = 2
            continue
        solve_factorized(normal, rhs)
        for k in range(3):
            points[j, k] = rhs[k]
        for _ in range(_REFINEMENTS):
            normal[:, :] = 0.0
            rhs[:] = 0.0
            front = True
            for i in range(first, first + count):
                if not linearize_ray(
                    i, j, zero, image, camera_of_image, centres, rotations, None, points, interior, ideal,
                    no_slope, no_basis, inverse_sigma, zero, misclosure, of_exterior, of_system, of_point,
                ):  # fmt: skip
                    front = False
                for c in range(2):
                    for k in range(3):
                        rhs[k] += of_point[0, c, k] * misclosure[0, c]
                        for q in range(3):
                            normal[k, q] += of_point[0, c, k] * of_point[0, c, q]
            if not front:
                status[j] = 3
                break
            if not factorize_point(normal):
                status[j] = 2
                break
            solve_factorized(normal, rhs)
            for k in range(3):
                points[j, k] += rhs[k]
            if rhs[0] * rhs[0] + rhs[1] * rhs[1] + rhs[2] * rhs[2] < 1e-16:
                break
    return points, angle, status
