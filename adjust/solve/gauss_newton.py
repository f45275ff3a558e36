"""Gauss–Newton iteration, with Levenberg–Marquardt damping only when a step fails.

Stops when bᵀdx < ε². Since (dx_i/σ_i)² ≤ dxᵀ N dx = bᵀdx for every unknown (Cauchy–Schwarz), no
unknown then moves by more than ε of its own a-priori standard deviation. In a free network bᵀdx does not
notice movements of the block as a whole; those must have ended, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.errors import DatumDefectError, DivergenceError, InconsistentBlockError
from adjust.parameters import State
from adjust.solve.defect import explain_defect
from adjust.solve.factorization import Factorization, SingularNormalsError, factorize
from adjust.solve.free_network import OpenMovements, open_movements, settled
from adjust.solve.normal_equations import ReducedNormals, reduced_normals, substitute_back, weighted_squares
from adjust.solve.system import System
from adjust.solve.updated_normals import updated_normals

# No unknown moves by more than this part of its standard deviation any more.
_CONVERGED = 1e-3
# Nor by more than this: near enough for linear equations to say which observations are wrong.
_NEAR = 1.0
# Normal equations that are this near to the end are those of the end: another step from them would move
# nothing by 1e-9 of its standard deviation, and their cofactors are right to as many digits.
_SETTLED = 1e-5
_FIRST_DAMPING = 1e-4
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

    The solution counts as stalled. Its normal equations are those of the last linearisation, updated.

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
    increments = _increments(system, start, normals)
    moved = increments.applied(system, start)
    promised = normals.weighted_squares - increments.decrement
    step = Iteration(1, normals.weighted_squares, increments.largest_move, 0.0)
    solution = Solution(moved, normals, increments.factorization, (step,), True, increments.movements, start)
    return solution, promised


def iterate(
    system: System,
    start: State,
    most: int,
    progress: Progress | None = None,
    may_stall: bool = False,
    near: bool = False,
) -> Solution:
    """Iterate to convergence, with the factorised normal equations of the adjusted state.

    A last solution of those normal equations makes the state independent of the path to it, but in a free
    network. Other parameters and errors are those of :func:`converge`.

    Parameters
    ----------
    near : stop after a step that moves no unknown by more than its standard deviation. The solution then
        counts as stalled, with the normal equations from which that step was made.
    """
    end = _iterated(system, start, most, progress, may_stall, _NEAR if near else _CONVERGED)
    if end.stalled or (end.last.movements is not None and not near):
        # Free movements do not show in bᵀdx: these normal equations may be those of another datum.
        found = solution_at(system, end.state)
        return replace(found, iterations=end.iterations, stalled=end.stalled)
    state, normals, last, before = end.state, end.normals, end.last, end.before
    settled = last.largest_move < _SETTLED and last.movements is None
    if not (near or settled):
        before, normals = end.state, reduced_normals(system, end.state)
        last = _increments(system, before, normals)
        state = last.applied(system, before)
    return Solution(
        state, normals, last.factorization, end.iterations, near and not settled, last.movements, before
    )


def solution_at(system: System, state: State) -> Solution:
    """The factorised normal equations of a state that is adjusted already.

    Raises
    ------
    DatumDefectError : singular normal equations, explained.
    """
    normals = reduced_normals(system, state)
    factorization, movements = _factorize(system, state, normals)
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
class _Increments:
    """One step.

    Attributes
    ----------
    of_exposures, of_border, of_points : (n, 6), (g,) and (m, 3).
    decrement : bᵀdx, which no choice of the datum changes.
    factorization, movements : as of a solution.
    datum_settled : whether the block as a whole moves no more.
    """

    of_exposures: Floats
    of_border: Floats
    of_points: Floats
    decrement: float
    factorization: Factorization
    movements: OpenMovements | None = None
    datum_settled: bool = True

    @property
    def largest_move(self) -> float:
        """Upper bound of |dx_i|/σ_i over all unknowns."""
        return float(np.sqrt(max(self.decrement, 0.0)))

    def applied(self, system: System, state: State) -> State:
        """The state after the step."""
        return system.layout.update(state, self.of_exposures, self.of_border, self.of_points)


def _increments(system: System, state: State, normals: ReducedNormals) -> _Increments:
    """Solve the normal equations at a state; a free network also moves to its inner constraints."""
    factorization, movements = _factorize(system, state, normals)
    of_exposures, of_border = factorization.solve()
    decrement = normals.eliminated + float(
        np.sum(normals.rhs_exposure * of_exposures) + normals.rhs_border @ of_border
    )
    of_points = substitute_back(system, state, normals, of_exposures, of_border)
    if movements is None:
        return _Increments(of_exposures, of_border, of_points, decrement, factorization)
    exposures, border, points = movements.towards_approximate_values(system, state, of_exposures, of_points)
    return _Increments(
        of_exposures + exposures,
        of_border + border,
        of_points + points,
        decrement,
        factorization,
        movements,
        settled(normals, exposures),
    )


@dataclass(frozen=True, eq=False)
class _End:
    """Where an iteration has ended, and the normal equations of its last step.

    Attributes
    ----------
    state, weighted_squares, iterations, stalled : as of an estimate.
    before, normals : the state before the last step, and its normal equations.
    last : the last step.
    """

    state: State
    weighted_squares: float
    iterations: tuple[Iteration, ...]
    stalled: bool
    before: State
    normals: ReducedNormals
    last: _Increments


def _iterated(
    system: System, start: State, most: int, progress: Progress | None, may_stall: bool, limit: float
) -> _End:
    """As ``converge``, until no unknown moves by more than ``limit`` of its standard deviation."""
    state, damping = start, 0.0
    normals = reduced_normals(system, state)
    history: list[Iteration] = []
    for number in range(1, most + 1):
        increments = _increments(system, state, normals)
        step = Iteration(number, normals.weighted_squares, increments.largest_move, damping)
        history.append(step)
        if progress is not None:
            progress(step)
        moved = increments.applied(system, state)
        if step.largest_move < limit and damping == 0.0 and increments.datum_settled:
            # Whether vPv falls or rises in so small a step is decided by rounding alone.
            squares = weighted_squares(system, moved)
            if np.isfinite(squares):
                return _End(moved, squares, tuple(history), False, state, normals, increments)
        following = _try(system, moved)
        if following is None or following.weighted_squares > normals.weighted_squares * (1 + 1e-9) + 1e-9:
            damping = max(10.0 * damping, _FIRST_DAMPING)
            normals = reduced_normals(system, state, damping)
            continue
        lowered = following.weighted_squares <= (1.0 - _STALLED) * normals.weighted_squares
        if may_stall and step.largest_move > _LONG and not lowered:
            squares = following.weighted_squares
            return _End(moved, squares, tuple(history), True, state, normals, increments)
        state, normals = moved, following
        damping = 0.0 if damping <= _FIRST_DAMPING else damping / 10.0
        if damping > 0.0:
            normals = reduced_normals(system, state, damping)
    if may_stall:
        return _End(state, normals.weighted_squares, tuple(history), True, state, normals, increments)
    raise DivergenceError(
        most, tuple(item.weighted_squares for item in history), _largest(system, increments)
    )


def _try(system: System, state: State) -> ReducedNormals | None:
    """Normal equations at a state, None where the step has left the domain of the model."""
    try:
        return reduced_normals(system, state)
    except (DatumDefectError, InconsistentBlockError):
        return None


def _factorize(
    system: System, state: State, normals: ReducedNormals
) -> tuple[Factorization, OpenMovements | None]:
    """Factorised normal equations, and the movements of a free network that had to be fixed for it."""
    movements = open_movements(system, state, normals)
    try:
        return factorize(normals if movements is None else movements.held(normals), system.threads), movements
    except SingularNormalsError as error:
        raise explain_defect(system, state, error) from error


def _largest(system: System, increments: _Increments) -> str:
    """The exposure or system parameter that moved most in the last step, in words."""
    shift = np.linalg.norm(increments.of_exposures[:, :3], axis=1)
    image = int(np.argmax(shift))
    of_border = increments.of_border
    kind = "image" if system.block.rig is None else "event"
    return f"{kind} {system.block.events[image]} ({shift[image]:.3g} m)" + (
        f"; system parameters by up to {np.max(np.abs(of_border)):.3g}" if len(of_border) else ""
    )
