"""How an adjustment is to be carried out."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AdjustmentOptions:
    """Options of the adjustment.

    Attributes
    ----------
    critical_value : |w| above which an observation is rejected; None for no rejection.
    most_iterations : steps of one pass after which it is given up.
    most_passes : passes of rejection after which it is given up.
    confidence : of the global test.
    """

    critical_value: float | None = None
    most_iterations: int = 20
    most_passes: int = 50
    confidence: float = 0.95
