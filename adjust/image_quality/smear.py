"""Smear of an image from the blur of its edges in all directions.

A movement during the exposure blurs across edges that it crosses, and not those it goes along. A smear of
length L along the direction φ has the second moment L²/12, of which an edge with the normal θ sees the part
cos²(θ − φ):

    σ²(θ) = s + (L²/12) cos²(θ − φ) = a + b cos 2θ + c sin 2θ,   L² = 24 √(b² + c²),   tan 2φ = c/b

a, b and c are adjusted with equal weights to the σ² of all edges; whether b and c differ from zero is tested
together (F). The edges are adjusted with a Gaussian, which a smear is not: one of three times the blur looks
4 % too long, for which lengths are corrected (`apparent`). What has another blur in one direction than in the
other for another reason (astigmatism, time delay integration) looks the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from adjust.arrays import Floats
from adjust.image_quality.edge_model import density, once_integrated, twice_integrated
from adjust.image_quality.edge_samples import REACH

#: Edges at least, and probability by chance below which a smear is believed.
FEWEST, PROBABILITY = 8, 1e-3


@dataclass(frozen=True)
class Smear:
    """A smear.

    Attributes
    ----------
    length, sigma_length : px.
    direction, sigma_direction : against the columns' direction, towards larger rows, rad, −π/2 to π/2.
    probability : of such a difference between directions by chance.
    edges : number used.
    """

    length: float
    sigma_length: float
    direction: float
    sigma_direction: float
    probability: float
    edges: int

    @property
    def significant(self) -> bool:
        """Whether it is significant."""
        return self.probability < PROBABILITY


#: Distances from an edge at which its adjustment is imitated, px, and steps of that.
_DISTANCE = np.arange(-REACH, REACH + 0.05, 0.1)
_STEPS = 8
_SHARPEST = 0.01


def apparent(length: Floats, base: float) -> Floats:
    """σ² (n,), px², that an edge is adjusted with if a smear of these lengths (n,), px, is added to a blur.

    Parameters
    ----------
    base : σ² of the blur without the smear, px², positive.
    """
    sigma = float(np.sqrt(base))
    width = np.maximum(length, 1e-3)[:, None]
    at = [_DISTANCE + pixel + half * width for pixel in (0.5, -0.5) for half in (0.5, -0.5)]
    upper, middle, low, lowest = (twice_integrated(one / sigma) * base for one in at)
    seen = (upper - middle - low + lowest) / width
    variance = base + length**2 / 12.0
    for _ in range(_STEPS):
        s = np.sqrt(variance)[:, None]
        ends = [(_DISTANCE + pixel) / s for pixel in (0.5, -0.5)]
        value = s * (once_integrated(ends[0]) - once_integrated(ends[1]))
        by_variance = 0.5 / s * (density(ends[0]) - density(ends[1]))
        # The levels beside the edge are unknown, too: an antisymmetric change is one of the contrast.
        contrast = value - 0.5
        part = np.sum(by_variance * contrast, axis=1) / np.sum(contrast**2, axis=1)
        own = by_variance - part[:, None] * contrast
        step = np.sum(own * (seen - value), axis=1) / np.sum(own**2, axis=1)
        variance = np.maximum(variance + step, 0.25 * base)
    return np.asarray(variance)


def _corrected(length: float, base: float) -> float:
    """The length whose apparent σ² a smear of this length would have if it were a Gaussian."""
    true = length
    for _ in range(_STEPS):
        true *= float(np.sqrt(length**2 / 12.0 / (apparent(np.array([true]), base)[0] - base)))
    return true


@dataclass(frozen=True, eq=False)
class SmearFit:
    """The part of second moments that depends on the direction of the edge.

    Attributes
    ----------
    base : σ² of the blur that all directions have, px².
    amplitude : (2,) b and c, px².
    covariance : (2, 2) of them.
    freedom : degrees of freedom of the variance in it.
    solution : (3, n) the least-squares solution by the second moments of the edges.
    """

    base: float
    amplitude: Floats
    covariance: Floats
    freedom: int
    solution: Floats

    @property
    def length(self) -> float:
        """In px."""
        gaussian = float(np.sqrt(24.0 * np.hypot(*self.amplitude)))
        return _corrected(gaussian, self.base) if gaussian > 0.0 else 0.0

    @property
    def sigma_length(self) -> float:
        """px; of a length of 0, that of one whose amplitude is as large as its standard deviation."""
        size = float(np.hypot(*self.amplitude))
        if size == 0.0:
            return float(np.sqrt(24.0 * np.sqrt(np.max(np.diag(self.covariance)))))
        along = self.amplitude / size
        return float(12.0 * np.sqrt(along @ self.covariance @ along) / self.length)

    @property
    def direction(self) -> float:
        """Against the columns' direction, towards larger rows, rad, −π/2 to π/2."""
        return float(0.5 * np.arctan2(self.amplitude[1], self.amplitude[0]))

    @property
    def sigma_direction(self) -> float:
        """rad; infinite for a length of 0."""
        size = float(np.hypot(*self.amplitude))
        if size == 0.0:
            return float("inf")
        across = np.array([-self.amplitude[1], self.amplitude[0]]) / size
        return float(0.5 * np.sqrt(across @ self.covariance @ across) / size)


def fit_smear(angle: Floats, second_moment: Floats) -> SmearFit | None:
    """Adjust second moments (n,), px², of edges with normals at angles (n,), rad.

    None if the edges are too few, or their directions do not determine a smear.
    """
    if len(angle) < FEWEST:
        return None
    design = np.column_stack([np.ones_like(angle), np.cos(2.0 * angle), np.sin(2.0 * angle)])
    # Edges of two directions at right angles leave one of b and c open.
    if np.linalg.cond(design) > 1e3:
        return None
    normal = np.linalg.inv(design.T @ design)
    solution = normal @ design.T
    values = solution @ second_moment
    residual = second_moment - design @ values
    freedom = len(angle) - 3
    covariance = normal[1:, 1:] * float(residual @ residual) / freedom
    base = max(float(values[0] - np.hypot(*values[1:])), _SHARPEST)
    return SmearFit(base, values[1:], np.asarray(covariance), freedom, np.asarray(solution))


def smear(angle: Floats, blur: Floats) -> Smear | None:
    """The smear that edges show; None if they are too few, or their directions do not determine one.

    Parameters
    ----------
    angle : (n,) of their normals, rad.
    blur : (n,) their σ, px.
    """
    found = fit_smear(angle, blur**2)
    if found is None:
        return None
    statistic = float(found.amplitude @ np.linalg.solve(found.covariance, found.amplitude)) / 2.0
    return Smear(
        length=found.length,
        sigma_length=found.sigma_length,
        direction=found.direction,
        sigma_direction=found.sigma_direction,
        probability=float(special.fdtrc(2, found.freedom, statistic)),
        edges=len(angle),
    )
