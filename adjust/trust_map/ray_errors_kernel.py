"""Effects of undetected errors in the image points of a block, compiled."""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.quality.cofactor_kernel import inverse_from_factor
from adjust.trust_map.joint_kernel import products_of_six, six_of


@kernel
def cofactors_of_points(point_factor, points, cofactor):
    """Fill cofactor (k, 3, 3) with N_p⁻¹ of some points, from their lower factors (m, 3, 3)."""
    for k in range(points.shape[0]):
        inverse_from_factor(point_factor[points[k]], cofactor[k])


@small_kernel
def _row(ray, r, image, first, of_exposure, of_border, x, border, rows, n):
    """Fill three places of rows with the row of A y of an image coordinate, without its object point."""
    of_own = six_of(of_exposure, 12 * ray + 6 * r, 1)
    at = 3 * (2 * n + r)
    for b in range(3):
        value = products_of_six(of_own, six_of(x, 18 * image + b, 3))
        for a in range(of_border.shape[2]):
            value += of_border[ray, r, a] * border[a, first + b]
        rows[np.uintp(at + b)] = value


@small_kernel
def _three(values, at, step):
    """Three numbers that are so far apart."""
    return values[np.uintp(at)], values[np.uintp(at + step)], values[np.uintp(at + 2 * step)]


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
    own_x = np.empty(18 * images)
    pulled, y_point, rows = np.empty(9), np.empty(9), np.empty(6 * most)
    by_exposure, by_point, of_points = of_exposure.ravel(), of_point.ravel(), cofactor.ravel()
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
                                own_x[18 * seen_in + 3 * a + b] = x[seen_in, a, first + b]
                    for r in range(2):
                        _row(own, r, seen_in, first, by_exposure, of_border, own_x, border, rows, n)
                        r0, r1, r2 = _three(rows, 3 * (2 * n + r), 1)
                        a0, a1, a2 = _three(by_point, 6 * own + 3 * r, 1)
                        pulled[0] += a0 * r0
                        pulled[1] += a0 * r1
                        pulled[2] += a0 * r2
                        pulled[3] += a1 * r0
                        pulled[4] += a1 * r1
                        pulled[5] += a1 * r2
                        pulled[6] += a2 * r0
                        pulled[7] += a2 * r1
                        pulled[8] += a2 * r2
                for own in range(join_start[p], join_start[p + 1]):
                    for a in range(3):
                        for b in range(3):
                            pulled[3 * a + b] += join_vector[own, a] * border[join_column[own], first + b]
                for a in range(3):
                    c0, c1, c2 = _three(of_points, 9 * p + 3 * a, 1)
                    for b in range(3):
                        p0, p1, p2 = _three(pulled, b, 3)
                        y_point[3 * a + b] = -(c0 * p0 + c1 * p1 + c2 * p2)
                for own in range(ray_start[p], ray_start[p + 1]):
                    if listed[image[own]] != cell:
                        continue
                    for r in range(2):
                        a0, a1, a2 = _three(by_point, 6 * own + 3 * r, 1)
                        at_row, error = 3 * (2 * (own - ray_start[p]) + r), detectable[own, r]
                        for b in range(3):
                            y0, y1, y2 = _three(y_point, b, 3)
                            value = rows[np.uintp(at_row + b)] + a0 * y0 + a1 * y1 + a2 * y2
                            found[cell, b] = max(found[cell, b], abs(value) * error)
