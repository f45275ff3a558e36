"""Mean residuals of two flights: whether they show the same errors, and their combination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.residual_grid.residual_grid import ResidualGrid


@dataclass(frozen=True)
class GridComparison:
    """Two grids of the same cells side by side.

    Attributes
    ----------
    cells : number of cells that both know.
    correlation : of the means in x and in y.
    correlation_of_signals : the same freed of the noise of both grids; NaN where one has no signal.
    statistic : Σ (a − b)² / (σ_a² + σ_b²) over cells and coordinates, χ² with ``freedom`` degrees of freedom
        if both show the same.
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
    noise_a, noise_b = one.sigma[both] ** 2, other.sigma[both] ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        square = np.sum((a - b) ** 2 / (noise_a + noise_b), axis=1)
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
    """The mean of several grids of the same cells, each mean weighted with 1/σ².

    Raises
    ------
    InconsistentBlockError : if their cells differ.
    """
    _require_same_cells(grids)
    means = np.array([grid.mean for grid in grids])
    known = np.isfinite(means)
    weight = np.array([np.where(k, 1.0 / grid.sigma**2, 0.0) for k, grid in zip(known, grids, strict=True)])
    total = weight.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(total > 0.0, np.sum(weight * np.nan_to_num(means), axis=0) / total, np.nan)
        sigma = np.where(total > 0.0, 1.0 / np.sqrt(total), np.nan)
    # χ² of one or two degrees of freedom.
    present = np.isfinite(mean)
    square = np.sum(np.where(present, mean / sigma, 0.0) ** 2, axis=1)
    number = present.sum(axis=1)
    probability = special.gammaincc(0.5 * np.maximum(number, 1), 0.5 * square)
    count = np.sum([np.where(k, grid.count, 0) for k, grid in zip(known, grids, strict=True)], axis=0)
    return ResidualGrid(
        grids[0].cells, count.astype(np.int64), mean, sigma, np.where(number > 0, probability, np.nan)
    )


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
