"""Blur, place and direction of an edge by least squares from all its pixels, without binning.

    grey = a + b E(d; σ², θ) + g t,    d across, t along the edge

with the step E of `edge_model`; the unknowns are the place and direction of the edge, σ², a, b and g.
The standard deviations come from the residuals, as those of white noise. In an image that was resampled or
sharpened neighbouring pixels are correlated, and they are too small.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.image_quality.edge_model import edge_values, factor_by_variance, resolution_factor
from adjust.image_quality.edge_samples import EdgeSamples

_START = 0.25
_SMALLEST, _LARGEST = 1e-3, 9.0
_STEPS = 40
_CONVERGED = 1e-6
#: Places of the unknowns.
OFFSET, ANGLE, VARIANCE, DARK, STEP, TREND = range(6)


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """An adjusted edge.

    Attributes
    ----------
    samples : its pixels.
    values : (6,) offset (px), angle (rad), σ² (px²), a, b (grey values), g (grey values/px).
    covariance : (6, 6).
    noise : standard deviation of the residuals, grey values.
    residual : (n,) grey value − model.
    converged : whether the iteration did.
    """

    samples: EdgeSamples
    values: Floats
    covariance: Floats
    noise: float
    residual: Floats
    converged: bool

    @property
    def angle(self) -> float:
        """Of the normal, rad."""
        return float(self.values[ANGLE])

    @property
    def blur(self) -> float:
        """σ of the blur, px."""
        return float(np.sqrt(self.values[VARIANCE]))

    @property
    def sigma_blur(self) -> float:
        """Standard deviation of the blur, px."""
        return float(np.sqrt(self.covariance[VARIANCE, VARIANCE]) / (2.0 * self.blur))

    # A fit is in the statistics of several zones and directions.
    @cached_property
    def factor(self) -> float:
        """Factor of effective resolution."""
        return float(resolution_factor(np.array([self.blur]))[0])

    @cached_property
    def sigma_factor(self) -> float:
        """Standard deviation of the factor."""
        slope = factor_by_variance(self.values[VARIANCE : VARIANCE + 1])[0]
        return float(slope * np.sqrt(self.covariance[VARIANCE, VARIANCE]))

    @property
    def contrast(self) -> float:
        """Grey values from the dark to the bright side."""
        return float(self.values[STEP])

    @property
    def distance(self) -> Floats:
        """Distances (n,) of the pixels from the adjusted edge, px."""
        return self.samples.across(self.angle, float(self.values[OFFSET]))


def fit_edge(samples: EdgeSamples) -> EdgeFit:
    """Adjust an edge to its pixels: Gauss and Newton, damped where a step makes it worse."""
    state = _State.at(samples, _started(samples))
    damping, converged = 0.0, False
    for _ in range(_STEPS):
        tried = _State.at(samples, state.stepped(damping))
        if tried.squares > state.squares * (1.0 + 1e-12):
            damping = max(4.0 * damping, 1e-3)
            continue
        converged = state.squares - tried.squares <= _CONVERGED * tried.squares
        state, damping = tried, 0.1 * damping if damping > 1e-6 else 0.0
        if converged:
            break
    redundancy = max(len(state.residual) - len(state.values), 1)
    noise = float(np.sqrt(state.squares / redundancy))
    cofactor = np.linalg.pinv(state.design.T @ state.design, hermitian=True)
    covariance = np.asarray(cofactor * noise**2, dtype=np.float64)
    return EdgeFit(samples, state.values, covariance, noise, state.residual, converged)


@dataclass(frozen=True, eq=False)
class _State:
    """Unknowns of an edge with misclosures (n,) and derivatives (n, 6)."""

    values: Floats
    residual: Floats
    design: Floats

    @classmethod
    def at(cls, samples: EdgeSamples, values: Floats) -> _State:
        offset, angle, variance, dark, step, trend = values
        across, along = samples.across(angle, offset), samples.along(angle)
        edge = edge_values(across, variance, angle)
        design = np.empty((len(across), 6))
        design[:, OFFSET] = -step * edge.slope
        # The pixel's own width changes with the angle, too: hardly, and not the solution.
        design[:, ANGLE] = step * edge.slope * along - trend * (across + offset)
        design[:, VARIANCE] = step * edge.by_variance
        design[:, DARK] = 1.0
        design[:, STEP] = edge.value
        design[:, TREND] = along
        return cls(values, samples.grey - (dark + step * edge.value + trend * along), design)

    @property
    def squares(self) -> float:
        return float(self.residual @ self.residual)

    def stepped(self, damping: float) -> Floats:
        """The unknowns after a step, damped following Levenberg and Marquardt."""
        normal = self.design.T @ self.design
        normal[np.diag_indices(len(normal))] *= 1.0 + damping
        values = self.values + np.linalg.lstsq(normal, self.design.T @ self.residual, rcond=None)[0]
        values[VARIANCE] = np.clip(values[VARIANCE], _SMALLEST, _LARGEST)
        return np.asarray(values)


def _started(samples: EdgeSamples) -> Floats:
    """Approximate values: plateaus from the outer pixels, everything else from the line as it was found."""
    across = samples.across(samples.line.angle)
    reach = np.max(np.abs(across))
    dark = float(np.median(samples.grey[across < -0.5 * reach]))
    bright = float(np.median(samples.grey[across > 0.5 * reach]))
    return np.array([0.0, samples.line.angle, _START, dark, bright - dark, 0.0])


@dataclass(frozen=True, eq=False)
class Straightness:
    """Whether an edge is straight: places of slices of one pixel along it, against the adjusted line.

    Attributes
    ----------
    along : (m,) of the slices, px.
    shift : (m,) how far the slice lies on the bright side of the line, px.
    sigma : (m,) standard deviations of the shifts, px.
    """

    along: Floats
    shift: Floats
    sigma: Floats

    @property
    def rms(self) -> float:
        """Root mean square of the shifts, px."""
        return float(np.sqrt(np.mean(self.shift**2)))

    @property
    def statistic(self) -> float:
        """Mean square of shift/σ: 1 for a straight edge."""
        return float(np.mean((self.shift / self.sigma) ** 2))

    @property
    def bend(self) -> float:
        """How far the middle lies from the line through the ends, px, of a parabola through the slices."""
        half = 0.5 * float(np.ptp(self.along)) or 1.0
        coefficients = np.polynomial.polynomial.polyfit(self.along / half, self.shift, 2, w=1.0 / self.sigma)
        return float(abs(coefficients[2]))


def straightness(fit: EdgeFit) -> Straightness:
    """Places of the slices of an edge by least squares, each from its own pixels."""
    slope = fit.contrast * edge_values(fit.distance, float(fit.values[VARIANCE]), fit.angle).slope
    along = fit.samples.along(fit.angle)
    slices: Ints = np.floor(along - along.min()).astype(np.int64)
    weight = np.bincount(slices, slope**2)
    known = weight > 0.25 * np.median(weight)
    middle = np.bincount(slices, along) / np.maximum(np.bincount(slices), 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = -np.bincount(slices, slope * fit.residual) / weight
        sigma = fit.noise / np.sqrt(weight)
    return Straightness(middle[known], shift[known], sigma[known])
