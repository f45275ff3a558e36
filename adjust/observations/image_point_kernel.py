"""The collinearity equations of one image point and their derivatives, compiled.

Every other kernel calls this one, so the model stands in one place:

    p = Rᵀ (X − X0),    x̄ + Δx + v_x = −c p1/p3,    ȳ + Δy + v_y = −c p2/p3

with x̄ = x − x0, ȳ = y − y0 and the correction Δ(x̄, ȳ) = Σ f_k a_k of the additional parameters. Kernels
get x + Δx, y + Δy (``ideal``), the basis f_k of the parameters that are free, and the slope ∂Δ/∂(x̄, ȳ).

Derivatives of v: Jp Rᵀ (object point), −Jp Rᵀ (projection centre), Jp [p]× (small rotation in the
camera frame), (−p1/p3, −p2/p3) (c), the columns of I + ∂Δ/∂(x̄, ȳ) (x0, y0) and −f_k (a_k), with
Jp = [[−c/p3, 0, c p1/p3²], [0, −c/p3, c p2/p3²]].
"""

import numpy as np

from adjust.compiled import kernel, small_kernel


@small_kernel
def project(centre, local_from_camera, x_in_local, interior, predicted):
    """Image coordinates (2,) of an object point; False if it lies behind the camera."""
    dx = x_in_local[0] - centre[0]
    dy = x_in_local[1] - centre[1]
    dz = x_in_local[2] - centre[2]
    r = local_from_camera
    p1 = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
    p2 = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
    p3 = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
    if not p3 < 0.0:
        return False
    predicted[0] = interior[1] - interior[0] * p1 / p3
    predicted[1] = interior[2] - interior[0] * p2 / p3
    return True


@kernel
def linearize_ray(
    centre, local_from_camera, x_in_local, interior, ideal, slope, basis, inverse_sigma,
    misclosure, of_exterior, of_system, of_point,
):  # fmt: skip
    """Whitened observation equations of one image point; False if it lies behind the camera.

    Fills misclosure (2,) = (observed − computed)/σ, of_exterior (2, 6), of_system (2, 3 + t) for c, x0,
    y0 and t additional parameters, and of_point (2, 3), each row multiplied by its 1/σ.
    """
    dx = x_in_local[0] - centre[0]
    dy = x_in_local[1] - centre[1]
    dz = x_in_local[2] - centre[2]
    r = local_from_camera
    p1 = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
    p2 = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
    p3 = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
    c = interior[0]
    inverse = 1.0 / p3
    a = -p1 * inverse
    b = -p2 * inverse
    wx = inverse_sigma[0]
    wy = inverse_sigma[1]
    misclosure[0] = (ideal[0] - interior[1] - c * a) * wx
    misclosure[1] = (ideal[1] - interior[2] - c * b) * wy
    # Jp, whitened: d(x, y)/dp
    jx1 = -c * inverse * wx
    jx3 = c * p1 * inverse * inverse * wx
    jy2 = -c * inverse * wy
    jy3 = c * p2 * inverse * inverse * wy
    for k in range(3):
        of_point[0, k] = jx1 * r[k, 0] + jx3 * r[k, 2]
        of_point[1, k] = jy2 * r[k, 1] + jy3 * r[k, 2]
        of_exterior[0, k] = -of_point[0, k]
        of_exterior[1, k] = -of_point[1, k]
    # Jp [p]x
    of_exterior[0, 3] = -jx3 * p2
    of_exterior[0, 4] = -jx1 * p3 + jx3 * p1
    of_exterior[0, 5] = jx1 * p2
    of_exterior[1, 3] = jy2 * p3 - jy3 * p2
    of_exterior[1, 4] = jy3 * p1
    of_exterior[1, 5] = -jy2 * p1
    of_system[0, 0] = a * wx
    of_system[1, 0] = b * wy
    # The principal point moves the ideal image point against it.
    of_system[0, 1] = (1.0 + slope[0, 0]) * wx
    of_system[1, 1] = slope[1, 0] * wy
    of_system[0, 2] = slope[0, 1] * wx
    of_system[1, 2] = (1.0 + slope[1, 1]) * wy
    for k in range(basis.shape[1]):
        of_system[0, 3 + k] = -basis[0, k] * wx
        of_system[1, 3 + k] = -basis[1, k] * wy
    return p3 < 0.0


@kernel
def linearize_all(
    image, point, camera_of_image, centres, rotations, points, interior, ideal, slope, basis, inverse_sigma,
    misclosure, of_exterior, of_system, of_point,
):  # fmt: skip
    """Observation equations of all image points, one after the other; the number behind the camera."""
    behind = 0
    for i in range(image.shape[0]):
        e = image[i]
        if not linearize_ray(
            centres[e], rotations[e], points[point[i]], interior[camera_of_image[e]], ideal[i], slope[i],
            basis[i], inverse_sigma[i], misclosure[i], of_exterior[i], of_system[i], of_point[i],
        ):  # fmt: skip
            behind += 1
    return behind


@kernel
def misclosures(image, point, camera_of_image, centres, rotations, points, interior, ideal):
    """Observed − computed image coordinates (n, 2), metres; NaN behind the camera."""
    result = np.empty((image.shape[0], 2))
    predicted = np.empty(2)
    for i in range(image.shape[0]):
        e = image[i]
        inner = interior[camera_of_image[e]]
        if project(centres[e], rotations[e], points[point[i]], inner, predicted):
            result[i, 0] = ideal[i, 0] - predicted[0]
            result[i, 1] = ideal[i, 1] - predicted[1]
        else:
            result[i, 0] = np.nan
            result[i, 1] = np.nan
    return result
