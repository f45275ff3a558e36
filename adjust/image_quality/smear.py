"""Smear of an image from the blur of its edges in all directions.

A movement during the exposure blurs across edges that it crosses, and not those it goes along. A smear of
length L along the direction φ has the second moment L²/12, of which an edge with the normal θ sees the part
cos²(θ − φ):

    σ²(θ) = s + (L²/12) cos²(θ − φ) = a + b cos 2θ + c sin 2θ,   L² = 24 √(b² + c²),   tan 2φ = c/b

a, b and c are adjusted with equal weights to the σ² of all edges; whether b and c differ from zero is tested
together (F). The edges are adjusted with a Gaussian, which a smear is not: one of three times the blur comes
out 4 % too long. What has another blur in one direction than in the other for another reason (astigmatism,
time delay integration) looks the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from adjust.arrays import Floats

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
        """Whether chance does not explain it."""
        return self.probability < PROBABILITY


def smear(angle: Floats, blur: Floats) -> Smear | None:
    """The smear that edges show; None if they are too few, or their directions do not determine one.

    Parameters
    ----------
    angle : (n,) of their normals, rad.
    blur : (n,) their σ, px.
    """
    if len(angle) < FEWEST:
        return None
    design = np.column_stack([np.ones_like(angle), np.cos(2.0 * angle), np.sin(2.0 * angle)])
    # Edges of two directions at right angles leave one of b and c open.
    if np.linalg.cond(design) > 1e3:
        return None
    normal = np.linalg.inv(design.T @ design)
    a, b, c = normal @ (design.T @ blur**2)
    residual = blur**2 - design @ np.array([a, b, c])
    freedom = len(angle) - 3
    variance = float(residual @ residual) / freedom
    cofactor = normal[1:, 1:]
    statistic = float(np.array([b, c]) @ np.linalg.inv(cofactor) @ np.array([b, c])) / (2.0 * variance)
    amplitude = float(np.hypot(b, c))
    along = np.array([b, c]) / amplitude
    across = np.array([-c, b]) / amplitude
    length = float(np.sqrt(24.0 * amplitude))
    of_amplitude = np.sqrt(along @ cofactor @ along * variance)
    of_angle = np.sqrt(across @ cofactor @ across * variance) / amplitude
    return Smear(
        length=length,
        sigma_length=float(12.0 * of_amplitude / length),
        direction=float(0.5 * np.arctan2(c, b)),
        sigma_direction=float(0.5 * of_angle),
        probability=float(stats.f.sf(statistic, 2, freedom)),
        edges=len(angle),
    )
