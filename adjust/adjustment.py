"""The adjustment of a block: the whole story on one page."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from adjust.arrays import Bools, Ints
from adjust.block import Block
from adjust.data_snooping import Search, snoop
from adjust.least_squares import Adjuster
from adjust.observations.base import ObservationGroup
from adjust.options import AdjustmentOptions
from adjust.quality.global_test import global_test
from adjust.quality.redundancy import UNCONTROLLED, GroupResiduals
from adjust.quality.rejection import SnoopingRule
from adjust.quality.variance_components import VarianceComponent, variance_components
from adjust.result import AdjustmentResult, GroupResult, ObservationStatus
from adjust.solve.datum import datum_shares
from adjust.solve.gauss_newton import Estimate, Progress, converge
from adjust.solve.normal_equations import Observations, System
from adjust.weighting import Weighted, estimate_weights


def adjust_block(
    block: Block,
    observations: Observations,
    options: AdjustmentOptions | None = None,
    progress: Progress | None = None,
) -> AdjustmentResult:
    """Adjust a block by least squares and state how good the result is.

    Gauss–Newton to convergence; where a critical value is given, gross errors are rejected pass by
    pass until none is left, and the last pass is an ordinary adjustment of what remains, from which
    all statistics come. Where variance components are asked for, the weights are estimated, too, in turn
    with the rejection. The linear algebra library runs on one thread, and what runs on several sums
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
    adjuster = Adjuster(options, progress)
    with threadpool_limits(limits=1):
        system = System.of(block, observations, options.threads)
        search = Search.start(observations, adjuster.adjust(system, block.approximate_state()))
        rule, weighted = _rule(options), None
        if options.variance_components:
            weighted = estimate_weights(adjuster, search, rule)
            search = weighted.search
        elif rule is not None:
            search = snoop(adjuster, search, rule)
        return _result(search, weighted, options)


def _rule(options: AdjustmentOptions) -> SnoopingRule | None:
    if options.critical_value is None:
        return None
    return SnoopingRule(options.critical_value, options.test, options.reference_variance)


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


def _result(search: Search, weighted: Weighted | None, options: AdjustmentOptions) -> AdjustmentResult:
    """Everything about the last adjustment."""
    adjusted = search.adjusted
    system, state = adjusted.system, adjusted.state
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
            search.given.groups, system.observations.groups, search.rejected, adjusted.residuals, strict=True
        )
    )
    components: tuple[VarianceComponent, ...] = ()
    if weighted is not None:
        components = variance_components(
            system,
            adjusted.solution,
            adjusted.residuals,
            weighted.parts,
            weighted.factors,
            weighted.frozen,
            options.confidence,
        )
    return AdjustmentResult(
        state,
        system.layout,
        adjusted.quality,
        global_test(adjusted.weighted_squares, system.redundancy, options.confidence),
        groups,
        adjusted.history,
        search.per_pass,
        system.active_point,
        datum_shares(system, state),
        components,
        0 if weighted is None else weighted.rounds,
        np.flatnonzero(search.given_up),
        search.taken_back,
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
