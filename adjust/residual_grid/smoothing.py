"""Smoothing of the mean residuals of neighbouring cells, never across a seam between CCD images.

* ``gaussian``: Σ w m / Σ w with w = exp(−d²/2L²), d the distance of the cells: every mean alike;
* ``counts``: the same with w n: a mean of many residuals counts more;
* ``collocation``: least-squares collocation: ŝ = C (C + D)⁻¹ m, C_ij = C0 exp(−(d_ij/L)²), D = diag(σ²), C0
  the variance of the means less their noise, and L the length that makes the means most probable given each
  other.

Collocation finds its own width; the two others are told it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import linalg

from adjust.arrays import Floats, Ints
from adjust.residual_grid.residual_grid import ResidualGrid

SmoothingMethod = Literal["none", "gaussian", "counts", "collocation"]

# Correlation lengths that are tried, in parts of the longer side of the format.
_LENGTHS = np.geomspace(0.03, 1.0, 12)
# Part of the signal's variance that is noise at least: without noise the matrix would be singular.
_FLOOR = 1e-6


@dataclass(frozen=True)
class Smoothing:
    """How means of neighbouring cells are smoothed.

    Attributes
    ----------
    method : see the module.
    width : L of ``gaussian`` and ``counts``, in parts of the sides of the format.
    """

    method: SmoothingMethod = "none"
    width: float = 0.04


def smoothed(grid: ResidualGrid, smoothing: Smoothing) -> Floats:
    """Smoothed means (k, 2) of the cells, metres; NaN where the grid has none."""
    result = grid.mean.copy()
    if smoothing.method == "none":
        return result
    for tile in np.unique(grid.cells.tile):
        for k in (0, 1):
            chosen = np.flatnonzero((grid.cells.tile == tile) & np.isfinite(grid.mean[:, k]))
            if len(chosen) and smoothing.method == "collocation":
                result[chosen, k] = _collocated(grid, chosen, k)
            elif len(chosen):
                result[chosen, k] = _weighted(grid, chosen, k, smoothing)
    return result


def _weighted(grid: ResidualGrid, chosen: Ints, k: int, smoothing: Smoothing) -> Floats:
    """Weighted means (c,) of coordinate k over the chosen cells."""
    sides = [np.ptp(side.edges) for side in (grid.cells.along_x, grid.cells.along_y)]
    place = grid.cells.middles[chosen] / sides
    square = np.sum((place[:, None] - place[None]) ** 2, axis=2)
    weight = np.exp(-0.5 * square / smoothing.width**2)
    if smoothing.method == "counts":
        weight = weight * grid.count[chosen, k]
    return np.asarray((weight @ grid.mean[chosen, k]) / weight.sum(axis=1))


def _collocated(grid: ResidualGrid, chosen: Ints, k: int) -> Floats:
    """Filtered signal (c,) of coordinate k in the chosen cells."""
    middles = grid.cells.middles[chosen]
    longer = max(float(np.ptp(side.edges)) for side in (grid.cells.along_x, grid.cells.along_y))
    distance = np.linalg.norm(middles[:, None] - middles[None], axis=2) / longer
    return _filtered(distance, grid.mean[chosen, k], grid.sigma[chosen, k] ** 2)


def _filtered(distance: Floats, mean: Floats, noise: Floats) -> Floats:
    """ŝ = C (C + D)⁻¹ m (c,) with the length of the greatest leave-one-out likelihood.

    Left out, a mean has the residual d_i = (K⁻¹ m)_i / (K⁻¹)_ii and the variance 1/(K⁻¹)_ii, K = C + D.
    """
    variance = float(np.mean(mean**2) - np.mean(noise))
    if variance <= 0.0:
        return np.zeros_like(mean)
    best, answer = -np.inf, np.zeros_like(mean)
    for length in _LENGTHS:
        signal = variance * np.exp(-((distance / length) ** 2))
        inverse = linalg.inv(signal + np.diag(noise + _FLOOR * variance), check_finite=False)
        pulled, precision = inverse @ mean, np.diagonal(inverse)
        likelihood = float(np.sum(np.log(precision) - pulled**2 / precision))
        if likelihood > best:
            best, answer = likelihood, signal @ pulled
    return answer
