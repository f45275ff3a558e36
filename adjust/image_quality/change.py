"""Whether a quantity has changed between two dates, where its standard deviations come from few residuals.

The change over its σ has Student's distribution, with the degrees of freedom of Welch (1947), Biometrika 34,
28–35: f = (σ₁² + σ₂²)² / (σ₁⁴/f₁ + σ₂⁴/f₂).
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

from adjust.arrays import Floats

#: Probability that a quantity without a change is said to have changed.
PROBABILITY = 0.001


def critical_change(sigma: Floats, degrees: Floats) -> Floats:
    """Limits (n,) of |change/σ|; infinite where a σ has no degree of freedom.

    Parameters
    ----------
    sigma, degrees : (n, 2) standard deviations at both dates and their degrees of freedom, infinite of a σ
        that is known.
    """
    variance = sigma**2
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = (variance**2 / degrees).sum(axis=1)
        freedom = np.where(spread > 0.0, variance.sum(axis=1) ** 2 / spread, np.inf)
    found = stdtrit(np.clip(freedom, 1e-9, 1e9), 1.0 - 0.5 * PROBABILITY)
    return np.asarray(np.where((degrees > 0.0).all(axis=1), found, np.inf))
