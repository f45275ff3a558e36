"""Adjust a block, drop the additional parameters it does not support, and adjust what is left.

The selection itself works on the linearised solution (``elimination``); one adjustment before it says what
all parameters are worth together, one after it gives the results. Where the block cannot determine all of
them, the first one holds them, and what is not determinable is found by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adjust.adjustment import AdjustedValues, adjust_block
from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.data_snooping import without_rejected
from adjust.errors import DatumDefectError, DivergenceError
from adjust.observations.direct import DirectObservations
from adjust.options import AdjustmentOptions
from adjust.parameters import ADDITIONAL_PARAMETERS, ParameterLayout, State
from adjust.quality.rejection import Rejection
from adjust.result import AdjustmentResult
from adjust.selection.elimination import Elimination, EliminationRules, eliminate
from adjust.selection.linear_estimate import LinearEstimate
from adjust.selection.parameter_normals import (
    changes_from_given,
    normals_at,
    normals_of_result,
    normals_of_solution,
    state_with,
)
from adjust.solve.gauss_newton import Progress
from adjust.solve.system import Observations, System, with_known_basis


@dataclass(frozen=True, eq=False)
class SelectedAdjustment:
    """An adjustment with the additional parameters that are left, and how they were chosen.

    Attributes
    ----------
    block : with what was dropped held.
    result : of its adjustment.
    full : all free system parameters together, before any was dropped.
    offered : place of the unknowns then; its columns are those of ``full`` and of the decisions.
    elimination : the decisions; None where no rules were given.
    sigma0 : a known σ0 that all tests used; None: that of the estimates.
    """

    block: Block
    result: AdjustmentResult
    full: LinearEstimate
    offered: ParameterLayout
    elimination: Elimination | None
    sigma0: float | None


def adjust_with_selection(
    block: Block,
    observations: Observations,
    options: AdjustmentOptions,
    rules: EliminationRules | None,
    progress: Progress | None = None,
    tell: Callable[[Elimination], None] | None = None,
    sigma0: float | None = None,
) -> SelectedAdjustment:
    """Adjust a block whose free additional parameters are candidates for elimination.

    Parameters
    ----------
    rules : by which they are dropped; None keeps them all.
    tell : called with the decisions before the block is adjusted again.
    sigma0 : a known σ0 for the tests; None: that of the estimates.

    Raises
    ------
    DatumDefectError, DivergenceError, InconsistentBlockError : as of ``adjust_block``; with rules, not on
        account of additional parameters that are not determined.
    """
    layout = block.layout
    candidates = columns_of(layout, ADDITIONAL_PARAMETERS)
    if rules is None:
        result = adjust_block(block, observations, options, progress)
        full = LinearEstimate.of(normals_of_result(result))
        return SelectedAdjustment(block, result, full, layout, None, sigma0)
    observations = with_known_basis(block, observations)
    values, full = _all_together(block, observations, options, candidates, progress)
    elimination = eliminate(full, candidates, rules, sigma0)
    if tell is not None:
        tell(elimination)
    if values.system.layout.border == layout.border and not elimination.eliminated.any():
        return SelectedAdjustment(block, values.result(), full, layout, elimination, sigma0)
    reduced = with_held(_started_from(block, values.state), layout, elimination.eliminated)
    kept = without_priors_of_held(reduced, observations)
    rejected = _of_same(kept, values.search.given, values.rejected)
    result = values.again(
        reduced, kept, rejected, _start(reduced, layout, values, elimination.estimate.change)
    )
    # The values to start from are no longer the given ones.
    left = with_held(block, layout, elimination.eliminated)
    return SelectedAdjustment(left, result, full, layout, elimination, sigma0)


def columns_of(layout: ParameterLayout, family: str) -> Bools:
    """(g,) which columns of the border belong to a family."""
    found = np.zeros(layout.border, dtype=bool)
    columns = layout.columns.get(family, np.zeros(0, dtype=np.int64))
    found[columns[columns >= 0]] = True
    return found


def with_held(block: Block, layout: ParameterLayout, held: Bools) -> Block:
    """The block with some of the border's columns (g,) of a layout held at their given values."""
    system = []
    for parameters in block.system:
        columns: Ints = layout.columns[parameters.family.name]
        free = (columns >= 0) & ~np.where(columns >= 0, held[columns], True)
        system.append(replace(parameters, free=free))
    return replace(block, system=tuple(system))


def _all_together(
    block: Block,
    observations: Observations,
    options: AdjustmentOptions,
    candidates: Bools,
    progress: Progress | None,
) -> tuple[AdjustedValues, LinearEstimate]:
    """A first adjustment, and all parameters as far as they are determined; the rest it holds."""
    try:
        values = AdjustedValues.of(block, observations, options, progress)
        if values.solution.movements is None:
            return values, LinearEstimate.of(normals_of_solution(values.system, values.solution))
        return values, LinearEstimate.of(normals_of_result(values.result()))
    except (DatumDefectError, DivergenceError):
        held = with_held(block, block.layout, candidates)
        kept = without_priors_of_held(held, observations)
        values = AdjustedValues.of(held, kept, options, progress)
        left = without_rejected(observations, _of_same(observations, kept, values.rejected))
        system = System.of(block, left, options.threads, options.free_network)
        return values, LinearEstimate.of(normals_at(system, values.state), last=candidates)


def _start(reduced: Block, layout: ParameterLayout, values: AdjustedValues, change: Floats) -> State:
    """Where the linear equations see everything without the parameters that are eliminated.

    Parameters
    ----------
    change : (g,) of the parameters of a layout against their given values; zero of those.
    """
    nothing = np.zeros((layout.events, 6)), np.zeros((layout.points, 3))
    start = layout.update(reduced.approximate_state(), nothing[0], change, nothing[1])
    if values.system.layout.border != layout.border or values.solution.movements is not None:
        return start
    followed = state_with(values.system, values.solution, change - changes_from_given(layout, values.state))
    return replace(followed, system=start.system)


def _started_from(block: Block, state: State) -> Block:
    """The block with adjusted orientations and points as approximate values."""
    return replace(
        block,
        projection_centre=state.projection_centre,
        local_from_camera=state.local_from_camera,
        object_point=state.object_point,
    )


def _of_same(wanted: Observations, before: Observations, rejected: Rejection) -> Rejection:
    """The same of the same observations without some priors, or with them; a prior is never rejected."""
    masks = iter(
        [
            mask
            for group, mask in zip(before.groups, rejected.rejected, strict=True)
            if not isinstance(group, DirectObservations)
        ]
    )
    found = tuple(
        np.zeros(len(group.event), dtype=bool) if isinstance(group, DirectObservations) else next(masks)
        for group in wanted.groups
    )
    return replace(rejected, rejected=found)


def without_priors_of_held(block: Block, observations: Observations) -> Observations:
    """A pseudo-observation goes with its parameter: it would count as redundancy and say nothing."""
    free = {parameters.family.name: parameters.free for parameters in block.system}
    others = []
    for group in observations.others:
        if isinstance(group, DirectObservations) and group.family.name == ADDITIONAL_PARAMETERS:
            group = group.of_free(free[ADDITIONAL_PARAMETERS])
            if not group.stochastic.present.any():
                continue
        others.append(group)
    return Observations(observations.image_points, tuple(others))
