"""One ordinary least-squares adjustment with everything that is known about it.

Searches for gross errors and for variance components are made of these, one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adjust.errors import DatumDefectError
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.quality.cofactor import Cofactor, of_other_rays, with_points
from adjust.quality.considered import considered_errors
from adjust.quality.considered_errors import ConsideredErrors
from adjust.quality.redundancy import GroupResiduals, group_residuals, residuals_of_others
from adjust.solve.factorization import ReducedCofactor
from adjust.solve.gauss_newton import Iteration, Progress, Solution, iterate, single_step
from adjust.solve.step import Step
from adjust.solve.system import Observations, System
from adjust.solve.updated_normals import changed_points, of_points

# One step does where vᵀPv is what linear equations promise, but for this part.
_LINEAR = 1e-3
# A step (bound of |dx_i|/σ_i) after which nothing moves any more that shows.
_SHORT = 1e-2


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A converged adjustment; its cofactors and residuals are computed when they are asked for.

    Attributes
    ----------
    system : unknowns and the observations that were used.
    solution : values.
    history : the iterations of this adjustment and of those before it, oldest first.
    keep : whether the inverse of the normal equations is kept.
    known_quality, known_residuals : what is known of cofactors and residuals; None: nothing.
    """

    system: System
    solution: Solution
    history: tuple[tuple[Iteration, ...], ...]
    keep: bool = False
    known_quality: Cofactor | None = None
    known_residuals: tuple[GroupResiduals, ...] | None = None

    @cached_property
    def reduced(self) -> ReducedCofactor:
        """Cofactors of exposures and system parameters."""
        if self.known_quality is not None:
            return self.known_quality.reduced
        return self.solution.factorization.cofactor(keep=self.keep)

    @cached_property
    def quality(self) -> Cofactor:
        """Cofactors of all unknowns."""
        if self.known_quality is not None:
            return self.known_quality
        return replace(with_points(self.system, self.solution, self.reduced), considered=self.considered)

    @cached_property
    def considered(self) -> ConsideredErrors | None:
        """Effects of errors of considered parameters; None without any."""
        if self.known_quality is not None:
            return self.known_quality.considered
        return considered_errors(self.system, self.solution)

    @cached_property
    def residuals(self) -> tuple[GroupResiduals, ...]:
        """Residuals and redundancy numbers of all groups."""
        if self.known_residuals is not None:
            return self.known_residuals
        linearization = self.solution.linearization
        return group_residuals(self.system, self.state, self.quality, linearization)

    @cached_property
    def quality_of_others(self) -> Cofactor:
        """Cofactors for the groups other than image points: of the few object points they touch."""
        touched = np.zeros(len(self.system.active_point) + 1, dtype=bool)  # the last one stands for none (−1)
        for index in (*(group.point for group in self.system.observations.others), *self.system.joined):
            touched[index] = True
        return with_points(of_points(self.system, touched[:-1]), self.solution, self.reduced)

    @cached_property
    def residuals_of_others(self) -> tuple[GroupResiduals, ...]:
        """Those of the groups other than image points; w without errors of considered parameters."""
        linearization = self.solution.linearization
        return residuals_of_others(self.system, self.state, self.quality_of_others, linearization)

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
        return self._adjusted(system, solution, ())

    def again(
        self, before: Adjusted, observations: Observations, state: State | None = None, near: bool = False
    ) -> Adjusted:
        """Adjust other observations of the same block, from the previous values or from a given state.

        Parameters
        ----------
        near : as of ``adjust``.
        """
        system = before.system.remaining(observations)
        found = self.adjust(system, before.state if state is None else state, near=near)
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
        except (DatumDefectError, np.linalg.LinAlgError):
            # Of an earlier state's matrix, what the rejected observations gave at this one is taken off: what
            # is left may be singular, or have negative eigenvalues.
            return self.again(before, observations, state)
        changed = changed_points(before.observations, system.observations, len(system.active_point))
        quality = of_other_rays(before.quality, system, solution, changed)
        found = Adjusted(system, solution, (*before.history, solution.iterations), known_quality=quality)
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
            earlier = Step.repeated(before.system, found.linearized_at, found.normals, found.factorization)
        return iterate(
            before.system, before.state, self.options.most_iterations, self.progress, earlier=earlier
        )

    def completed(self, before: Adjusted, solution: Solution) -> Adjusted:
        """With the solution of ``values_to_the_end``."""
        return self._adjusted(before.system, solution, before.history)

    def _adjusted(
        self, system: System, solution: Solution, history: tuple[tuple[Iteration, ...], ...]
    ) -> Adjusted:
        """A solution as an adjustment; history is that of the adjustments before it."""
        # Of a stalled solution nothing is handed on.
        keep = self.options.new_points and not solution.stalled
        return Adjusted(system, solution, (*history, solution.iterations), keep)
