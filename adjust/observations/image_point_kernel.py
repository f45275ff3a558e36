"""The collinearity equations of one image point and their derivatives, compiled.

Every other kernel calls this one, so the model is in one place:

    p = Rᵀ (X − X0),    u = −(p1, p2)/p3,    x̄ + Δ + v = c u + D

with x̄ = (x − x0, y − y0), the correction Δ(x̄) of the additional parameters and the distortion
D = c d(u) of their forward sets. Kernels get x + Δ − D (``ideal``), the basis f_k of the parameters that are
free (∂Δ/∂a_k or −∂D/∂a_k), and the slopes ∂Δ/∂x̄, ∂d/∂u and d side by side (``slope``).

Derivatives of v, with M = I + ∂d/∂u: M Jp Rᵀ (object point), −M Jp Rᵀ (projection centre), M Jp [p]× (small
rotation in the camera frame), u + d (c), the columns of I + ∂Δ/∂x̄ (x0, y0) and −f_k (a_k), with
Jp = [[−c/p3, 0, c p1/p3²], [0, −c/p3, c p2/p3²]].
"""

import numpy as np

from adjust.compiled import kernel, small_kernel


@small_kernel
def in_camera(exposure, point, centres, rotations, points):
    """Rᵀ (X − X0) of an object point: p1, p2, p3, metres, camera frame."""
    dx = points[point, 0] - centres[exposure, 0]
    dy = points[point, 1] - centres[exposure, 1]
    dz = points[point, 2] - centres[exposure, 2]
    p1 = rotations[exposure, 0, 0] * dx + rotations[exposure, 1, 0] * dy + rotations[exposure, 2, 0] * dz
    p2 = rotations[exposure, 0, 1] * dx + rotations[exposure, 1, 1] * dy + rotations[exposure, 2, 1] * dz
    p3 = rotations[exposure, 0, 2] * dx + rotations[exposure, 1, 2] * dy + rotations[exposure, 2, 2] * dz
    return p1, p2, p3


@small_kernel
def by_camera_point(p1, p2, p3, c, dxx, dxy, dyx, dyy, wx, wy):
    """Direction u of a point p, and M Jp: derivatives of x and y by p, multiplied by their weights.

    dxx … dyy are ∂d/∂u.
    """
    inverse = 1.0 / p3
    a = -p1 * inverse
    b = -p2 * inverse
    depth = c * inverse
    jx1 = -depth * (1.0 + dxx) * wx
    jx2 = -depth * dxy * wx
    jy1 = -depth * dyx * wy
    jy2 = -depth * (1.0 + dyy) * wy
    return a, b, jx1, jx2, jx1 * a + jx2 * b, jy1, jy2, jy1 * a + jy2 * b


@small_kernel
def by_rotation(j1, j2, j3, p1, p2, p3):
    """M Jp [p]×: derivatives of an image coordinate by the small rotation, from those by p."""
    return j2 * p3 - j3 * p2, -j1 * p3 + j3 * p1, j1 * p2 - j2 * p1


@small_kernel
def turn_to_event(row, exposure, first, heads, of_exterior, of_system):
    """Derivatives by the pose of a picture become those by the pose of its event.

    heads (n, 3, 14) is ``of_event`` of :class:`adjust.rig.Pictures`. The derivatives by position, rotation
    and synchronisation offset of the head go to the seven columns of of_system from the first one on, if it
    has them.
    """
    for c in range(2):
        x1, x2, x3 = of_exterior[row, c, 0], of_exterior[row, c, 1], of_exterior[row, c, 2]
        d1, d2, d3 = of_exterior[row, c, 3], of_exterior[row, c, 4], of_exterior[row, c, 5]
        for k in range(3):
            of_exterior[row, c, 3 + k] = (
                x1 * heads[exposure, 0, k] + x2 * heads[exposure, 1, k] + x3 * heads[exposure, 2, k]
            ) + (
                d1 * heads[exposure, 0, 3 + k]
                + d2 * heads[exposure, 1, 3 + k]
                + d3 * heads[exposure, 2, 3 + k]
            )
        if of_system.shape[2] > first:
            for k in range(3):
                of_system[row, c, first + k] = (
                    x1 * heads[exposure, 0, 6 + k]
                    + x2 * heads[exposure, 1, 6 + k]
                    + x3 * heads[exposure, 2, 6 + k]
                )
                of_system[row, c, first + 3 + k] = (
                    d1 * heads[exposure, 0, 9 + k]
                    + d2 * heads[exposure, 1, 9 + k]
                    + d3 * heads[exposure, 2, 9 + k]
                )
            of_system[row, c, first + 6] = (
                x1 * heads[exposure, 0, 12] + x2 * heads[exposure, 1, 12] + x3 * heads[exposure, 2, 12]
            ) + (d1 * heads[exposure, 0, 13] + d2 * heads[exposure, 1, 13] + d3 * heads[exposure, 2, 13])


