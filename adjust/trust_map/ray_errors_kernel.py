"""Effects of undetected errors in the image points of a block, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel


@small_kernel
def _row(ray, r, image, first, of_exposure, of_border, x, border, row):
    """Row (3,) of A y of an image coordinate, without its object point."""
    for b in range(3):
        value = 0.0
        for a in range(6):
            value += of_exposure[ray, r, a] * x[image, a, first + b]
        for a in range(of_border.shape[2]):
            value += of_border[ray, r, a] * border[a, first + b]
        row[b] = value


@kernel
def largest_effects(
    cell_start,
    cell_image,
    image_start,
    ray_of_image,
    ray_start,
    point,
    image,
    of_exposure,
    of_point,
    of_border,
    detectable,
    cofactor,
    join_start,
    join_column,
    join_vector,
    x,
    border,
    found,
):
    """Fill in found (c, 3): largest effects on points in c cells, of the rays in the images of each cell.

    Rays are those of k object points, point after point; x (n, 6, 3 c) and border (g, 3 c) are Q Fᵀ.
    """
    k = ray_start.shape[0] - 1
    done = np.full(k, -1, np.int64)
    y_point = np.empty((k, 3, 3))
    pulled, row = np.empty((3, 3)), np.empty(3)
    for cell in range(found.shape[0]):
        first = 3 * cell
        for at in range(cell_start[cell], cell_start[cell + 1]):
            for place in range(image_start[cell_image[at]], image_start[cell_image[at] + 1]):
                ray = ray_of_image[place]
                p = point[ray]
                if done[p] != cell:
                    done[p] = cell
                    # y_p = −N_p⁻¹ Cᵀ y, from all rays of the point.
                    pulled[:] = 0.0
                    for own in range(ray_start[p], ray_start[p + 1]):
                        for r in range(2):
                            _row(own, r, image[own], first, of_exposure, of_border, x, border, row)
                            for a in range(3):
                                for b in range(3):
                                    pulled[a, b] += of_point[own, r, a] * row[b]
                    for own in range(join_start[p], join_start[p + 1]):
                        for a in range(3):
                            for b in range(3):
                                pulled[a, b] += join_vector[own, a] * border[join_column[own], first + b]
                    for a in range(3):
                        for b in range(3):
                            value = 0.0
                            for c in range(3):
                                value -= cofactor[p, a, c] * pulled[c, b]
                            y_point[p, a, b] = value
                for r in range(2):
                    if detectable[ray, r] == 0.0:
                        continue
                    _row(ray, r, image[ray], first, of_exposure, of_border, x, border, row)
                    for b in range(3):
                        value = row[b]
                        for a in range(3):
                            value += of_point[ray, r, a] * y_point[p, a, b]
                        found[cell, b] = max(found[cell, b], abs(value) * detectable[ray, r])
