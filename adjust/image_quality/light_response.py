"""Response of a sensor to light: linearity and sensitivity from exposure times, fall-off from flat images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Linearity:
    """Grey values against exposure.

    Attributes
    ----------
    exposure : (m,) in any unit.
    mean : (m,) grey values.
    sensitivity, sigma_sensitivity : grey values for one unit of exposure.
    dark : adjusted grey value without light.
    residual : (m,) mean − line, in parts of the largest signal.
    """

    exposure: Floats
    mean: Floats
    sensitivity: float
    sigma_sensitivity: float
    dark: float
    residual: Floats

    @property
    def largest(self) -> float:
        """Largest residual, in parts of the largest signal."""
        return float(np.max(np.abs(self.residual)))


def linearity(exposure: Floats, mean: Floats) -> Linearity:
    """The straight line through grey values (m,) at exposures (m,), with equal weights; at least three.

    Raises
    ------
    ValueError
        If the exposures do not determine a line.
    """
    if len(exposure) < 3 or np.ptp(exposure) <= 0.0:
        raise ValueError("fewer than three different exposures")
    design = np.column_stack([np.ones_like(exposure), exposure])
    normal = np.linalg.inv(design.T @ design)
    dark, slope = normal @ (design.T @ mean)
    residual = mean - (dark + slope * exposure)
    variance = float(residual @ residual) / (len(exposure) - 2)
    signal = float(slope * np.max(np.abs(exposure)))
    sigma = float(np.sqrt(variance * normal[1, 1]))
    return Linearity(exposure, mean, float(slope), sigma, float(dark), np.asarray(residual / signal))


@dataclass(frozen=True, eq=False)
class LightFallOff:
    """Fall-off of light towards the corners, from a flat image.

    Attributes
    ----------
    radius : (m,) limits of rings in parts of half the diagonal.
    light : (m,) mean signal in the ring in parts of the middle.
    coefficients : of r², r⁴, r⁶ of light = 1 + a r² + b r⁴ + c r⁶; the correction divides by it.
    largest : largest deviation of a cell of the format from that, in parts: what a table must correct.
    cells : (rows, columns) signal of cells in parts of the middle, the table of correction.
    """

    radius: Floats
    light: Floats
    coefficients: Floats
    largest: float
    cells: Floats


_RINGS = 20


def light_fall_off(cells: Floats, counts: Ints, width: float, height: float) -> LightFallOff:
    """Fall-off from the mean signals (rows, columns) of cells of the format.

    Parameters
    ----------
    cells : mean grey value above the dark level.
    counts : pixels of each cell.
    width, height : of the format, px.
    """
    rows, columns = cells.shape
    x = ((np.arange(columns) + 0.5) / columns - 0.5) * width
    y = ((np.arange(rows) + 0.5) / rows - 0.5) * height
    radius = np.hypot(*np.meshgrid(x, y)) / (0.5 * np.hypot(width, height))
    design = np.stack([np.ones_like(radius), radius**2, radius**4, radius**6], axis=-1).reshape(-1, 4)
    root = np.sqrt(counts.ravel())
    solved = np.linalg.lstsq(design * root[:, None], cells.ravel() * root, rcond=None)[0]
    part = cells / solved[0]
    deviation = part.ravel() - design @ (solved / solved[0])
    ring = np.minimum((radius * _RINGS).astype(np.int64), _RINGS - 1).ravel()
    total = np.bincount(ring, part.ravel() * counts.ravel(), minlength=_RINGS)
    number = np.bincount(ring, counts.ravel(), minlength=_RINGS)
    known = number > 0
    return LightFallOff(
        ((np.arange(_RINGS) + 1.0) / _RINGS)[known],
        total[known] / number[known],
        np.asarray(solved[1:] / solved[0], dtype=np.float64),
        float(np.max(np.abs(deviation))),
        part,
    )
