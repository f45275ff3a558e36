"""The adjustment of a block from start to end, on one page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.data_snooping import Search, snoop, without_rejected
from adjust.errors import InconsistentBlockError
from adjust.least_squares import Adjusted, Adjuster
from adjust.observations.base import ObservationGroup
from adjust.observations.control_point import ControlPoints
from adjust.observations.image_point import ImagePoints
from adjust.one_thread import one_thread
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.quality.control_checks import ControlCheck, k_fold, leave_one_out
from adjust.quality.correlation_time import CorrelationTime
from adjust.quality.detectability import UNCONTROLLED
from adjust.quality.global_test import global_test
from adjust.quality.joint_cofactor import JointCofactor, joint_cofactors
from adjust.quality.readmission import in_place
from adjust.quality.redundancy import GroupResiduals
from adjust.quality.rejection import Rejection, SnoopingRule
from adjust.quality.s_transformation import with_inner_constraints
from adjust.quality.variance_components import VarianceComponent, variance_components
from adjust.result import AdjustmentResult, FreeNetwork, GroupResult, ObservationStatus
from adjust.solve.datum import datum_shares
from adjust.solve.defect import open_directions
from adjust.solve.gauss_newton import Estimate, Progress, Solution, converge
from adjust.solve.system import Observations, System, with_known_basis
from adjust.unknown_names import indices_of
from adjust.weighting import Weighted, estimate_weights


def adjust_block(
    block: Block,
    observations: Observations,
    options: AdjustmentOptions | None = None,
    progress: Progress | None = None,
) -> AdjustmentResult:
    """Adjust a block by least squares, with all statistics of the result.

    Gauss–Newton iterations until convergence. If a critical value is given, gross errors are rejected pass
    by pass until none is left; the last pass is an ordinary adjustment of the remaining observations, from
    which all statistics are derived. If variance components or correlation times are requested, their
    estimation and the rejection alternate. The result does not depend on the number of threads: the linear
    algebra library runs on one thread, and parallel parts sum in a fixed order.

    Parameters
    ----------
    progress : called after every iteration.

    Raises
    ------
    DatumDefectError : the observations do not determine all unknowns.
    DivergenceError : no convergence.
    InconsistentBlockError : the block contradicts itself.
    """
    for value, kind in ((block, Block), (observations, Observations), (options, AdjustmentOptions | None)):
        if not isinstance(value, kind):
            raise TypeError(
                f"adjust_block takes a Block, Observations and AdjustmentOptions, no {type(value).__name__}."
            )
    options = options or AdjustmentOptions()
    adjuster = Adjuster(options, progress)
    with one_thread():
        return _result(*_searched(adjuster, block, observations), options)


@dataclass(frozen=True, eq=False)
class AdjustedValues:
    """The values that ``adjust_block`` finds, and the starting point of its statistics.

    Attributes
    ----------
    adjuster : with the options.
    search, weighted : the searches; the last adjustment of theirs may count as stalled.
    solution : that adjustment, converged.
    """

    adjuster: Adjuster
    search: Search
    weighted: Weighted | None
    solution: Solution

    @classmethod
    def of(
        cls,
        block: Block,
        observations: Observations,
        options: AdjustmentOptions,
        progress: Progress | None = None,
    ) -> AdjustedValues:
        """Adjust a block; parameters and errors as of :func:`adjust_block`."""
        adjuster = Adjuster(options, progress)
        with one_thread():
            search, weighted = _searched(adjuster, block, observations, None, complete=False)
            return cls(adjuster, search, weighted, adjuster.values_to_the_end(search.adjusted))

    @property
    def state(self) -> State:
        """Adjusted values."""
        return self.solution.state

    @property
    def system(self) -> System:
        """The unknowns, and the observations that are left."""
        return self.search.adjusted.system

    @property
    def rejected(self) -> Rejection:
        """What has been rejected."""
        return Rejection(self.search.rejected, self.search.given_up)

    def again(
        self, block: Block, observations: Observations, rejected: Rejection, start: State
    ) -> AdjustmentResult:
        """The complete result of the same block with other parameters held.

        Parameters
        ----------
        observations : the same, but for what is known beforehand of parameters that are held.
        rejected : what is rejected of them from the start; those that fit are restored.
        start : initial values of the iteration.
        """
        nearby = _Nearby(self.system, rejected, start)
        with one_thread():
            return _result(*_searched(self.adjuster, block, observations, nearby), self.adjuster.options)

    def result(self) -> AdjustmentResult:
        """The complete result of ``adjust_block``."""
        options, search, rule = self.adjuster.options, self.search, _rule(self.adjuster.options)
        with one_thread():
            if search.adjusted.solution.stalled:
                complete = self.adjuster.completed(search.adjusted, self.solution)
                search = replace(search, adjusted=complete)
                search = search if rule is None else snoop(self.adjuster, search, rule)
            return _result(search, self.weighted, options)


@dataclass(frozen=True, eq=False)
class _Nearby:
    """An adjustment of nearly the same block: its system, what it rejected, and where the next one begins."""

    system: System
    rejected: Rejection
    start: State

    def system_of(self, block: Block, observations: Observations) -> System:
        """The system of the block without what is rejected."""
        same = self.system.remaining(without_rejected(observations, self.rejected))
        return replace(same, block=block, layout=block.layout)


def _searched(
    adjuster: Adjuster,
    block: Block,
    observations: Observations,
    nearby: _Nearby | None = None,
    complete: bool = True,
) -> tuple[Search, Weighted | None]:
    """The searches for gross errors and weights; ``complete`` as of :func:`snoop`."""
    options, rule = adjuster.options, _rule(adjuster.options)
    joint_points(block.points, options)  # refused before anything is computed
    observations = with_known_basis(block, observations)
    if nearby is None:
        system = System.of(block, observations, options.threads, options.free_network)
        start, rejected = block.approximate_state(), None
    else:
        system = nearby.system_of(block, observations)
        start, rejected = nearby.start, nearby.rejected
    weighting = options.variance_components or options.correlation_times
    # A search does not have to begin where an iteration ends; what it leaves is adjusted to the end.
    near = rule is not None or weighting

    # Handed on at once: a name for it here would keep the first adjustment until the last one is done.
    def first() -> Search:
        return Search.start(observations, adjuster.adjust(system, start, near=near), rejected)

    if weighting:
        weighted = estimate_weights(adjuster, first(), rule)
        return weighted.search, weighted
    return first() if rule is None else snoop(adjuster, first(), rule, complete), None


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

    The values that :func:`adjust_block` finds without a critical value, within a thousandth of their standard
    deviation and mostly a millionth, in less than half the time.
    Parameters and errors as there; ``critical_value`` is not used.
    """
    options = options or AdjustmentOptions()
    with one_thread():
        system = System.of(block, observations, options.threads, options.free_network)
        return converge(system, block.approximate_state(), options.most_iterations, progress)


