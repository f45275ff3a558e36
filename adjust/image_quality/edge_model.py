"""The edge seen by square pixels: a straight step, blurred by a Gaussian, integrated over every pixel.

For a unit step with normal n = (cos θ, sin θ) the pixel is a box of width p = |cos θ| and one of width
q = |sin θ| along n, one after the other. With the double integral of the normal distribution

    H(d) = ½ [(d² + σ²) Φ(d/σ) + d σ φ(d/σ)],   H' = d Φ + σ φ,   H'' = Φ

the grey value at the distance d of a pixel's centre from the edge is a second difference of H:

    E(d) = [H(d + (p+q)/2) − H(d + (p−q)/2) − H(d − (p−q)/2) + H(d − (p+q)/2)] / (p q)

Blurring is diffusion, so ∂E/∂σ² = ½ E'' without further formulas. For an edge along the pixels (q = 0) the
difference in q is a derivative.

The factor of effective resolution is the full width at half maximum of the line spread function of a pixel of
side 1 (box ∗ Gaussian), in pixels: 1 for a sharp image, 1.208 for σ = 0.4 px. It is taken from the blur σ
alone, without the longer diagonal of the pixel, so that edges of all directions can be compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from adjust.arrays import Floats

# Below this width the second box is a derivative: the difference is some 1e-8 of the step.
_THIN = 1e-3
_FULL_WIDTH = 2.0 * np.sqrt(2.0 * np.log(2.0))
_NEWTON_STEPS = 60


@dataclass(frozen=True, eq=False)
class EdgeValues:
    """A unit edge at distances (n,).

    Attributes
    ----------
    value : E, from 0 to 1.
    slope : ∂E/∂d, the line spread function, 1/px.
    by_variance : ∂E/∂σ², 1/px².
    """

    value: Floats
    slope: Floats
    by_variance: Floats


def edge_values(distance: Floats, variance: float, angle: float) -> EdgeValues:
    """A unit edge as square pixels see it.

    Parameters
    ----------
    distance : (n,) of pixel centres from the edge, px, positive on its bright side.
    variance : σ² of the blur, px², positive.
    angle : θ of the normal against the rows or columns, rad.
    """
    sigma = float(np.sqrt(variance))
    p, q = sorted((abs(float(np.cos(angle))), abs(float(np.sin(angle)))), reverse=True)
    thin = q < _THIN
    if thin:
        places, weights = np.array([0.5 * p, -0.5 * p]), np.array([1.0, -1.0]) / p
    else:
        places = 0.5 * np.array([p + q, p - q, q - p, -p - q])
        weights = np.array([1.0, -1.0, -1.0, 1.0]) / (p * q)
    u = (distance[:, None] + places) / sigma
    # Φ and φ once for all derivatives of H.
    below, bell = ndtr(u), density(u)
    if thin:
        parts = (sigma * (u * below + bell), below, bell / sigma)
    else:
        twice = 0.5 * ((u * u + 1.0) * below + u * bell)
        parts = (sigma * sigma * twice, sigma * (u * below + bell), below)
    value, slope, curvature = (part @ weights for part in parts)
    return EdgeValues(value, slope, 0.5 * curvature)


def density(u: Floats) -> Floats:
    """φ of the standard normal distribution."""
    return np.asarray(np.exp(-0.5 * u * u) / np.sqrt(2.0 * np.pi))


def once_integrated(u: Floats) -> Floats:
    """∫ Φ = u Φ + φ."""
    return np.asarray(u * ndtr(u) + density(u))


def twice_integrated(u: Floats) -> Floats:
    """H for σ = 1."""
    return np.asarray(0.5 * ((u * u + 1.0) * ndtr(u) + u * density(u)))


def line_spread(distance: Floats, sigma: Floats) -> Floats:
    """Line spread function of a pixel of side 1 and a Gaussian of σ > 0, px, at distances, 1/px."""
    return np.asarray(ndtr((distance + 0.5) / sigma) - ndtr((distance - 0.5) / sigma))


def resolution_factor(sigma: Floats) -> Floats:
    """Factor of effective resolution of blurs σ (n,), px: full width at half maximum, px; 1 for σ = 0."""
    sigma = np.maximum(np.atleast_1d(np.asarray(sigma, dtype=np.float64)), 1e-3)
    top = line_spread(np.zeros(sigma.shape), sigma)
    lower, upper = np.zeros(sigma.shape), 0.5 + _FULL_WIDTH * sigma
    # Halving: the function falls monotonously, and 60 halvings leave nothing.
    for _ in range(_NEWTON_STEPS):
        middle = 0.5 * (lower + upper)
        above = line_spread(middle, sigma) > 0.5 * top
        lower, upper = np.where(above, middle, lower), np.where(above, upper, middle)
    return np.asarray(lower + upper)


def factor_by_variance(variance: Floats) -> Floats:
    """Derivative of the factor of effective resolution by σ² (n,), 1/px, from its definition."""
    sigma = np.sqrt(np.maximum(variance, 1e-6))
    half = 0.5 * resolution_factor(sigma)

    def by_variance(x: Floats) -> Floats:
        # ∂f/∂σ² = ½ f'' of the box, a difference of the derivatives of the Gaussian at its ends.
        ends = [(x + side * 0.5) / sigma for side in (1.0, -1.0)]
        first, second = (-u * np.exp(-0.5 * u * u) / (np.sqrt(2.0 * np.pi) * sigma**2) for u in ends)
        return np.asarray(0.5 * (first - second))

    ends = [(half + side * 0.5) / sigma for side in (1.0, -1.0)]
    first, second = (np.exp(-0.5 * u * u) / (np.sqrt(2.0 * np.pi) * sigma) for u in ends)
    slope = first - second
    return np.asarray(2.0 * (0.5 * by_variance(np.zeros(half.shape)) - by_variance(half)) / slope)


def transfer(frequency: Floats, variance: float, angle: float) -> Floats:
    """Modulation transfer of blur and pixel along the normal, at frequencies (n,), cycles/px."""
    blur = np.exp(-2.0 * np.pi**2 * variance * frequency**2)
    return np.asarray(blur * np.sinc(frequency * np.cos(angle)) * np.sinc(frequency * np.sin(angle)))
