"""Accuracy of the difference of two points that are measured in the same images, compiled.

C = s² (M_a⁻¹ + M_b⁻¹) + F Q Fᵀ,    F = G_a B_a − G_b B_b,    image by image.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.trust_map.pairs_kernel import invert


@kernel
def of_unknowns(first, last, d, place, gain, of_exposure, of_system, of_known, f, of_errors):
    """Fill f (3, d) with G B by z, and of_errors (3, q) with that by considered errors.

    gain (3, 2k) and place (k, w) are those of the k rays first … last − 1.
    """
    for c in range(3):
        for i in range(6 * (last - first), d):
            f[c, i] = 0.0
        for i in range(of_errors.shape[1]):
            of_errors[c, i] = 0.0
        for a in range(last - first):
            ray, x, y = first + a, gain[c, 2 * a], gain[c, 2 * a + 1]
            for q in range(6):
                f[c, 6 * a + q] = x * of_exposure[ray, 0, q] + y * of_exposure[ray, 1, q]
            for s in range(place.shape[1]):
                if place[a, s] >= 0:
                    f[c, place[a, s]] += x * of_system[ray, 0, s] + y * of_system[ray, 1, s]
            for q in range(of_errors.shape[1]):
                of_errors[c, q] += x * of_known[ray, 0, q] + y * of_known[ray, 1, q]


@kernel
def of_common_images(
    first, last, other_first, other_last, image, place, of_exposure, of_point, of_system, of_known, common,
    inverses, normal, f, of_errors,
):  # fmt: skip
    """Fill f (3, d) with F and of_errors (3, q) where only some images see both points; false without two.

    inverses (2, 3, 3) gets the (AᵀA)⁻¹ of the two points from these images. The rows of z are those of the
    images of the first point.
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
        normal[:] = 0.0
        for i in range(k):
            ray = common[i, side]
            for r in range(2):
                for c in range(3):
                    for q in range(3):
                        normal[c, q] += of_point[ray, r, c] * of_point[ray, r, q]
        if k < 2 or not invert(normal, inverses[side]):
            return False
        for i in range(k):
            ray, a, sign = common[i, side], common[i, 0] - first, 1.0 - 2.0 * side
            for c in range(3):
                i0, i1, i2 = inverses[side, c, 0], inverses[side, c, 1], inverses[side, c, 2]
                for r in range(2):
                    gain = sign * (
                        i0 * of_point[ray, r, 0] + i1 * of_point[ray, r, 1] + i2 * of_point[ray, r, 2]
                    )
                    for q in range(6):
                        f[c, 6 * a + q] += gain * of_exposure[ray, r, q]
                    for q in range(of_known.shape[2]):
                        of_errors[c, q] += gain * of_known[ray, r, q]
                    for s in range(place.shape[1]):
                        if place[a, s] >= 0:
                            f[c, place[a, s]] += gain * of_system[ray, r, s]
    return True


@small_kernel
def six(values, row, i):
    """Six numbers of a row from i on."""
    return (
        values[row, i], values[row, i + 1], values[row, i + 2], values[row, i + 3], values[row, i + 4],
        values[row, i + 5],
    )  # fmt: skip


@kernel
def sigma_of_difference(
    cell, first, last, d, known, f, of_errors, inverses, scale, variance, products, sigma
):
    """Fill one row of sigma (m, 3) with the σ of the difference; products (3, d) is scratch."""
    end = 6 * (last - first)
    products[:] = 0.0
    # Every column of F Q times that of F, of the blocks (a, b) with a ≤ b; those with a < b count twice.
    for own in range(0, end, 6):
        x0, x1, x2, x3, x4, x5 = six(f, 0, own)
        y0, y1, y2, y3, y4, y5 = six(f, 1, own)
        z0, z1, z2, z3, z4, z5 = six(f, 2, own)
        for j in range(d - own):
            i = np.uintp(own + j)  # unsigned: no test for a negative index
            q0, q1, q2 = known[own, i], known[own + 1, i], known[own + 2, i]
            q3, q4, q5 = known[own + 3, i], known[own + 4, i], known[own + 5, i]
            twice = 1.0 if j < 6 else 2.0
            x = ((x0 * q0 + x1 * q1) + (x2 * q2 + x3 * q3)) + (x4 * q4 + x5 * q5)
            y = ((y0 * q0 + y1 * q1) + (y2 * q2 + y3 * q3)) + (y4 * q4 + y5 * q5)
            z = ((z0 * q0 + z1 * q1) + (z2 * q2 + z3 * q3)) + (z4 * q4 + z5 * q5)
            products[0, i] += twice * f[0, i] * x
            products[1, i] += twice * f[1, i] * y
            products[2, i] += twice * f[2, i] * z
    for u in range(end, d):
        for v in range(end, d):
            for c in range(3):
                products[c, u] += f[c, u] * known[u, v] * f[c, v]
    for c in range(3):
        total = 0.0
        for u in range(d):
            total += products[c, u]
        value = scale * total + variance * (inverses[0, c, c] + inverses[1, c, c])
        for q in range(of_errors.shape[1]):
            value += of_errors[c, q] ** 2
        sigma[cell, c] = np.sqrt(value)
