"""Mean residuals of two flights: whether they show the same errors, and their combination.

The standard deviation of a mean comes from the scatter of the few residuals of its sub-area. So a difference
over its σ has Student's distribution, with the degrees of freedom of Welch (1947), and is expressed as the
normal variable that is exceeded with the same probability. For the same reason the weights of a mean of
several grids do not come from single sub-areas: weights 1/s² of so few residuals are worse than equal ones,
and promise a σ that is too small (Meier 1953).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.residual_grid.residual_grid import ResidualGrid

# Metres; where residuals have no scatter at all, nothing is divided by zero. Its square is not zero either.
_NO_SCATTER = 1e-20


@dataclass(frozen=True)
class GridComparison:
    """Two grids of the same cells side by side.

    Attributes
    ----------
    cells : number of cells that both know.
    correlation : of the means in x and in y.
    correlation_of_signals : the same freed of the noise of both grids; NaN where one has no signal.
    statistic : Σ z² over cells and coordinates, z the normal equivalent of (a − b) / √(σ_a² + σ_b²); χ² with
        ``freedom`` degrees of freedom if both show the same.
    freedom : 2 · cells.
    probability : of a larger statistic by chance.
    differing : share of the cells whose vectors differ, each tested by itself (5 % by chance at 95 %).
    """

    cells: int
    correlation: tuple[float, float]
    correlation_of_signals: tuple[float, float]
    statistic: float
    freedom: int
    probability: float
    differing: float


def compare_grids(one: ResidualGrid, other: ResidualGrid, confidence: float = 0.95) -> GridComparison:
    """Correlation and difference of two grids.

    Raises
    ------
    InconsistentBlockError : if their cells differ, or they have no cell in common.
    """
    _require_same_cells((one, other))
    both = np.all(np.isfinite(one.mean) & np.isfinite(other.mean), axis=1)
    if both.sum() < 2:
        raise InconsistentBlockError(
            "The two residual grids have fewer than two sub-areas with image points of both."
        )
    a, b = one.mean[both], other.mean[both]
    noise_a, noise_b = _variance(one)[both], _variance(other)[both]
    noise = noise_a + noise_b
    freedom_of = noise**2 / (noise_a**2 / (one.count[both] - 1) + noise_b**2 / (other.count[both] - 1))
    square = np.sum(_normal_squares((a - b) / np.sqrt(noise), freedom_of), axis=1)
    raw, free = _correlations(a, b), _correlations(a, b, noise_a.mean(axis=0), noise_b.mean(axis=0))
    total, freedom = float(square.sum()), 2 * int(both.sum())
    return GridComparison(
        int(both.sum()),
        (float(raw[0]), float(raw[1])),
        (float(free[0]), float(free[1])),
        total,
        freedom,
        float(special.gammaincc(0.5 * freedom, 0.5 * total)),
        float(np.mean(np.exp(-0.5 * square) < 1.0 - confidence)),
    )


def combined_grid(grids: Sequence[ResidualGrid]) -> ResidualGrid:
    """The mean of several grids of the same cells.

    Each mean is weighted with the number of its residuals over their variance in all sub-areas of its grid.

    Raises
    ------
    InconsistentBlockError : if their cells differ.
    """
    _require_same_cells(grids)
    means = np.array([grid.mean for grid in grids])
    known = np.isfinite(means)
    weight = np.where(known, [grid.count / _scatter(grid) for grid in grids], 0.0)
    total = weight.sum(axis=0)
    present = total > 0.0
    part = weight / np.where(present, total, 1.0)
    # Of the variance, what each grid contributes.
    of_grids = np.where(known, part**2 * [_variance(grid) for grid in grids], 0.0)
    variance = np.where(present, of_grids.sum(axis=0), np.nan)
    mean = np.where(present, np.sum(part * np.nan_to_num(means), axis=0), np.nan)
    freedom = variance**2 / np.sum(of_grids**2 / np.maximum([grid.count - 1 for grid in grids], 1), axis=0)
    # χ² of one or two degrees of freedom.
    square = np.sum(np.where(present, _normal_squares(mean / np.sqrt(variance), freedom), 0.0), axis=1)
    number = present.sum(axis=1)
    probability = special.gammaincc(0.5 * np.maximum(number, 1), 0.5 * square)
    count = np.sum([np.where(k, grid.count, 0) for k, grid in zip(known, grids, strict=True)], axis=0)
    return ResidualGrid(
        grids[0].cells,
        count.astype(np.int64),
        mean,
        np.sqrt(variance),
        np.where(number > 0, probability, np.nan),
    )


def _scatter(grid: ResidualGrid) -> Floats:
    """Mean variance (2,) of one residual in x and in y within the sub-areas of a grid."""
    known = np.isfinite(grid.mean)
    total = np.sum(np.where(known, grid.count * _variance(grid), 0.0), axis=0)
    return np.asarray(total / np.maximum(known.sum(axis=0), 1) + _NO_SCATTER**2)


def _variance(grid: ResidualGrid) -> Floats:
    """Variances (k, 2) of the means; NaN where there is none."""
    return np.asarray(np.maximum(grid.sigma, _NO_SCATTER) ** 2)


def _normal_squares(student: Floats, freedom: Floats) -> Floats:
    """Squares of normal variables that are exceeded as often as these of Student's distribution."""
    tail = special.stdtr(freedom, -np.abs(student))
    return np.asarray(special.ndtri(np.maximum(tail, np.finfo(float).tiny)) ** 2)


def _require_same_cells(grids: Sequence[ResidualGrid]) -> None:
    if not all(grid.cells.same_as(grids[0].cells) for grid in grids):
        raise InconsistentBlockError(
            "The residual grids have different sub-areas; compute them with the same number of cells."
        )


def _correlations(
    a: Floats, b: Floats, noise_a: Floats | float = 0.0, noise_b: Floats | float = 0.0
) -> Floats:
    """Correlations (2,) about zero of means (c, 2), their mean squares lessened by those of their noise."""
    power_a, power_b = np.mean(a**2, axis=0) - noise_a, np.mean(b**2, axis=0) - noise_b
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.mean(a * b, axis=0) / np.sqrt(power_a * power_b)
    return np.where((power_a > 0.0) & (power_b > 0.0), found, np.nan)