@small_kernel
def linearize_ray(
    ray, point, base, image, camera_of_image, centres, rotations, heads, points, interior, ideal, slope,
    basis, inverse_sigma, row, misclosure, of_exterior, of_system, of_point,
):  # fmt: skip
    """Whitened observation equations of one image point; False if it lies behind the camera.

    Fills one row of misclosure (·, 2) = (observed − computed)/σ, of_exterior (·, 2, 6), of_system
    (·, 2, 3 + t) for c, x0, y0 and t additional parameters, and of_point (·, 2, 3), each multiplied by its
    1/σ. With heads (n, 3, 14) of a rig of_exterior is by the pose of the event, and of_system may have seven
    more columns for the head; None without a rig. ideal, slope and basis count from the image point ``base``;
    one slope alone applies to all.

    Whole arrays and the places in them are handed over: a slice for every ray would cost more than its
    equations, because slices count the references to their array.
    """
    exposure = image[ray]
    corrected = ray - base
    sloped = min(corrected, slope.shape[0] - 1)
    p1, p2, p3 = in_camera(exposure, point, centres, rotations, points)
    camera = camera_of_image[exposure]
    c = interior[camera, 0]
    wx = inverse_sigma[ray, 0]
    wy = inverse_sigma[ray, 1]
    a, b, jx1, jx2, jx3, jy1, jy2, jy3 = by_camera_point(
        p1, p2, p3, c, slope[sloped, 0, 2], slope[sloped, 0, 3], slope[sloped, 1, 2], slope[sloped, 1, 3],
        wx, wy,
    )  # fmt: skip
    misclosure[row, 0] = (ideal[corrected, 0] - interior[camera, 1] - c * a) * wx
    misclosure[row, 1] = (ideal[corrected, 1] - interior[camera, 2] - c * b) * wy
    for k in range(3):
        r1, r2, r3 = rotations[exposure, k, 0], rotations[exposure, k, 1], rotations[exposure, k, 2]
        of_point[row, 0, k] = jx1 * r1 + jx2 * r2 + jx3 * r3
        of_point[row, 1, k] = jy1 * r1 + jy2 * r2 + jy3 * r3
        of_exterior[row, 0, k] = -of_point[row, 0, k]
        of_exterior[row, 1, k] = -of_point[row, 1, k]
    of_exterior[row, 0, 3], of_exterior[row, 0, 4], of_exterior[row, 0, 5] = by_rotation(
        jx1, jx2, jx3, p1, p2, p3
    )
    of_exterior[row, 1, 3], of_exterior[row, 1, 4], of_exterior[row, 1, 5] = by_rotation(
        jy1, jy2, jy3, p1, p2, p3
    )
    of_system[row, 0, 0] = (a + slope[sloped, 0, 4]) * wx
    of_system[row, 1, 0] = (b + slope[sloped, 1, 4]) * wy
    # The principal point moves the ideal image point against it.
    of_system[row, 0, 1] = (1.0 + slope[sloped, 0, 0]) * wx
    of_system[row, 1, 1] = slope[sloped, 1, 0] * wy
    of_system[row, 0, 2] = slope[sloped, 0, 1] * wx
    of_system[row, 1, 2] = (1.0 + slope[sloped, 1, 1]) * wy
    for k in range(basis.shape[2]):
        of_system[row, 0, 3 + k] = -basis[corrected, 0, k] * wx
        of_system[row, 1, 3 + k] = -basis[corrected, 1, k] * wy
    if heads is not None:  # decided when it is compiled
        turn_to_event(row, exposure, 3 + basis.shape[2], heads, of_exterior, of_system)
    return p3 < 0.0


@kernel
def linearize_all(
    image, point, camera_of_image, centres, rotations, heads, points, interior, ideal, slope, basis,
    inverse_sigma, misclosure, of_exterior, of_system, of_point,
):  # fmt: skip
    """Observation equations of all image points, one after the other; the number behind the camera."""
    behind = 0
    # Not a literal, for which linearize_ray would be compiled once more.
    base = np.int64(0)
    for i in range(image.shape[0]):
        if not linearize_ray(
            i, point[i], base, image, camera_of_image, centres, rotations, heads, points, interior, ideal,
            slope, basis, inverse_sigma, i, misclosure, of_exterior, of_system, of_point,
        ):  # fmt: skip
            behind += 1
    return behind


@kernel
def directions(image, point, first, last, centres, rotations, points):
    """Directions u (last − first, 2) of the object points of some image points; zero behind the camera."""
    result = np.zeros((last - first, 2))
    for i in range(first, last):
        p1, p2, p3 = in_camera(image[i], point[i], centres, rotations, points)
        if p3 < 0.0:
            result[i - first, 0] = -p1 / p3
            result[i - first, 1] = -p2 / p3
    return result


@kernel
def misclosures(image, point, camera_of_image, centres, rotations, points, interior, ideal):
    """Observed − computed image coordinates (n, 2), metres; NaN behind the camera."""
    result = np.empty((image.shape[0], 2))
    for i in range(image.shape[0]):
        p1, p2, p3 = in_camera(image[i], point[i], centres, rotations, points)
        if p3 < 0.0:
            camera = camera_of_image[image[i]]
            result[i, 0] = ideal[i, 0] - (interior[camera, 1] - interior[camera, 0] * p1 / p3)
            result[i, 1] = ideal[i, 1] - (interior[camera, 2] - interior[camera, 0] * p2 / p3)
        else:
            result[i, 0] = np.nan
            result[i, 1] = np.nan
    return result
