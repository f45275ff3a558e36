"""How an adjustment is to be carried out."""

from __future__ import annotations

import os
from dataclasses import dataclass, field


def available_threads() -> int:
    """How many threads this process may use at once."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class AdjustmentOptions:
    """Options of the adjustment.

    Attributes
    ----------
    critical_value : |w| above which an observation is rejected; None for no rejection.
    most_iterations : steps of one pass after which it is given up.
    most_passes : passes of rejection after which it is given up.
    confidence : of the global test.
    variance_components : whether the weights of the groups are estimated from the residuals.
    threads : how many may work at once; never changes a result.
    """

    critical_value: float | None = None
    most_iterations: int = 20
    most_passes: int = 50
    confidence: float = 0.95
    variance_components: bool = False
    threads: int = field(default_factory=available_threads)
