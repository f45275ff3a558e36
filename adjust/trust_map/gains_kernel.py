"""Points from rays, many cells side by side, and the arrays that are needed for it, compiled.

With the derivatives A of the rays of a point by its coordinates, G = (Aᵀ A)⁻¹ Aᵀ.
"""

import numpy as np

from adjust.compiled import kernel
from adjust.trust_map.lane_kernel import LANES, add_six_rows, set_six_rows, six_rows
from adjust.trust_map.rays_kernel import ROWS_OF_SLOPE

#: Rows of what belongs to a cell: upper triangles of (Aᵀ A)⁻¹ and of Aᵀ A (then of F Q Fᵀ), the largest
#: effects, coordinates whose errors show in no residual, the smallest error of one that is found, and whether
#: there is a point.
INVERSE, NORMAL, EXTERNAL, UNCONTROLLED, ERROR, THERE = 0, 6, 12, 15, 16, 17
#: How many there are.
ROWS_OF_CELL = 18
#: Rows of a diagonal in those of the upper triangle.
DIAGONAL = (0, 3, 5)


@kernel
def gains(k, m, of_point, normals, of_cell, gain):
    """Fill the rows 3 j + c of gain with G, and normals with the Aᵀ A of each ray; G is 0 without a point.

    Rows 3 j + c of of_point are those by coordinate c of image coordinate j = 2 a + r.
    """
    of_cell[NORMAL * LANES : (NORMAL + 6) * LANES] = 0.0
    for a in range(k):
        for n in range(m):
            x0, x1, x2, y0, y1, y2 = six_rows(of_point, 6 * a * LANES + n)
            xx, xy, xz = x0 * x0 + y0 * y0, x0 * x1 + y0 * y1, x0 * x2 + y0 * y2
            yy, yz, zz = x1 * x1 + y1 * y1, x1 * x2 + y1 * y2, x2 * x2 + y2 * y2
            set_six_rows(normals, 6 * a * LANES + n, xx, xy, xz, yy, yz, zz)
            add_six_rows(of_cell, NORMAL * LANES + n, xx, xy, xz, yy, yz, zz)
    for n in range(m):
        a, b, c, d, e, f = six_rows(of_cell, NORMAL * LANES + n)
        i00, i01, i02 = d * f - e * e, c * e - b * f, b * e - c * d
        determinant = a * i00 + b * i01 + c * i02
        there = determinant > 1e-13 * a * d * f
        factor = 1.0 / determinant if there else 0.0
        set_six_rows(
            of_cell, INVERSE * LANES + n, i00 * factor, i01 * factor, i02 * factor, (a * f - c * c) * factor,
            (b * c - a * e) * factor, (a * d - b * b) * factor,
        )  # fmt: skip
        of_cell[np.uintp(THERE * LANES + n)] = 1.0 if there else 0.0
    for a in range(k):
        for n in range(m):
            xx, xy, xz, yy, yz, zz = six_rows(of_cell, INVERSE * LANES + n)
            x0, x1, x2, y0, y1, y2 = six_rows(of_point, 6 * a * LANES + n)
            set_six_rows(
                gain, 6 * a * LANES + n,
                xx * x0 + xy * x1 + xz * x2, xy * x0 + yy * x1 + yz * x2, xz * x0 + yz * x1 + zz * x2,
                xx * y0 + xy * y1 + xz * y2, xy * y0 + yy * y1 + yz * y2, xz * y0 + yz * y1 + zz * y2,
            )  # fmt: skip


@kernel
def scratch(most, width, errors, border):
    """Arrays for cells side by side with so many rays at most, made once for all of them."""
    unknowns, crossings = 6 * most + border, 2 * most * border * LANES
    of_rays = (
        np.zeros(12 * most * LANES), np.zeros(2 * most * width * LANES), np.zeros(6 * most * LANES),
        np.zeros(2 * most * errors * LANES), np.zeros(6 * most * LANES), np.zeros(6 * most * LANES),
    )  # fmt: skip
    # Up to whole sixes, and one more: the last cell is looked beyond.
    of_all, of_errors = 3 * (unknowns + 5) * LANES + 1, 3 * (errors + 5) * LANES + 1
    of_unknowns = np.zeros(of_all), np.zeros(of_all), np.zeros(of_errors), np.zeros(of_errors)
    of_cells = (
        np.zeros(ROWS_OF_CELL * LANES), np.zeros(3 * LANES), np.zeros(12 * LANES),
        np.zeros(ROWS_OF_SLOPE * LANES), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64),
    )  # fmt: skip
    places_of_rays = (
        np.zeros(most * LANES, np.int64), np.zeros(most * LANES, np.int64), np.zeros(LANES, np.int64),
    )  # fmt: skip
    joint = np.zeros(unknowns * unknowns), np.zeros((most, width), np.int64), np.zeros(border, np.int64)
    products = (
        np.zeros(6 * most * LANES), np.zeros(3 * most * LANES), np.zeros(most * most * LANES),
        np.zeros(crossings), np.zeros(crossings), np.zeros(most * LANES),
    )  # fmt: skip
    of_pairs = (
        np.zeros(LANES, np.int64),
        np.zeros(LANES),
        np.zeros(11 * LANES),
        np.zeros(3 * LANES),
        np.zeros(3 * LANES),
    )
    return of_rays, of_unknowns, of_cells, places_of_rays, joint, products, of_pairs
