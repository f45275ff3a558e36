"""Options of an adjustment."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Literal

from adjust.parameters import InnerConstraints
from adjust.quality.observation_parts import Division

#: The variable that says how many threads an adjustment may use at once; not set: one for each processor.
THREADS_VARIABLE = "AEROCAL_THREADS"


def available_threads() -> int:
    """How many threads this process may use at once."""
    named = os.environ.get(THREADS_VARIABLE, "")
    if named.isdecimal() and int(named) > 0:
        return int(named)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class AdjustmentOptions:
    """Options of the adjustment.

    Attributes
    ----------
    critical_value : |w|, of a standard normal variable, above which an observation is rejected; None for
        no rejection.
    test : what is compared with it: the largest |w| of the components of an observation, or all of
        them together, by a statistic with as many degrees of freedom.
    reference_variance : whether σ0 is 1 in these tests or comes from the residuals (τ-test).
    robust : weight function of a robust estimation that looks for gross errors first; None for none.
    most_iterations : steps of one pass after which it is given up.
    most_passes : passes of rejection after which it is given up.
    confidence : of the global test.
    variance_components : whether the weights of the groups are estimated from the residuals.
    divisions : groups whose observations have weights by where they come from, one division a group.
    control_folds : into how many folds the control points are dealt to be predicted without their own one;
        None for no such check.
    joint_points : indices of object points, ascending, whose joint cofactors are wanted; those that take no
        part are left out. Some hundred at most.
    correlation_times : whether the correlation times of groups with errors correlated over time are.
    free_network : unknowns whose approximate values carry what the observations leave open of the datum
        (inner constraints); None: an open datum is an error.
    threads : how many may work at once; never changes a result.
    """

    critical_value: float | None = None
    test: Literal["components", "observations"] = "components"
    reference_variance: Literal["a_priori", "a_posteriori"] = "a_priori"
    robust: Literal["huber", "cauchy", "tukey", "biber", "danish"] | None = None
    most_iterations: int = 20
    most_passes: int = 50
    confidence: float = 0.95
    variance_components: bool = False
    divisions: tuple[Division, ...] = ()
    control_folds: int | None = None
    joint_points: tuple[int, ...] = ()
    correlation_times: bool = False
    free_network: InnerConstraints | None = None
    threads: int = field(default_factory=available_threads)
