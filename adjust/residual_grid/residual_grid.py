"""Mean residuals of all images of a camera in sub-areas of its format, and what can be said about them.

What all images show at the same place of the format is an error of the camera. The mean residual of a
cell, v = adjusted − observed, is what has to be *added* to measurements there; the systematic image error
has the opposite sign. It is smaller than the error: the unknowns absorb a part, an error e of one
observation alone leaves v = −r e with its redundancy number r, and an error common to all images leaves
nothing of what orientations and object points can imitate. Hence the iteration in ``grid_iteration``.

Only coordinates count that others control: of a point with two rays the coordinate across the base shows
errors, the one along it hardly any. So each coordinate of a cell has its own number of residuals.

The standard deviation of a mean is that of the mean *residual*, s/√n with the scatter s of the residuals
in the cell, so it contains their redundancy as they do. Whether a mean vector differs from zero is
Hotelling's test (1931): T² = mᵀ C⁻¹ m with the estimated covariance matrix C of the means, and for n
residuals in both coordinates (n − 2) T² / (2 (n − 1)) ~ F(2, n − 2), whose tail probability is
(1 + T²/(n − 1))^(−(n−2)/2). For different numbers n is their harmonic mean; a test at 5 % then calls 4 to
5 % significant by chance. Where only one coordinate has enough residuals, Student's test takes its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats, Ints
from adjust.residual_grid.format_cells import FormatCells

# A mean of fewer residuals says nothing.
LEAST_IN_CELL = 5
# Residuals of less controlled observations hardly show an error.
LEAST_REDUNDANCY = 0.2


@dataclass(frozen=True, eq=False)
class ResidualGrid:
    """Mean residuals in the k cells of a format; NaN where there are fewer than ``LEAST_IN_CELL``.

    Attributes
    ----------
    cells : the sub-areas.
    count : (k, 2) number of residuals in x and in y.
    mean : (k, 2) their means, metres.
    sigma : (k, 2) standard deviations of the means, metres.
    probability : (k,) of a mean vector as long as this where there is no systematic error; NaN where
        neither coordinate has enough residuals.
    """

    cells: FormatCells
    count: Ints
    mean: Floats
    sigma: Floats
    probability: Floats

    @property
    def known(self) -> Bools:
        """(k,) whether a cell has enough residuals in a coordinate at least."""
        return np.asarray(np.isfinite(self.probability))

    def significant(self, confidence: float = 0.95) -> Bools:
        """(k,) whether the mean vector differs from zero, each cell tested by itself."""
        return np.asarray(np.nan_to_num(self.probability, nan=1.0) < 1.0 - confidence)

    def jointly_significant(self, confidence: float = 0.95) -> Bools:
        """(k,) the same with an expected share of false ones of at most 1 − confidence among those found.

        Benjamini and Hochberg (1995): the largest i with p_(i) ≤ i α/k, and all below it.
        """
        found = np.zeros(self.cells.count, dtype=bool)
        tested = np.flatnonzero(self.known)
        order = tested[np.argsort(self.probability[tested], kind="stable")]
        limits = (1.0 - confidence) * np.arange(1, len(order) + 1) / max(len(order), 1)
        passing = np.flatnonzero(self.probability[order] <= limits)
        if len(passing):
            found[order[: passing[-1] + 1]] = True
        return found

    def expected_by_chance(self, confidence: float = 0.95) -> float:
        """Number of cells that would be called significant without any systematic error."""
        return (1.0 - confidence) * float(self.known.sum())

    @property
    def rms(self) -> Floats:
        """(2,) root mean square of the means in x and y, metres; NaN without any."""
        return root_mean_square(self.mean)

    @property
    def noise(self) -> Floats:
        """(2,) root mean square of their standard deviations: the RMS that chance alone would give."""
        return root_mean_square(self.sigma)

    @property
    def signal(self) -> Floats:
        """(2,) RMS of the means freed of their noise, √max(rms² − noise², 0), metres."""
        return np.asarray(np.sqrt(np.maximum(self.rms**2 - self.noise**2, 0.0)))

    @property
    def largest(self) -> float:
        """Length of the longest mean vector, metres; NaN without any."""
        length = np.hypot(*np.nan_to_num(self.mean[self.known]).T)
        return float(length.max()) if len(length) else float("nan")


def residual_grid(
    cells: FormatCells, xy: Floats, residual: Floats, chosen: Bools | None = None
) -> ResidualGrid:
    """The means of residuals (n, 2) at image points (n, 2), all in metres.

    Parameters
    ----------
    chosen : (n, 2) the residuals that count; None for all.
    """
    cell, k = cells.cell_of(xy), cells.count
    weight = np.ones_like(residual) if chosen is None else chosen.astype(np.float64)
    count = np.stack([_sums(cell, weight[:, i], k) for i in (0, 1)], axis=1)
    number = np.where(count >= LEAST_IN_CELL, count, np.nan)
    total = np.stack([_sums(cell, (weight * residual)[:, i], k) for i in (0, 1)], axis=1)
    mean = total / number
    deviation = weight * (residual - np.nan_to_num(mean)[cell])
    square = np.stack([_sums(cell, deviation[:, i] ** 2, k) for i in (0, 1)], axis=1)
    variance = square / (number - 1.0) / number
    both = _sums(cell, weight[:, 0] * weight[:, 1], k)
    product = _sums(cell, deviation[:, 0] * deviation[:, 1], k)
    mixed = product / np.maximum(both - 1.0, 1.0) * both / np.maximum(count[:, 0] * count[:, 1], 1.0)
    return ResidualGrid(
        cells, count.astype(np.int64), mean, np.sqrt(variance), _probability(number, mean, variance, mixed)
    )


def _sums(cell: Ints, values: Floats, cells: int) -> Floats:
    return np.asarray(np.bincount(cell, weights=values, minlength=cells), np.float64)


def _probability(number: Floats, mean: Floats, variance: Floats, mixed: Floats) -> Floats:
    """Tail probability (k,) of Hotelling's T² or Student's t; without any scatter 0 for a mean unlike zero.

    Parameters
    ----------
    number, mean, variance : (k, 2) of the means, NaN where there are too few residuals.
    mixed : (k,) covariances of the means.
    """
    x, y = mean.T
    determinant = variance[:, 0] * variance[:, 1] - mixed**2
    square = variance[:, 1] * x**2 - 2.0 * mixed * x * y + variance[:, 0] * y**2
    n = 2.0 / np.sum(1.0 / number, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        statistic = np.where(
            determinant > 1e-12 * np.max(variance, axis=1) ** 2, square / determinant, np.inf
        )
        statistic = np.where(np.all(mean == 0.0, axis=1), 0.0, statistic)
        joint = (1.0 + statistic / (n - 1.0)) ** (-0.5 * (n - 2.0))
        student = np.where(mean == 0.0, 0.0, np.abs(mean) / np.sqrt(variance))
        single = 2.0 * special.stdtr(number - 1.0, -student)
    of_one = np.where(np.isnan(single[:, 0]), single[:, 1], single[:, 0])
    return np.where(np.isnan(n), of_one, joint)


def residual_grids(
    cells: Sequence[FormatCells | None],
    grid_of_image: Ints,
    image: Ints,
    xy: Floats,
    residual: Floats,
    chosen: Bools,
) -> tuple[ResidualGrid | None, ...]:
    """One grid for each set of images that share one, such as the images of a camera.

    Parameters
    ----------
    cells : the sub-areas of each of the g grids; None for a set without image points.
    grid_of_image : (images,) index into them.
    image : (n,), xy : (n, 2), residual : (n, 2) of the image points, metres.
    chosen : (n, 2) the residuals that count.
    """
    of_ray = grid_of_image[image]
    grids = []
    for number, own in enumerate(cells):
        rows = np.flatnonzero(of_ray == number)
        grids.append(None if own is None else residual_grid(own, xy[rows], residual[rows], chosen[rows]))
    return tuple(grids)


def root_mean_square(values: Floats) -> Floats:
    """Root mean square (2,) of the rows (n, 2) without NaN; NaN without any."""
    present = np.isfinite(values)
    total, number = np.sum(np.where(present, values, 0.0) ** 2, axis=0), present.sum(axis=0)
    return np.asarray(np.sqrt(np.where(number > 0, total / np.maximum(number, 1), np.nan)))
