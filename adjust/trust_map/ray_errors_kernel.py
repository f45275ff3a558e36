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
def _row(ray, r, image, first, of_exposure, of_border, x, border):
    """Three numbers of the row of A y of an image coordinate, without its object point."""
    of_own = six_of(of_exposure, 12 * ray + 6 * r, 1)
    y0 = products_of_six(of_own, six_of(x, 18 * image, 3))
    y1 = products_of_six(of_own, six_of(x, 18 * image + 1, 3))
    y2 = products_of_six(of_own, six_of(x, 18 * image + 2, 3))
    for a in range(of_border.shape[2]):
        y0 += of_border[ray, r, a] * border[a, first]
        y1 += of_border[ray, r, a] * border[a, first + 1]
        y2 += of_border[ray, r, a] * border[a, first + 2]
    return y0, y1, y2


@small_kernel
def _three(values, at):
    """Three numbers that follow each other."""
    return values[np.uintp(at)], values[np.uintp(at + 1)], values[np.uintp(at + 2)]


@small_kernel
def _with_product(sums, a, b):
    """Nine sums (3, 3), with the products of three numbers and three others added."""
    return (
        sums[0] + a[0] * b[0], sums[1] + a[0] * b[1], sums[2] + a[0] * b[2],
        sums[3] + a[1] * b[0], sums[4] + a[1] * b[1], sums[5] + a[1] * b[2],
        sums[6] + a[2] * b[0], sums[7] + a[2] * b[1], sums[8] + a[2] * b[2],
    )  # fmt: skip


@small_kernel
def _of_three(a, rows):
    """Three numbers times nine (3, 3)."""
    return (
        a[0] * rows[0] + a[1] * rows[3] + a[2] * rows[6],
        a[0] * rows[1] + a[1] * rows[4] + a[2] * rows[7],
        a[0] * rows[2] + a[1] * rows[5] + a[2] * rows[8],
    )  # fmt: skip


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
    rows = np.empty(6 * most)
    by_exposure, by_point = of_exposure.ravel(), of_point.ravel()
    of_points, by_join = cofactor.ravel(), join_vector.ravel()
    for cell in range(found.shape[0]):
        first, most0, most1, most2 = 3 * cell, 0.0, 0.0, 0.0
        for at in range(cell_start[cell], cell_start[cell + 1]):
            listed[cell_image[at]] = cell
        for at in range(cell_start[cell], cell_start[cell + 1]):
            for place in range(image_start[cell_image[at]], image_start[cell_image[at] + 1]):
                p = point[ray_of_image[place]]
                if done[p] == cell:
                    continue
                done[p] = cell
                # y_p = −N_p⁻¹ Cᵀ y, from all rays of the point.
                pulled = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                for own in range(ray_start[p], ray_start[p + 1]):
                    n, seen_in = own - ray_start[p], image[own]
                    if at_hand[seen_in] != cell:
                        at_hand[seen_in] = cell
                        for a in range(6):
                            for b in range(3):
                                own_x[18 * seen_in + 3 * a + b] = x[seen_in, a, first + b]
                    for r in range(2):
                        row = _row(own, r, seen_in, first, by_exposure, of_border, own_x, border)
                        pulled = _with_product(pulled, _three(by_point, 6 * own + 3 * r), row)
                        at_row = np.uintp(3 * (2 * n + r))
                        rows[at_row], rows[at_row + np.uintp(1)], rows[at_row + np.uintp(2)] = row
                for own in range(join_start[p], join_start[p + 1]):
                    column = join_column[own]
                    of_join = border[column, first], border[column, first + 1], border[column, first + 2]
                    pulled = _with_product(pulled, _three(by_join, 3 * own), of_join)
                c0, c1, c2 = (
                    _of_three(_three(of_points, 9 * p), pulled),
                    _of_three(_three(of_points, 9 * p + 3), pulled),
                    _of_three(_three(of_points, 9 * p + 6), pulled),
                )
                minus_y = c0 + c1 + c2
                for own in range(ray_start[p], ray_start[p + 1]):
                    if listed[image[own]] != cell:
                        continue
                    for r in range(2):
                        y0, y1, y2 = _of_three(_three(by_point, 6 * own + 3 * r), minus_y)
                        row0, row1, row2 = _three(rows, 3 * (2 * (own - ray_start[p]) + r))
                        error = detectable[own, r]
                        most0 = max(most0, abs(row0 - y0) * error)
                        most1 = max(most1, abs(row1 - y1) * error)
                        most2 = max(most2, abs(row2 - y2) * error)
        found[cell, 0], found[cell, 1], found[cell, 2] = most0, most1, most2
