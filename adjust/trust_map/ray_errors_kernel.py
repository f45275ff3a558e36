"""Effects of undetected errors in the image points of a block, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel


@small_kernel
def _row(ray, r, image, first, of_exposure, of_border, x, border, rows, n):
    """Fill rows[n, r] (3,) with the row of A y of an image coordinate, without its object point."""
    for b in range(3):
        value = 0.0
        for a in range(6):
            value += of_exposure[ray, r, a] * x[image, a, b]
        for a in range(of_border.shape[2]):
            value += of_border[ray, r, a] * border[a, first + b]
        rows[n, r, b] = value


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
    k, most = ray_start.shape[0] - 1, 1
    for p in range(k):
        most = max(most, ray_start[p + 1] - ray_start[p])
    images = image_start.shape[0] - 1
    done, listed, at_hand = (
        np.full(k, -1, np.int64),
        np.full(images, -1, np.int64),
        np.full(images, -1, np.int64),
    )
    # The part of x of a cell, side by side, of the images that are asked for.
    own_x = np.empty((images, 6, 3))
    pulled, y_point, rows = np.empty((3, 3)), np.empty((3, 3)), np.empty((most, 2, 3))
    for cell in range(found.shape[0]):
        first = 3 * cell
        for at in range(cell_start[cell], cell_start[cell + 1]):
            listed[cell_image[at]] = cell
        for at in range(cell_start[cell], cell_start[cell + 1]):
            for place in range(image_start[cell_image[at]], image_start[cell_image[at] + 1]):
                p = point[ray_of_image[place]]
                if done[p] == cell:
                    continue
                done[p] = cell
                # y_p = −N_p⁻¹ Cᵀ y, from all rays of the point.
                pulled[:] = 0.0
                for own in range(ray_start[p], ray_start[p + 1]):
                    n, seen_in = own - ray_start[p], image[own]
                    if at_hand[seen_in] != cell:
                        at_hand[seen_in] = cell
                        for a in range(6):
                            for b in range(3):
                                own_x[seen_in, a, b] = x[seen_in, a, first + b]
                    for r in range(2):
                        _row(own, r, seen_in, first, of_exposure, of_border, own_x, border, rows, n)
                        for a in range(3):
                            for b in range(3):
                                pulled[a, b] += of_point[own, r, a] * rows[n, r, b]
                for own in range(join_start[p], join_start[p + 1]):
                    for a in range(3):
                        for b in range(3):
                            pulled[a, b] += join_vector[own, a] * border[join_column[own], first + b]
                for a in range(3):
                    for b in range(3):
                        value = 0.0
                        for c in range(3):
                            value -= cofactor[p, a, c] * pulled[c, b]
                        y_point[a, b] = value
                for own in range(ray_start[p], ray_start[p + 1]):
                    if listed[image[own]] != cell:
                        continue
                    for r in range(2):
                        for b in range(3):
                            value = rows[own - ray_start[p], r, b]
                            for a in range(3):
                                value += of_point[own, r, a] * y_point[a, b]
                            found[cell, b] = max(found[cell, b], abs(value) * detectable[own, r])
