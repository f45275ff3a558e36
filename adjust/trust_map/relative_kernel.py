"""Accuracy of the difference of two points that are measured in the same images, compiled."""

import numpy as np

from adjust.compiled import kernel
from adjust.trust_map.pairs_kernel import along_row, invert


@kernel
def relative(
    cell, first, last, other_first, other_last, image, position, of_exposure, of_point, count, found,
    of_system, of_known, blocks, border, corner, scale, variance, common, inverses, normal, of_images,
    of_border, columns, counts, of_errors, total, sigma,
):  # fmt: skip
    """σ of the difference of two points, both measured in the images that see both; unchanged without two.

    C = s² (M_a⁻¹ + M_b⁻¹) + F Q Fᵀ with F = G_a B_a − G_b B_b, image by image. position (k, k) is that of the
    first point. Fills one row of sigma (m, 3).
    """
    k, b = 0, other_first
    for a in range(first, last):
        while b < other_last and image[b] < image[a]:
            b += 1
        if b < other_last and image[b] == image[a]:
            common[k, 0], common[k, 1] = a, b
            k += 1
    if k < 2:
        return
    known = of_known.shape[2]
    for side in range(2):
        normal[:] = 0.0
        for i in range(k):
            ray = common[i, side]
            for r in range(2):
                for c in range(3):
                    for q in range(3):
                        normal[c, q] += of_point[ray, r, c] * of_point[ray, r, q]
        if not invert(normal, inverses[side]):
            return
    of_errors[:] = 0.0
    for i in range(k):
        counts[i] = 0
        of_images[i, :, :] = 0.0
        for side in range(2):
            ray, sign = common[i, side], 1.0 - 2.0 * side
            for c in range(3):
                for r in range(2):
                    gain = sign * (
                        inverses[side, c, 0] * of_point[ray, r, 0]
                        + inverses[side, c, 1] * of_point[ray, r, 1]
                        + inverses[side, c, 2] * of_point[ray, r, 2]
                    )
                    for q in range(6):
                        of_images[i, c, q] += gain * of_exposure[ray, r, q]
                    for q in range(known):
                        of_errors[c, q] += gain * of_known[ray, r, q]
                    for s in range(count[ray]):
                        place = counts[i] + s
                        if r == 0:
                            of_border[i, c, place] = 0.0
                        of_border[i, c, place] += gain * of_system[ray, r, s]
            for s in range(count[ray]):
                columns[i, counts[i] + s] = found[ray, s]
            counts[i] += count[ray]
    total[:] = 0.0
    for i in range(k):
        a = common[i, 0]
        for j in range(i, k):
            b = common[j, 0]
            block = position[a - first, b - first]
            x, y, z = 0.0, 0.0, 0.0
            for p in range(6):
                x += of_images[i, 0, p] * along_row(blocks, block, p, of_images, j, 0)
                y += of_images[i, 1, p] * along_row(blocks, block, p, of_images, j, 1)
                z += of_images[i, 2, p] * along_row(blocks, block, p, of_images, j, 2)
            twice = 1.0 if i == j else 2.0
            total[0] += twice * x
            total[1] += twice * y
            total[2] += twice * z
            for c in range(3):
                part = 0.0
                for s in range(counts[j]):
                    for p in range(6):
                        part += of_images[i, c, p] * border[image[a], p, columns[j, s]] * of_border[j, c, s]
                for s in range(counts[i]):
                    for p in range(6):
                        part += of_border[i, c, s] * border[image[b], p, columns[i, s]] * of_images[j, c, p]
                    for t in range(counts[j]):
                        part += of_border[i, c, s] * corner[columns[i, s], columns[j, t]] * of_border[j, c, t]
                total[c] += twice * part
    for c in range(3):
        value = scale * total[c] + variance * (inverses[0, c, c] + inverses[1, c, c])
        for q in range(known):
            value += of_errors[c, q] ** 2
        sigma[cell, c] = np.sqrt(value)
