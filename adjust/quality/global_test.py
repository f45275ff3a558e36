"""The global test of the adjustment: whether vᵀPv agrees with the a-priori weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special


@dataclass(frozen=True)
class GlobalTest:
    """χ² test of σ0² = vᵀPv/r against 1.

    Attributes
    ----------
    sigma0 : a posteriori / a priori.
    redundancy : r = n − u.
    weighted_squares : vᵀPv.
    lower, upper : limits of σ0 that the a-priori weights allow, two-sided at ``confidence``.
    passed : σ0 lies between them.
    """

    sigma0: float
    redundancy: int
    weighted_squares: float
    lower: float
    upper: float
    confidence: float

    @property
    def passed(self) -> bool:
        """Whether σ0 lies within its limits."""
        return self.lower <= self.sigma0 <= self.upper


def global_test(weighted_squares: float, redundancy: int, confidence: float = 0.95) -> GlobalTest:
    """σ0 and its χ² test; σ0 is NaN and the test not passed where the redundancy is zero."""
    if redundancy <= 0:
        return GlobalTest(float("nan"), redundancy, weighted_squares, float("nan"), float("nan"), confidence)
    tail = 0.5 * (1.0 - confidence)
    lower, upper = np.sqrt(
        2.0 * special.gammaincinv(0.5 * redundancy, np.array([tail, 1.0 - tail])) / redundancy
    )
    sigma0 = float(np.sqrt(weighted_squares / redundancy))
    return GlobalTest(sigma0, redundancy, weighted_squares, float(lower), float(upper), confidence)
