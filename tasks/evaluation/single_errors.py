"""Single observations and given values that may be wrong, as alternatives of the model.

One wrong position looks like a shift of its strip, one wrong control point like a tilt of all, a given
principal point like a lever arm. Beside these alternatives it is the likelier one, and what it explains is
left to nothing else. Nothing rejects a coordinate of a control point that hardly anything controls, whose
error may look like a tilt or scale of all of them: it is an alternative, however small its residual is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy import special

from adjust.block import Block
from adjust.model_tests import SEVERAL, is_restored
from adjust.observations.base import ObservationGroup
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.observations.joint_prior import JointPrior
from adjust.quality.model_alternatives import ObservationAlternative
from adjust.result import GroupResult, ObservationStatus
from tasks.evaluation.alternative import Alternative
from tasks.evaluation.alternative_words import PRIOR
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.quantities import reported_unit

# Of calling any observation of a sound group wrong.
_ERROR_PROBABILITY = 0.005
#: Observations of each group that are tested one by one; more have one cause.
MOST_SINGLE = 10


def single_errors(adjusted: AdjustedBlock) -> tuple[Alternative, ...]:
    """Positions, attitudes, control points and priors with the largest residuals that nothing has rejected.

    Two of a group of few that may have been rejected because of the others are among them, and control points
    with uncontrolled coordinates. Each has an alternative for every component; they are in the axes of the
    observations.
    """
    found = (item for group in adjusted.result.groups[1:] for item in _of_group(adjusted, group))
    return tuple(found)


def _of_group(adjusted: AdjustedBlock, tested: GroupResult) -> Iterator[Alternative]:
    group = tested.group
    named = _named(adjusted, group)
    if named is None:
        return
    weak = tested.status == ObservationStatus.UNCONTROLLED
    weak &= isinstance(group, ControlPoints)
    used = (tested.status == ObservationStatus.USED) | weak
    scale = max(1.0, adjusted.result.test.sigma0)
    w = np.where(used, np.abs(np.nan_to_num(tested.standardized)) / scale, 0.0)
    if is_restored(tested) and tested.rejected < SEVERAL:  # two that may be wrong each by itself
        rejected = tested.status == ObservationStatus.REJECTED
        used, w = used | rejected, np.where(rejected, np.inf, w)
    limit = special.ndtri(1.0 - 0.5 * _ERROR_PROBABILITY / max(int(used.sum()), 1))
    # Each value that is given of a parameter is one by itself; elsewhere all components are wrong, or none.
    alone = w > limit if isinstance(group, DirectObservations | JointPrior) else used
    largest = w.max(axis=1)
    alone = np.where((largest > limit)[:, None], alone, weak)
    worst = np.argsort(-largest, kind="stable")
    for number in worst[alone[worst].any(axis=1)][:MOST_SINGLE].tolist():
        for axis in np.flatnonzero(alone[number]).tolist():
            change = np.zeros(tested.residual.shape)
            change[number, axis] = 1.0
            name, entity, unit, factor = named(number, axis)
            model = ObservationAlternative(group.name, change)
            yield Alternative(name, entity, "all", "", unit, factor, model, limit)


def _named(
    adjusted: AdjustedBlock, group: ObservationGroup
) -> Callable[[int, int], tuple[str, str, str, float]] | None:
    """Quantity, entity, unit and its factor of a component of an observation; None: not tested here."""
    block = adjusted.block
    if isinstance(group, GnssPositions):
        return lambda i, axis: (
            f"gnss_position_{group.components[axis]}",
            block.events[group.event[i]],
            "m",
            1.0,
        )
    if isinstance(group, InsAttitudes):
        degrees = float(np.rad2deg(1.0))
        return lambda i, axis: (
            f"ins_attitude_{group.components[axis]}",
            block.events[group.event[i]],
            "deg",
            degrees,
        )
    if isinstance(group, ControlPoints):
        return lambda i, axis: (
            f"control_point_{group.components[axis]}",
            block.points[group.point[i]],
            "m",
            1.0,
        )
    if isinstance(group, DirectObservations):
        return lambda i, axis: _given(block, group.family.name, int(group.entity[i]), axis)
    if isinstance(group, JointPrior):
        return lambda _, axis: _given(block, *group.places[axis])
    return None


def _given(block: Block, family: str, entity: int, component: int) -> tuple[str, str, str, float]:
    """The same of the given value of a parameter."""
    parameters = next(item for item in block.system if item.family.name == family)
    quantity = parameters.quantity(entity, component)
    return f"{PRIOR}{quantity.name}", quantity.entity, *reported_unit(parameters.family, component)
