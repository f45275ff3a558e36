"""Accuracy of the difference of two points that are measured in the same images, compiled.

C = s² (M_a⁻¹ + M_b⁻¹) + F Q Fᵀ,    F = G_a B_a − G_b B_b,    image by image.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.trust_map.lane_kernel import LANES, clear
from adjust.trust_map.pairs_kernel import invert


@small_kernel
def add_gains(f, own, gain, at, values, i, m):
    """Add to three rows of f the gains of a ray times two rows: derivatives of x and y."""
    for n in range(m):
        g = at + n
        x, y = values[np.uintp(i + n)], values[np.uintp(i + LANES + n)]
        f[np.uintp(own + n)] += gain[np.uintp(g)] * x + gain[np.uintp(g + 3 * LANES)] * y
        f[np.uintp(own + LANES + n)] += gain[np.uintp(g + LANES)] * x + gain[np.uintp(g + 4 * LANES)] * y
        f[np.uintp(own + 2 * LANES + n)] += (
            gain[np.uintp(g + 2 * LANES)] * x + gain[np.uintp(g + 5 * LANES)] * y
        )


@kernel
def of_unknowns(k, m, d, place, gain, of_exposure, of_system, errors, of_known, f, of_errors):
    """Fill the rows 3 i + c of f with G B by z of m cells, and 3 q + c of of_errors by considered errors."""
    width = place.shape[1]
    clear(f, 0, 3 * d * LANES)
    clear(of_errors, 0, 3 * errors * LANES)
    for a in range(k):
        at = 6 * a * LANES
        for q in range(6):
            i = 6 * a + q
            add_gains(f, 3 * i * LANES, gain, at, of_exposure, 2 * i * LANES, m)
        for s in range(width):
            if place[a, s] >= 0:
                add_gains(f, 3 * place[a, s] * LANES, gain, at, of_system, 2 * (width * a + s) * LANES, m)
        for q in range(errors):
            add_gains(of_errors, 3 * q * LANES, gain, at, of_known, 2 * (errors * a + q) * LANES, m)


@kernel
def of_common_images(
    first, last, other_first, other_last, image, place, of_exposure, of_point, of_system, of_known, common,
    inverses, normal, f, of_errors,
):  # fmt: skip
    """Fill f (3, d) with F and of_errors (3, q) where only some images see both points; false without two.

    of_exposure (2, k, 2, 6), of_point (2, k, 2, 3) and of_system (2, k, 2, w) are those of the two points.
    inverses (2, 3, 3) gets the (AᵀA)⁻¹ of the two from these images. The rows of z are those of the images
    of the first point.
    """
    k, b = 0, other_first
    for a in range(first, last):
        while b < other_last and image[b] < image[a]:
            b += 1
        if b < other_last and image[b] == image[a]:
            common[k, 0], common[k, 1] = a, b
            k += 1
    f[:] = 0.0
    of_errors[:] = 0.0
    for side in range(2):
        begin = first if side == 0 else other_first
        normal[:] = 0.0
        for i in range(k):
            n = common[i, side] - begin
            for r in range(2):
                for c in range(3):
                    for q in range(3):
                        normal[c, q] += of_point[side, n, r, c] * of_point[side, n, r, q]
        if k < 2 or not invert(normal, inverses[side]):
            return False
        for i in range(k):
            ray, a, sign = common[i, side], common[i, 0] - first, 1.0 - 2.0 * side
            n = ray - begin
            for c in range(3):
                i0, i1, i2 = inverses[side, c, 0], inverses[side, c, 1], inverses[side, c, 2]
                x0, x1, x2 = of_point[side, n, 0, 0], of_point[side, n, 0, 1], of_point[side, n, 0, 2]
                y0, y1, y2 = of_point[side, n, 1, 0], of_point[side, n, 1, 1], of_point[side, n, 1, 2]
                x = sign * (i0 * x0 + i1 * x1 + i2 * x2)
                y = sign * (i0 * y0 + i1 * y1 + i2 * y2)
                for q in range(6):
                    f[c, 6 * a + q] += x * of_exposure[side, n, 0, q] + y * of_exposure[side, n, 1, q]
                for s in range(place.shape[1]):
                    if place[a, s] >= 0:
                        f[c, place[a, s]] += x * of_system[side, n, 0, s] + y * of_system[side, n, 1, s]
                for q in range(of_known.shape[2]):
                    of_errors[c, q] += x * of_known[ray, 0, q] + y * of_known[ray, 1, q]
    return True


@kernel
def differences(rows, m, values, width, found):
    """Of every cell and the next one: m numbers of so many rows, which are so far apart in found."""
    for row in range(rows):
        one, own = row * LANES, row * width
        for n in range(m):
            found[np.uintp(own + n)] = values[np.uintp(one + n)] - values[np.uintp(one + n + 1)]


@kernel
def variances(m, known, f, errors, of_errors, product, total):
    """Fill total (3, m) with the diagonals of F Q Fᵀ and what considered errors add.

    f (d, 3, m); product is scratch of its size.
    """
    d = known.shape[0]
    np.dot(known, f[: 3 * d * m].reshape(d, 3 * m), product[: 3 * d * m].reshape(d, 3 * m))
    clear(total, 0, 3 * m)
    for i in range(d):
        own = 3 * m * i
        for n in range(3 * m):
            total[np.uintp(n)] += product[np.uintp(own + n)] * f[np.uintp(own + n)]
    for q in range(errors):
        for c in range(3):
            for n in range(m):
                error = of_errors[np.uintp((3 * q + c) * LANES + n)]
                total[np.uintp(c * m + n)] += error * error
