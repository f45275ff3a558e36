"""Options of an adjustment."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

from adjust.errors import InconsistentBlockError
from adjust.parameters import InnerConstraints
from adjust.quality.observation_parts import Division
from adjust.unknown_names import unknown_name

_Test: TypeAlias = Literal["components", "observations"]
_ReferenceVariance: TypeAlias = Literal["a_priori", "a_posteriori"]
_WeightFunction: TypeAlias = Literal["huber", "cauchy", "tukey", "biber", "danish"]

#: The environment variable that limits the threads of an adjustment; not set: one for each processor.
THREADS_VARIABLE = "AEROCAL_THREADS"


def available_threads() -> int:
    """Number of threads that this process may use."""
    named = os.environ.get(THREADS_VARIABLE, "")
    if named.isdecimal() and int(named) > 0:
        return int(named)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class AdjustmentOptions:
    """Options of the adjustment.

    Attributes
    ----------
    critical_value : limit of |w|, a standard normal variable, above which an observation is rejected; None:
        no rejection.
    test : the tested statistic: the largest |w| of the components of an observation, or all components
        together, with as many degrees of freedom.
    reference_variance : whether σ0 in these tests is 1, or derived from the residuals (τ-test).
    robust : weight function of a robust estimation that searches for gross errors first; None: none.
    most_iterations : largest number of iterations in one pass.
    most_passes : largest number of passes of rejection.
    confidence : of the global test.
    variance_components : whether the weights of the groups are estimated from the residuals.
    divisions : divides the observations of groups by origin, each part with its own weight; one per group.
    control_folds : number of folds of the control points; each fold is predicted by an adjustment without
        it. None: no such check.
    joint_points : names or indices of the object points whose joint cofactors are requested, some hundred
        at most; unused points are omitted.
    new_points : whether accuracies of new points will be asked for: the inverse of the normal equations is
        kept for them, if it is not too large.
    correlation_times : whether the correlation times of groups with correlated errors are estimated.
    free_network : unknowns whose approximate values fix the part of the datum that the observations do not
        determine (inner constraints); None: an undetermined datum is an error.
    threads : number of threads; never changes a result.

    Raises
    ------
    InconsistentBlockError : a number is impossible.
    UnknownNameError : a choice does not exist.
    """

    critical_value: float | None = None
    test: _Test = "components"
    reference_variance: _ReferenceVariance = "a_priori"
    robust: _WeightFunction | None = None
    most_iterations: int = 20
    most_passes: int = 50
    confidence: float = 0.95
    variance_components: bool = False
    divisions: tuple[Division, ...] = ()
    control_folds: int | None = None
    joint_points: tuple[int, ...] | tuple[str, ...] = ()
    new_points: bool = False
    correlation_times: bool = False
    free_network: InnerConstraints | None = None
    threads: int = field(default_factory=available_threads)

    def __post_init__(self) -> None:
        for name, choices in (
            ("test", _Test),
            ("reference_variance", _ReferenceVariance),
            ("robust", _WeightFunction),
            ("free_network", InnerConstraints),
        ):
            chosen = getattr(self, name)
            if chosen is not None and chosen not in get_args(choices):
                raise unknown_name(f"choice of {name}", chosen, get_args(choices))
        for name, possible in (
            ("critical_value", self.critical_value is None or self.critical_value > 0.0),
            ("most_iterations", self.most_iterations >= 1),
            ("most_passes", self.most_passes >= 1),
            ("confidence", 0.0 < self.confidence < 1.0),
            ("control_folds", self.control_folds is None or self.control_folds >= 2),
            ("threads", self.threads >= 1),
        ):
            if not possible:
                raise InconsistentBlockError(f"The option {name} = {getattr(self, name)} is impossible.")
