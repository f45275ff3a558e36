"""Gauss–Newton iteration, with Levenberg–Marquardt damping only when a step fails.

Damped steps of a weak network creep along a curved valley, because increments of coordinates are tangents of
the movement that is hardly held: where they do not arrive, it is made exactly, again from the start.

Stops when bᵀdx < ε². Since (dx_i/σ_i)² ≤ dxᵀ N dx = bᵀdx for every unknown (Cauchy–Schwarz), no
unknown then moves by more than ε of its own a-priori standard deviation. In a free network bᵀdx does not
notice movements of the block as a whole; those must have ended, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adjust.errors import DatumDefectError, DivergenceError, InconsistentBlockError
from adjust.parameters import State
from adjust.solve.factorization import Factorization
from adjust.solve.free_network import OpenMovements
from adjust.solve.normal_equations import ReducedNormals, reduced_normals, weighted_squares
from adjust.solve.right_hand_side import with_right_hand_sides
from adjust.solve.step import Step, factorized
from adjust.solve.system import System
from adjust.solve.updated_normals import updated_normals
from adjust.solve.whole_block import WholeBlock

# No unknown moves by more than this part of its standard deviation any more.
_CONVERGED = 1e-3
# Nor by more than this: near enough for linear equations to say which observations are wrong.
_NEAR = 1.0
# Normal equations that are this near to the end are those of the end: another step from them would move
# nothing by 1e-9 of its standard deviation, and their cofactors are right to as many digits.
_SETTLED = 1e-5
_FIRST_DAMPING = 1e-4
# The same where movements of the block as a whole are made exactly.
_LEAST_DAMPING = 1e-6
# So many times as many steps for a block that is hardly held.
_PATIENCE = 3
# A step with the factors of an earlier state that is longer than this part of the one before is not made:
# new normal equations take no longer than the many steps that would follow.
_CONTRACTION = 0.02
# Long steps (bound of |dx_i|/σ_i) that lower vᵀPv by less than this part lead nowhere.
_LONG, _STALLED = 30.0, 1e-3


@dataclass(frozen=True)
class Iteration:
    """One step of the iteration.

    Attributes
    ----------
    number : counted from 1 within a pass.
    weighted_squares : vᵀPv before the step.
    largest_move : upper bound of |dx_i|/σ_i over all unknowns, √(bᵀdx).
    damping : λ of the step, 0 for Gauss–Newton.
    """

    number: int
    weighted_squares: float
    largest_move: float
    damping: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """A converged state.

    Attributes
    ----------
    state : adjusted values.
    weighted_squares : vᵀPv at that state.
    iterations : the steps that led there.
    stalled : it is not converged: long steps hardly lower vᵀPv any more, or there were too few.
    """

    state: State
    weighted_squares: float
    iterations: tuple[Iteration, ...]
    stalled: bool = False


@dataclass(frozen=True, eq=False)
class Solution:
    """A converged (or stalled) state with its last normal equations.

    Attributes
    ----------
    normals : normal equations N dx = b, undamped.
    factorization : of them; of a free network in a minimal datum.
    linearized_at : the state of the normal equations; None: the state itself.
    movements : what the observations leave open of the datum of a free network; None if nothing.
    """

    state: State
    normals: ReducedNormals
    factorization: Factorization
    iterations: tuple[Iteration, ...]
    stalled: bool = False
    movements: OpenMovements | None = None
    linearized_at: State | None = None

    @property
    def linearization(self) -> State:
        """The state of the normal equations."""
        return self.state if self.linearized_at is None else self.linearized_at

    @property
    def defect(self) -> int:
        """Number d of open movements of the datum."""
        return 0 if self.movements is None else self.movements.defect


Progress = Callable[[Iteration], None]


def single_step(before: System, solution: Solution, system: System, start: State) -> tuple[Solution, float]:
    """One linear step after a few observations were rejected or came back, and the vᵀPv that it promises.

    The solution counts as stalled. Its normal equations are those of the last linearisation, updated; their
    matrix may be that of an earlier state.

    Parameters
    ----------
    before, solution : with the observations before.
    start : the state of the linearisation, with object points that were not used in their new places.

    Raises
    ------
    DatumDefectError : singular normal equations, explained.
    InconsistentBlockError : an object point lies behind a camera that sees it.
    """
    normals = updated_normals(before, solution.normals, system, start)
    step = Step.newton(system, start, normals)
    iteration = Iteration(1, normals.weighted_squares, step.largest_move, 0.0)
    return _solution(step, (iteration,), True), normals.weighted_squares - step.decrement


def iterate(
    system: System,
    start: State,
    most: int,
    progress: Progress | None = None,
    may_stall: bool = False,
    near: bool = False,
    earlier: Step | None = None,
) -> Solution:
    """Iterate to convergence, with the factorised normal equations of the adjusted state.

    A last solution of those normal equations makes the state independent of the path to it, but in a free
    network. Other parameters and errors are those of :func:`converge`.

    Parameters
    ----------
    near : stop after a step that moves no unknown by more than its standard deviation. Unless it hardly
        moves any, the solution then counts as stalled, with the normal equations from which that step was
        made; their matrix may be that of an earlier state.
    earlier : a step to the start, whose factors may serve for the next ones.
    """
    end = _iterated(system, start, most, progress, may_stall, _NEAR if near else _CONVERGED, earlier)
    last, only_near = end.last, end.last.largest_move >= _CONVERGED
    if end.stalled or (last.movements is not None and not only_near):
        # Free movements do not show in bᵀdx: these normal equations may be those of another datum.
        found = solution_at(system, end.state)
        return replace(found, iterations=end.iterations, stalled=end.stalled)
    if only_near:
        return _solution(last, end.iterations, True)
    settled = last.is_newton and last.largest_move < _SETTLED
    if not settled:
        last = Step.newton(system, end.state, reduced_normals(system, end.state))
    return _solution(last, end.iterations, False)


def _solution(last: Step, iterations: tuple[Iteration, ...], stalled: bool) -> Solution:
    """After the last step, with its normal equations."""
    return Solution(
        last.moved, last.normals, last.factorization, iterations, stalled, last.movements, last.state
    )


def solution_at(system: System, state: State) -> Solution:
    """The factorised normal equations of a state that is adjusted already.

    Raises
    ------
    DatumDefectError : singular normal equations, explained.
    """
    normals = reduced_normals(system, state)
    factorization, movements = factorized(system, state, normals)
    return Solution(state, normals, factorization, (), movements=movements)


def converge(
    system: System, start: State, most: int, progress: Progress | None = None, may_stall: bool = False
) -> Estimate:
    """Iterate from approximate values to convergence.

    Parameters
    ----------
    most : number of steps after which it is given up.
    may_stall : return a stalled state in place of going on or giving up. With gross errors of many thousand
        σ in it Gauss–Newton creeps (the neglected second derivatives are multiplied by the residuals), and
        they are plain to see long before it arrives.

    Raises
    ------
    DivergenceError : no convergence within ``most`` steps.
    DatumDefectError : singular normal equations, explained.
    """
    end = _iterated(system, start, most, progress, may_stall, _CONVERGED)
    return Estimate(end.state, end.weighted_squares, end.iterations, end.stalled)


@dataclass(frozen=True, eq=False)
class _End:
    """Where an iteration has ended.

    Attributes
    ----------
    state, weighted_squares, iterations, stalled : as of an estimate.
    last : the last step.
    """

    state: State
    weighted_squares: float
    iterations: tuple[Iteration, ...]
    stalled: bool
    last: Step


def _iterated(
    system: System,
    start: State,
    most: int,
    progress: Progress | None,
    may_stall: bool,
    limit: float,
    earlier: Step | None = None,
) -> _End:
    """As ``converge``, until no unknown moves by more than ``limit`` of its standard deviation.

    Parameters
    ----------
    earlier : a step to the start, as of :func:`iterate`.
    """
    state, damping, before = start, 0.0, earlier
    known = None if before is None else _try(system, state, before)
    normals = reduced_normals(system, state) if known is None else known
    if known is None:
        before = None
    history: list[Iteration] = []
    for number in range(1, most + 1):
        step = _step(system, state, normals, before)
        squares = step.normals.weighted_squares
        history.append(Iteration(number, squares, step.largest_move, damping))
        if progress is not None:
            progress(history[-1])
        if step.largest_move < limit and damping == 0.0 and step.datum_settled:
            # Whether vPv falls or rises in so small a step is decided by rounding alone.
            end, settled = step.moved.with_own_motion()
            if not settled:
                state, normals, before = end, reduced_normals(system, end), None
                continue
            at_end = weighted_squares(system, end)
            if np.isfinite(at_end):
                return _End(end, at_end, tuple(history), False, step)
        before = step if damping == 0.0 and step.movements is None else None
        following = _try(system, step.moved, before)
        # The datum may go on moving where vPv is at its end.
        short = step.largest_move < limit
        rises = following is None or following.weighted_squares > squares * (1 + 1e-9) + 1e-9
        if following is None or (rises and not short):
            damping, before = max(10.0 * damping, _FIRST_DAMPING), None
            normals = reduced_normals(system, state, damping)
            continue
        lowered = following.weighted_squares <= (1.0 - _STALLED) * squares
        if may_stall and step.largest_move > _LONG and not lowered:
            return _End(step.moved, following.weighted_squares, tuple(history), True, step)
        state, normals = step.moved, following
        damping = 0.0 if damping <= _FIRST_DAMPING else damping / 10.0
        if damping > 0.0:
            normals = reduced_normals(system, state, damping)
    if may_stall:
        return _End(state, normals.weighted_squares, tuple(history), True, step)
    block = WholeBlock.of(step)
    weakest = block.weakest(step.state)
    as_a_whole = _as_a_whole(system, start, _PATIENCE * most if weakest else most, progress, limit)
    if as_a_whole is not None and as_a_whole.weighted_squares <= normals.weighted_squares * (1 + 1e-9):
        return as_a_whole
    weakest = weakest or block.weakest_bending(step.state)
    raise DivergenceError(
        most, tuple(item.weighted_squares for item in history), _largest(system, step), weakest
    )


def _as_a_whole(
    system: System, start: State, most: int, progress: Progress | None, limit: float
) -> _End | None:
    """As ``_iterated``, the block moved as a whole exactly, and placed best; None: that does not converge.

    Damping follows what a step gains (Marquardt): a movement of large σ bends by no more than that.
    """
    state, damping, least, history = start, 0.0, _LEAST_DAMPING, list[Iteration]()
    try:
        normals = reduced_normals(system, state)
        for number in range(1, most + 1):
            step = Step.newton(system, state, normals)
            squares, short = normals.weighted_squares, step.largest_move < limit
            history.append(Iteration(number, squares, step.largest_move, damping))
            if progress is not None:
                progress(history[-1])
            if short and damping == 0.0 and step.datum_settled:
                end, settled = step.moved.with_own_motion()
                if not settled:
                    state, normals = end, reduced_normals(system, end)
                    continue
                at_end = weighted_squares(system, end)
                return _End(end, at_end, tuple(history), False, step) if np.isfinite(at_end) else None
            block = WholeBlock.of(step)
            moved = block.placed(block.moved(step))
            following = _try(system, moved, None)
            gain = -1.0 if following is None else squares - following.weighted_squares
            if following is None or (gain < 0.0 and not short):
                damping = max(10.0 * damping, least)
                normals = reduced_normals(system, state, damping)
                continue
            state, normals = moved, following
            if damping > 0.0:
                least, gain = damping, gain / step.decrement
                damping = 0.0 if short else damping * (0.1 if gain > 0.75 else 1.0 if gain > 0.25 else 3.0)
                normals = reduced_normals(system, state, damping)
    except (DatumDefectError, InconsistentBlockError):
        return None
    return None


def _step(system: System, state: State, normals: ReducedNormals, before: Step | None) -> Step:
    """From a state by its normal equations, or by the factors of the step before if they still do.

    Parameters
    ----------
    normals : of the state; their matrix is that of the step before if there is one.
    """
    if before is not None:
        found = before.then(state, normals)
        if found.largest_move <= _CONTRACTION * before.largest_move:
            return found
        normals = reduced_normals(system, state)
    return Step.newton(system, state, normals)


def _try(system: System, state: State, before: Step | None) -> ReducedNormals | None:
    """Normal equations at a state, None where the step has left the domain of the model.

    Parameters
    ----------
    before : a step whose matrix they take over; None: it is formed anew.
    """
    if before is not None:
        return with_right_hand_sides(before.normals, system, state)
    try:
        return reduced_normals(system, state)
    except (DatumDefectError, InconsistentBlockError):
        return None


def _largest(system: System, step: Step) -> str:
    """The exposure or system parameter that moved most in the last step, in words."""
    shift = np.linalg.norm(step.of_exposures[:, :3], axis=1)
    image = int(np.argmax(shift))
    of_border = step.of_border
    kind = "image" if system.block.rig is None else "event"
    return f"{kind} {system.block.events[image]} ({shift[image]:.3g} m)" + (
        f"; system parameters by up to {np.max(np.abs(of_border)):.3g}" if len(of_border) else ""
    )
