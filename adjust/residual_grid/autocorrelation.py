"""Correlation of the residuals of an image by the distance of its points: what the model has not taken out.

    ρ(d) = mean(v_i v_j | distance in class d) / mean(v²),   pairs of points of the same image

White noise has ρ = 0 with the standard deviation 1/√N of N pairs. The orientation of the image takes about
three degrees of freedom from each coordinate of its n residuals, which leaves correlations of some −3/n
between neighbours whatever the noise; only what exceeds both is called correlation. Coordinate differences
of points at a distance d have the standard deviation σ_rel(d) = √(2 (1 − ρ(d))) σ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints, order_of_numbers
from adjust.compiled import kernel
from adjust.residual_grid.residual_grid import root_mean_square

#: Upper limits of the classes of distance, metres.
DISTANCES = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3)
# More pairs would say nothing new; beyond that images, and points in an image, are left out evenly.
_MOST_PAIRS = 50_000_000
_MOST_IN_IMAGE = 5_000
# Degrees of freedom that an orientation takes from one coordinate, doubled for the ends of strips.
_ABSORBED = 6.0


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Correlation by distance; arrays (b, 2) of the classes of distance for x and y.

    Attributes
    ----------
    upper : (b,) upper limits of the distances, metres; the classes follow each other from zero.
    pairs : number N of pairs.
    correlation : ρ; NaN without pairs.
    limit : |ρ| that white noise hardly exceeds: 3/√N + 6/n, n image points in an image.
    sigma : (2,) root mean square of the residuals, metres.
    """

    upper: Floats
    pairs: Ints
    correlation: Floats
    limit: Floats
    sigma: Floats

    @property
    def flagged(self) -> Bools:
        """(b, 2) whether the residuals at this distance are correlated."""
        return np.asarray(np.abs(np.nan_to_num(self.correlation)) > self.limit)

    @property
    def relative_sigma(self) -> Floats:
        """(b, 2) standard deviation of coordinate differences at this distance, metres."""
        # A few pairs may give more than one.
        return np.asarray(np.sqrt(2.0 * np.maximum(1.0 - self.correlation, 0.0)) * self.sigma)


def autocorrelation(
    image: Ints, xy: Floats, residual: Floats, distances: tuple[float, ...] = DISTANCES
) -> Autocorrelation:
    """The correlation of residuals (n, 2) at image points (n, 2) of images (n,), metres.

    Parameters
    ----------
    residual : NaN for a coordinate that is not used.
    """
    order, start = _grouped(image)
    count, total = _sums_of_products(start, xy[order], residual[order], np.array(distances) ** 2)
    sigma = root_mean_square(residual[order])
    present = (
        np.add.reduceat(np.isfinite(residual[order]), start[:-1], axis=0) if len(order) else np.zeros((1, 2))
    )
    # An image weighs with its pairs.
    typical = np.sum(present**2, axis=0) / np.maximum(np.sum(present, axis=0), 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.where(count > 0, total / count / sigma**2, np.nan)
        limit = 3.0 / np.sqrt(count) + _ABSORBED / np.maximum(typical, 1.0)
    return Autocorrelation(np.array(distances), count, correlation, limit, sigma)


def _grouped(image: Ints) -> tuple[Ints, Ints]:
    """Rows sorted by image, and where each image begins; no more than the pairs allow, evenly chosen."""
    order, count = order_of_numbers(image), np.bincount(image)
    first, count = (np.cumsum(count) - count)[count > 0], count[count > 0]
    step = -(-count // _MOST_IN_IMAGE)
    left = -(-count // step)
    pairs = int(np.sum(left * (left - 1) // 2))
    images = np.arange(0, len(count), max(1, -(-pairs // _MOST_PAIRS)))
    rows = [order[first[i] : first[i] + count[i] : step[i]] for i in images]
    start = np.concatenate([[0], np.cumsum([len(part) for part in rows])]).astype(np.int64)
    return (np.concatenate(rows) if rows else order), start


@kernel
def _sums_of_products(start: Ints, xy: Floats, residual: Floats, limits: Floats) -> tuple[Ints, Floats]:
    """Pairs (b, 2) in every class of distance, and the sums (b, 2) of the products of their residuals.

    start : (images + 1,) where the image points of each image begin.
    residual : (n, 2), NaN for a coordinate that is not used.
    limits : (b,) squares of the upper limits of the classes, ascending.
    """
    classes = limits.shape[0]
    # The last row, of pairs that are too far apart, is dropped: most branches here would be guessed wrongly.
    count = np.zeros((classes + 1, 2), np.int64)
    total = np.zeros((classes + 1, 2))
    farthest = limits[classes - 1]
    for image in range(start.shape[0] - 1):
        # From left to right, so that most pairs that are too far apart are never looked at.
        order = start[image] + np.argsort(xy[start[image] : start[image + 1], 0])
        x, y, vx, vy = xy[order, 0], xy[order, 1], residual[order, 0], residual[order, 1]
        for a in range(len(order)):
            for b in range(a + 1, len(order)):
                dx, dy = x[a] - x[b], y[a] - y[b]
                if dx * dx >= farthest:
                    break
                square, k = dx * dx + dy * dy, 0
                for limit in limits:
                    k += square >= limit
                product = vx[a] * vx[b]
                if product == product:
                    count[k, 0] += 1
                    total[k, 0] += product
                product = vy[a] * vy[b]
                if product == product:
                    count[k, 1] += 1
                    total[k, 1] += product
    return count[:classes], total[:classes]