def _result(search: Search, weighted: Weighted | None, options: AdjustmentOptions) -> AdjustmentResult:
    """Everything about the last adjustment."""
    adjusted = in_place(search.adjusted, search.given, search.given_up)
    system, state = adjusted.system, adjusted.state
    groups = tuple(
        GroupResult(
            group,
            item.residual,
            _used(group)[1],
            item.redundancy,
            item.standardized,
            item.detectable,
            item.control,
            _status(left, mask, item),
            item.weighted_squares,
        )
        for group, left, mask, item in zip(
            search.given.groups, system.observations.groups, search.rejected, adjusted.residuals, strict=True
        )
    )
    components: tuple[VarianceComponent, ...] = ()
    times: tuple[CorrelationTime, ...] = ()
    if weighted is not None:
        components, times = variance_components(
            adjusted,
            weighted.parts,
            weighted.factors,
            weighted.frozen,
            options.confidence,
        )
    singly, by_fold = _control_checks(search, options)
    return AdjustmentResult(
        system.block,
        state,
        system.layout,
        with_inner_constraints(system, adjusted.solution, adjusted.quality).without_joins(system.layout),
        global_test(adjusted.weighted_squares, adjusted.redundancy, options.confidence),
        groups,
        adjusted.history,
        search.per_pass,
        system.active_point,
        datum_shares(system, state),
        system,
        adjusted.solution,
        components if options.variance_components else (),
        0 if weighted is None else weighted.rounds,
        np.flatnonzero(search.given_up),
        search.taken_back,
        singly,
        by_fold,
        _joint_cofactor(adjusted, joint_points(system.block.points, options)),
        times,
        _free_network(adjusted),
        search.inseparable,
    )


def joint_points(names: Sequence[str], options: AdjustmentOptions) -> Ints:
    """Indices, ascending, of the object points whose joint cofactors are requested.

    Raises
    ------
    InconsistentBlockError, UnknownNameError : the block has no such object point.
    """
    points = np.unique(indices_of("object point", options.joint_points, names))
    if len(points) and not (points[0] >= 0 and points[-1] < len(names)):
        raise InconsistentBlockError(f"An index of joint_points is outside 0 … {len(names) - 1}.")
    return points


def _joint_cofactor(adjusted: Adjusted, wanted: Ints) -> JointCofactor | None:
    """Joint cofactors of the wanted points that are used; None in a free network with open directions."""
    points = wanted[adjusted.system.active_point[wanted]]
    if len(points) == 0 or adjusted.solution.movements is not None:
        return None
    return JointCofactor(points, joint_cofactors(adjusted.system, adjusted.solution, points))


def _free_network(adjusted: Adjusted) -> FreeNetwork | None:
    """What the approximate values carry; None where the network is not free."""
    constrained, movements = adjusted.system.inner_constraints, adjusted.solution.movements
    if constrained is None:
        return None
    if movements is None:
        return FreeNetwork(constrained, ())
    normals = adjusted.solution.normals
    return FreeNetwork(
        constrained, open_directions(adjusted.system, adjusted.state, normals, movements.vectors)
    )


def _control_checks(
    search: Search, options: AdjustmentOptions
) -> tuple[ControlCheck | None, ControlCheck | None]:
    """The control points left out one at a time, and, if requested, a fold at a time."""
    for group, rejected in zip(search.given.others, search.rejected[1:], strict=True):
        if isinstance(group, ControlPoints):
            by_fold = None
            if options.control_folds is not None:
                by_fold = k_fold(search.adjusted, group, rejected, options.control_folds)
            return leave_one_out(search.adjusted, group, rejected), by_fold
    return None, None


def _status(left: ObservationGroup, rejected: Bools, residuals: GroupResiduals) -> Ints:
    """Status (n, m) of every component after the last pass."""
    is_left, sigma = _used(left)
    status = np.where(is_left, int(ObservationStatus.USED), int(ObservationStatus.NOT_USED))
    status[is_left & ~(residuals.control >= UNCONTROLLED)] = ObservationStatus.UNCONTROLLED
    status[np.isfinite(sigma) & rejected[:, None]] = ObservationStatus.REJECTED
    return status


def _used(group: ObservationGroup) -> tuple[Bools, Floats]:
    """Which components (n, m) of a group are used, and their standard deviations.

    Of image points without the matrices of the general form, which take longer than their residuals.
    """
    if isinstance(group, ImagePoints):
        return np.broadcast_to(group.active[:, None], group.sigma.shape), group.sigma
    return group.stochastic.present, group.stochastic.sigma
