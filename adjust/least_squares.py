"""One ordinary least-squares adjustment with everything that is known about it.

Searches for gross errors and for variance components are made of these, one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.errors import DatumDefectError
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.quality.cofactor import Cofactor, cofactor, of_other_rays
from adjust.quality.considered import considered_errors
from adjust.quality.redundancy import GroupResiduals, group_residuals
from adjust.solve.gauss_newton import Iteration, Progress, Solution, iterate, single_step
from adjust.solve.step import Step
from adjust.solve.system import Observations, System
from adjust.solve.updated_normals import changed_points

# One step does where vᵀPv is what linear equations promise, but for this part.
_LINEAR = 1e-3
# A step (bound of |dx_i|/σ_i) after which nothing moves any more that shows.
_SHORT = 1e-2


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A converged adjustment.

    Attributes
    ----------
    system : unknowns and the observations that were used.
    solution, quality, residuals : values, cofactors and residuals.
    history : the iterations of this adjustment and of those before it, oldest first.
    """

    system: System
    solution: Solution
    quality: Cofactor
    residuals: tuple[GroupResiduals, ...]
    history: tuple[tuple[Iteration, ...], ...]

    @property
    def state(self) -> State:
        """Adjusted values."""
        return self.solution.state

    @property
    def observations(self) -> Observations:
        """The observations that were used."""
        return self.system.observations

    @property
    def weighted_squares(self) -> float:
        """vᵀPv."""
        return float(sum(item.weighted_squares for item in self.residuals))

    @property
    def redundancy(self) -> int:
        """N − u + d; d is the number of open movements of a free network."""
        return self.system.redundancy + self.solution.defect


@dataclass(frozen=True, eq=False)
class Adjuster:
    """Carries out successive adjustments of one block, each from the values of the previous one.

    Attributes
    ----------
    options : limits of the iteration.
    progress : called after every iteration.
    """

    options: AdjustmentOptions
    progress: Progress | None = None

    def adjust(
        self, system: System, state: State, may_stall: bool | None = None, near: bool = False
    ) -> Adjusted:
        """Adjust from approximate values.

        With a critical value it may stall: the gross errors in its way are found from where it stands.

        Parameters
        ----------
        may_stall : otherwise than that.
        near : end as soon as linear equations say which observations are wrong. The solution then counts as
            stalled: ``to_the_end`` completes it.

        Raises
        ------
        DatumDefectError, DivergenceError, InconsistentBlockError : as of ``adjust_block``.
        """
        if may_stall is None:
            may_stall = self.options.critical_value is not None
        solution = iterate(system, state, self.options.most_iterations, self.progress, may_stall, near)
        return self._with_quality(system, solution, ())

    def again(self, before: Adjusted, observations: Observations, state: State | None = None) -> Adjusted:
        """Adjust other observations of the same block, from the previous values or from a given state."""
        system = before.system.remaining(observations)
        found = self.adjust(system, before.state if state is None else state)
        return replace(found, history=before.history + found.history)

    def with_other_rejections(
        self, before: Adjusted, observations: Observations, state: State | None = None
    ) -> Adjusted:
        """Adjust after a few observations were rejected or restored, accurately enough to continue.

        One linear step does where it can, with new cofactors for the object points that have lost or gained
        something only. The solution then counts as stalled: ``to_the_end`` completes it. Elsewhere, where
        errors correlated over time join other exposures now, and where rejection is robust, the same as
        ``again``.

        Parameters
        ----------
        state : where object points that come back are; None: none does.
        """
        system = before.system.remaining(observations)
        if self.options.robust is not None or system.blocking is not before.system.blocking:
            return self.again(before, observations, state)
        start, back = before.solution.linearization, system.active_point & ~before.system.active_point
        if state is not None and back.any():
            places = np.where(back[:, None], state.object_point, start.object_point)
            start = replace(start, object_point=places)
        try:
            solution, promised = single_step(before.system, before.solution, system, start)
        except DatumDefectError:
            # Of an earlier state's matrix, what the rejected observations gave at this one is taken off.
            return self.again(before, observations, state)
        changed = changed_points(before.observations, system.observations, len(system.active_point))
        quality = of_other_rays(before.quality, system, solution, changed)
        residuals = group_residuals(system, solution.state, quality)
        found = Adjusted(system, solution, quality, residuals, (*before.history, solution.iterations))
        if not abs(found.weighted_squares - promised) <= _LINEAR * promised:
            return self.again(before, observations, state)
        return found

    def to_the_end(self, before: Adjusted) -> Adjusted:
        """The same adjustment, stalled before, until it converges or fails.

        Raises
        ------
        DivergenceError : it does not converge.
        """
        return self.completed(before, self.values_to_the_end(before))

    def values_to_the_end(self, before: Adjusted) -> Solution:
        """The solution that ``to_the_end`` finds, without cofactors; as it is if it has converged.

        Raises
        ------
        DivergenceError : it does not converge.
        """
        if not before.solution.stalled:
            return before.solution
        found, earlier = before.solution, None
        # After a short step normal equations of this state are as good as those of the end.
        if (
            found.linearized_at is not None
            and found.movements is None
            and found.iterations[-1].largest_move > _SHORT
        ):
            earlier = Step.repeated(before.system, found.linearized_at, found.factorization)
        return iterate(
            before.system, before.state, self.options.most_iterations, self.progress, earlier=earlier
        )

    def completed(self, before: Adjusted, solution: Solution) -> Adjusted:
        """With the solution of ``values_to_the_end``."""
        return self._with_quality(before.system, solution, before.history)

    def _with_quality(
        self, system: System, solution: Solution, history: tuple[tuple[Iteration, ...], ...]
    ) -> Adjusted:
        """A solution with its cofactors and residuals; history is that of the adjustments before it."""
        # Of a stalled solution nothing is handed on.
        found = cofactor(system, solution, self.options.new_points and not solution.stalled)
        quality = replace(found, considered=considered_errors(system, solution))
        residuals = group_residuals(system, solution.state, quality)
        return Adjusted(system, solution, quality, residuals, (*history, solution.iterations))
