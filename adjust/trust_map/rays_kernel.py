"""Derivatives of the rays of new points, many cells side by side, compiled."""

import numpy as np

from adjust.compiled import kernel
from adjust.observations.image_point_kernel import by_camera_point, by_rotation
from adjust.trust_map.lane_kernel import LANES

# Rows of the slopes of a ray in two rows of five, as of linearize_ray.
ROWS_OF_SLOPE = 10


@kernel
def put_cells(m, cell, x_in_local, axes, where):
    """Fill where with the coordinates (3 rows) and the axes (9 rows) of m cells."""
    for n in range(m):
        j = cell[n]
        for c in range(3):
            where[c * LANES + n] = x_in_local[j, c]
            for e in range(3):
                where[(3 + 3 * c + e) * LANES + n] = axes[j, c, e]


@kernel
def derivatives(k, m, first, image, ray, geometry, free, where, slopes, of_exposure, of_system, of_point):
    """Derivatives of the rays of m cells in k images, image[first] and those behind it.

    Fills the rows 2 (6 a + q) + r of of_exposure, 2 (w a + s) + r of of_system if any of these is free, and
    3 (2 a + r) + c of of_point, in the axes of the cell, for coordinate r of ray a. ray[LANES a + n] is the
    place of a ray in slope and basis, where these have more than one. slopes is scratch.
    """
    camera_of_image, centres, rotations, interior, slope, basis = geometry
    for a in range(k):
        i = image[first + a]
        if a == 0 or slope.shape[0] > 1:
            put_slopes(m, a, ray, slope, slopes)
        c, own = interior[camera_of_image[i], 0], 12 * a * LANES
        one_image(
            m, c, centres[i, 0], centres[i, 1], centres[i, 2], rotations[i, 0, 0], rotations[i, 0, 1],
            rotations[i, 0, 2], rotations[i, 1, 0], rotations[i, 1, 1], rotations[i, 1, 2],
            rotations[i, 2, 0], rotations[i, 2, 1], rotations[i, 2, 2], where, slopes, of_exposure, own,
        )  # fmt: skip
        turned(m, of_exposure, own, where, of_point, 6 * a * LANES)
        if free:
            systems_of_image(m, a, i, ray, centres, rotations, where, slopes, basis, of_system,
            )  # fmt: skip


@kernel
def put_slopes(m, a, ray, slope, slopes):
    """Fill slopes with those of ray a of m cells; a single one belongs to all rays."""
    for r in range(2):
        for t in range(5):
            for n in range(m):
                at = ray[a * LANES + n] if slope.shape[0] > 1 else 0
                slopes[(5 * r + t) * LANES + n] = slope[at, r, t]


@kernel
def put_errors(k, m, ray, of_known, rows):
    """Write the effects (r, 2, q) of considered parameters into the rows 2 (q a + s) + r of m cells."""
    errors = of_known.shape[2]
    for a in range(k):
        for s in range(errors):
            for r in range(2):
                for n in range(m):
                    rows[(2 * (errors * a + s) + r) * LANES + n] = of_known[ray[a * LANES + n], r, s]


@kernel
def one_image(
    m, c, x0, y0, z0, r00, r01, r02, r10, r11, r12, r20, r21, r22, where, slopes, of_exposure, own
):  # fmt: skip
    """Twelve rows of derivatives by the orientation of an image of m cells."""
    for n in range(m):
        at = np.uintp(n)
        dx, dy, dz = where[at] - x0, where[np.uintp(n + LANES)] - y0, where[np.uintp(n + 2 * LANES)] - z0
        p1 = r00 * dx + r10 * dy + r20 * dz
        p2 = r01 * dx + r11 * dy + r21 * dz
        p3 = r02 * dx + r12 * dy + r22 * dz
        _, _, jx1, jx2, jx3, jy1, jy2, jy3 = by_camera_point(
            p1, p2, p3, c, slopes[np.uintp(n + 2 * LANES)], slopes[np.uintp(n + 3 * LANES)],
            slopes[np.uintp(n + 7 * LANES)], slopes[np.uintp(n + 8 * LANES)], 1.0, 1.0,
        )  # fmt: skip
        x3, x4, x5 = by_rotation(jx1, jx2, jx3, p1, p2, p3)
        y3, y4, y5 = by_rotation(jy1, jy2, jy3, p1, p2, p3)
        o = own + n
        of_exposure[np.uintp(o)] = -(jx1 * r00 + jx2 * r01 + jx3 * r02)
        of_exposure[np.uintp(o + LANES)] = -(jy1 * r00 + jy2 * r01 + jy3 * r02)
        of_exposure[np.uintp(o + 2 * LANES)] = -(jx1 * r10 + jx2 * r11 + jx3 * r12)
        of_exposure[np.uintp(o + 3 * LANES)] = -(jy1 * r10 + jy2 * r11 + jy3 * r12)
        of_exposure[np.uintp(o + 4 * LANES)] = -(jx1 * r20 + jx2 * r21 + jx3 * r22)
        of_exposure[np.uintp(o + 5 * LANES)] = -(jy1 * r20 + jy2 * r21 + jy3 * r22)
        of_exposure[np.uintp(o + 6 * LANES)] = x3
        of_exposure[np.uintp(o + 7 * LANES)] = y3
        of_exposure[np.uintp(o + 8 * LANES)] = x4
        of_exposure[np.uintp(o + 9 * LANES)] = y4
        of_exposure[np.uintp(o + 10 * LANES)] = x5
        of_exposure[np.uintp(o + 11 * LANES)] = y5


@kernel
def turned(m, of_exposure, own, where, of_point, o):
    """Six rows of derivatives by the point in the axes of m cells: minus those by the centre, turned."""
    for r in range(2):
        for c in range(3):
            for n in range(m):
                i, w = own + r * LANES + n, (3 + c) * LANES + n
                of_point[np.uintp(o + (3 * r + c) * LANES + n)] = -(
                    of_exposure[np.uintp(i)] * where[np.uintp(w)]
                    + of_exposure[np.uintp(i + 2 * LANES)] * where[np.uintp(w + 3 * LANES)]
                    + of_exposure[np.uintp(i + 4 * LANES)] * where[np.uintp(w + 6 * LANES)]
                )


@kernel
def systems_of_image(m, a, i, ray, centres, rotations, where, slopes, basis, of_system):
    """Rows of derivatives by c, x0, y0 and the additional parameters of ray a, in image i, of m cells."""
    width = 3 + basis.shape[2]
    for n in range(m):
        dx, dy, dz = (
            where[n] - centres[i, 0], where[n + LANES] - centres[i, 1], where[n + 2 * LANES] - centres[i, 2],
        )  # fmt: skip
        down = rotations[i, 0, 2] * dx + rotations[i, 1, 2] * dy + rotations[i, 2, 2] * dz
        for r in range(2):
            p = rotations[i, 0, r] * dx + rotations[i, 1, r] * dy + rotations[i, 2, r] * dz
            own = (2 * width * a + r) * LANES + n
            of_system[own] = -p / down + slopes[(5 * r + 4) * LANES + n]
            for s in range(2):
                of_system[own + 2 * (1 + s) * LANES] = slopes[(5 * r + s) * LANES + n] + (
                    1.0 if r == s else 0.0
                )
            for s in range(width - 3):
                of_system[own + 2 * (3 + s) * LANES] = -basis[ray[a * LANES + n], r, s]
