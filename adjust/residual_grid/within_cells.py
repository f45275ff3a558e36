"""Whether image errors vary within the sub-areas: a test that sees where corrections are too coarse.

Of the residuals of every second image of a set, and of the others, what corrections of the sub-areas could
still take away is taken off by least squares, so that nothing depends on how well these were found. What is
left is summed in nine parts of each sub-area, a of one half of the images and b of the other. The noise of
the two halves has nothing in common; errors of the camera have. With q numbering parts and coordinates,

    t = Σ a_q b_q / √Σ (a_q b_q)²

is standard normal where image errors do not vary within the sub-areas, whatever the distribution and the
variance of the noise, and Σ a_q b_q / Σ n_a n_b is the variance of these errors, n the numbers of residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse, special
from scipy.sparse.linalg import spsolve

from adjust.arrays import Bools, Floats, Ints
from adjust.residual_grid.format_cells import FormatCells, Interpolation

# Along each side of a sub-area; in halves of it a curvature would look like a mean.
_PARTS = 3
# Of the largest diagonal element, added where no residual determines a correction.
_RIDGE = 1e-9


@dataclass(frozen=True)
class WithinCells:
    """What residuals say of errors that vary within sub-areas.

    Attributes
    ----------
    rms : of these errors in the residuals, metres; zero where they show none.
    probability : of as much by chance where there are none.
    """

    rms: float
    probability: float


def within_cells(
    cells: FormatCells,
    interpolation: Interpolation,
    image: Ints,
    xy: Floats,
    residual: Floats,
    chosen: Bools,
) -> WithinCells | None:
    """The test for the images of one set; None where no part has residuals of both halves.

    Parameters
    ----------
    interpolation : of corrections between the sub-areas.
    image : (n,), xy : (n, 2), residual : (n, 2) of its image points, metres.
    chosen : (n, 2) the residuals that count.
    """
    half = np.unique(image, return_inverse=True)[1] % 2
    finer = cells.finer(_PARTS)
    part, most = finer.cell_of(xy), finer.count
    products, numbers = list[Floats](), list[Floats]()
    for coordinate in (0, 1):
        sums, counts = list[Floats](), list[Floats]()
        for own in (0, 1):
            rows = np.flatnonzero(chosen[:, coordinate] & (half == own))
            left = _left(cells, interpolation, xy[rows], residual[rows, coordinate])
            sums.append(np.bincount(part[rows], left, most).astype(np.float64))
            counts.append(np.bincount(part[rows], minlength=most).astype(np.float64))
        products.append(sums[0] * sums[1])
        numbers.append(counts[0] * counts[1])
    product, pairs = np.concatenate(products), float(np.sum(numbers))
    scatter = float(np.sqrt(np.sum(product**2)))
    if scatter == 0.0:
        return None
    total = float(product.sum())
    return WithinCells(np.sqrt(max(total, 0.0) / pairs), float(special.ndtr(-total / scatter)))


def _left(cells: FormatCells, interpolation: Interpolation, xy: Floats, residual: Floats) -> Floats:
    """Residuals (r,) of one coordinate without what corrections of the cells explain."""
    every = np.ones(cells.count, dtype=bool)
    matrix = cells.interpolation_matrix(every, xy, interpolation)
    normals = (matrix.T @ matrix).tocsc()
    ridge = _RIDGE * max(float(normals.diagonal().max()), 1.0)
    solved = spsolve(normals + ridge * sparse.eye_array(cells.count, format="csc"), matrix.T @ residual)
    return np.asarray(residual - matrix @ solved)
