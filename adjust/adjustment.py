"""The adjustment of a block: the whole story on one page."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from adjust.arrays import Bools, Ints
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.observations.base import ObservationGroup
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.quality.cofactor import Cofactor, cofactor
from adjust.quality.global_test import global_test
from adjust.quality.redundancy import UNCONTROLLED, GroupResiduals, group_residuals
from adjust.quality.rejection import Rejection, reject
from adjust.result import AdjustmentResult, GroupResult, ObservationStatus
from adjust.solve.datum import datum_shares
from adjust.solve.gauss_newton import Estimate, Iteration, Progress, Solution, converge, iterate
from adjust.solve.normal_equations import Observations, System


def adjust_block(
    block: Block,
    observations: Observations,
    options: AdjustmentOptions | None = None,
    progress: Progress | None = None,
) -> AdjustmentResult:
    """Adjust a block by least squares and state how good the result is.

    Gauss–Newton to convergence; where a critical value is given, gross errors are rejected pass by
    pass until none is left, and the last pass is an ordinary adjustment of what remains, from which
    all statistics come. The linear algebra library runs on one thread, and what runs on several sums
    in an order of its own, so that the result does not depend on their number.

    Parameters
    ----------
    progress : called after every iteration.

    Raises
    ------
    DatumDefectError : the observations do not determine all unknowns.
    DivergenceError : no convergence.
    InconsistentBlockError : the block contradicts itself.
    """
    options = options or AdjustmentOptions()
    history: list[tuple[Iteration, ...]] = []
    rejected_per_pass: list[int] = []
    rejected = tuple(np.zeros(len(group.image), dtype=bool) for group in observations.groups)
    state, remaining = block.approximate_state(), observations
    with threadpool_limits(limits=1):
        system = System.of(block, remaining, options.threads)
        for _ in range(options.most_passes):
            solution = iterate(system, state, options.most_iterations, progress)
            state = solution.state
            history.append(solution.iterations)
            quality = cofactor(system, solution)
            residuals = group_residuals(system, state, quality)
            if options.critical_value is None:
                break
            rejection = reject(remaining, residuals, options.critical_value)
            if rejection.count == 0:
                break
            rejected_per_pass.append(rejection.count)
            rejected = tuple(a | b for a, b in zip(rejected, rejection.rejected, strict=True))
            remaining = without(remaining, rejection)
            system = system.remaining(remaining)
        else:
            raise InconsistentBlockError(
                f"After {options.most_passes} passes of rejection there are still standardized residuals "
                f"above {options.critical_value}. The critical value is too small for these weights."
            )
        return _result(
            system,
            solution,
            quality,
            residuals,
            observations,
            rejected,
            options,
            tuple(history),
            tuple(rejected_per_pass),
        )


def estimate_block(
    block: Block,
    observations: Observations,
    options: AdjustmentOptions | None = None,
    progress: Progress | None = None,
) -> Estimate:
    """Adjusted values only: no rejection, no covariances, no redundancy numbers.

    The same values as :func:`adjust_block` finds without a critical value, in less than half the time.
    Parameters and errors as there; ``critical_value`` takes no part.
    """
    options = options or AdjustmentOptions()
    with threadpool_limits(limits=1):
        system = System.of(block, observations, options.threads)
        return converge(system, block.approximate_state(), options.most_iterations, progress)


def without(observations: Observations, rejection: Rejection) -> Observations:
    """The observations that remain after a pass of rejection."""
    of_rays = rejection.rejected[0].copy()
    of_rays[rejection.dropped] = True
    return Observations(
        observations.image_points.without(of_rays),
        tuple(
            group.without(mask)
            for group, mask in zip(observations.others, rejection.rejected[1:], strict=True)
        ),
    )


def _result(
    system: System,
    solution: Solution,
    quality: Cofactor,
    residuals: tuple[GroupResiduals, ...],
    given: Observations,
    rejected: tuple[Bools, ...],
    options: AdjustmentOptions,
    history: tuple[tuple[Iteration, ...], ...],
    rejected_per_pass: tuple[int, ...],
) -> AdjustmentResult:
    """Everything about the last pass."""
    state: State = solution.state
    squares = float(sum(item.weighted_squares for item in residuals))
    groups = tuple(
        GroupResult(
            group,
            item.residual,
            group.stochastic.sigma,
            item.redundancy,
            item.standardized,
            item.detectable,
            _status(left, mask, item),
            item.weighted_squares,
        )
        for group, left, mask, item in zip(
            given.groups, system.observations.groups, rejected, residuals, strict=True
        )
    )
    return AdjustmentResult(
        state,
        system.layout,
        quality,
        global_test(squares, system.redundancy, options.confidence),
        groups,
        history,
        rejected_per_pass,
        system.active_point,
        datum_shares(system, state),
    )


def _status(left: ObservationGroup, rejected: Bools, residuals: GroupResiduals) -> Ints:
    """Status (n, m) of every component after the last pass."""
    is_left: Bools = left.stochastic.present
    given: Bools = np.isfinite(left.stochastic.sigma)
    status = np.full(is_left.shape, int(ObservationStatus.NOT_USED), dtype=np.int64)
    status[is_left] = ObservationStatus.USED
    status[is_left & (np.nan_to_num(residuals.redundancy) < UNCONTROLLED)] = ObservationStatus.UNCONTROLLED
    status[given & rejected[:, None]] = ObservationStatus.REJECTED
    return status
