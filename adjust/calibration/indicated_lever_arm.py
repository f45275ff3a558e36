"""Lever arms indicated by the positions, where the adjustment held them fixed or used approximate ones.

A lever arm with wrong signs is a residual of −2 l in body axes that turns with the aircraft, but it cannot
be read from the residuals: the block gives way to the positions by as much as they weigh, and rejects them
where gross errors are looked for. So lever arm and GNSS shift are freed together, around the adjusted block,
and solved for in one step; the equations are linear in both. Forward and reverse strips tell the lever arm
from the shift in plan; in height only a shift that is known to be small does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.block import Block
from adjust.errors import AdjustmentError
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.joint_prior import JointPrior
from adjust.one_thread import one_thread
from adjust.parameters import FAMILIES, GNSS_SHIFT, LEVER_ARM
from adjust.result import AdjustmentResult, GroupResult, ObservationStatus
from adjust.selection.linear_estimate import ParameterNormals
from adjust.selection.parameter_normals import normals_at
from adjust.solve.system import Observations, System

#: A shift that nobody has spoken of may still be so large, metres: what datums and base stations differ by.
UNSTATED_SHIFT = 0.20
# What is not determined keeps its given value with this standard deviation, metres.
_UNDETERMINED = 100.0
# If more than this part of the positions was rejected, it is not they that are wrong.
_MOST_REJECTED = 0.10


@dataclass(frozen=True, eq=False)
class IndicatedLeverArms:
    """Lever arms of c cameras as indicated by the positions.

    Attributes
    ----------
    value : (c, 3) forward, right, down, metres.
    sigma : (c, 3) their standard deviations for the given weights, at least; metres, large where a component
        cannot be separated from the shift.
    """

    value: Floats
    sigma: Floats


def indicated_lever_arms(
    block: Block, result: AdjustmentResult, *, shift_is_small: bool = False
) -> IndicatedLeverArms | None:
    """Lever arms of the cameras of an adjusted block if they and the GNSS shift had been free.

    None without GNSS positions, and where the datum is that of a free network.

    Parameters
    ----------
    shift_is_small : whether a shift that the adjustment has left free is taken to be as small as one that it
        holds; it may be what the wrong sign of a lever arm looks like.
    """
    positions = next((item for item in result.groups if isinstance(item.group, GnssPositions)), None)
    if positions is None or result.free_network is not None:
        return None
    freed, held = _freed(block)
    system_parameters = {item.family.name: item for item in freed.system}
    rays, *others = (_taking_part(item) for item in result.groups)
    others = [_of_others(item) for item in others if not _is_prior_of(item, LEVER_ARM)]
    shift = system_parameters[GNSS_SHIFT]
    if shift_is_small:
        held = np.ones_like(held)
        others = [item for item in others if not _is_prior_of(item, GNSS_SHIFT)]
    sigma = np.where(held, UNSTATED_SHIFT, np.nan)
    if held.any():
        entities = np.arange(len(shift.entities), dtype=np.int64)
        model = StochasticModel.from_sigma(sigma)
        others.append(DirectObservations(FAMILIES[GNSS_SHIFT], entities, shift.values, model))
    with one_thread():
        try:
            system = System.of(freed, Observations(rays, tuple(others)))  # type: ignore[arg-type]
            normals = normals_at(system, result.state)
        except AdjustmentError:
            return None
    columns = freed.layout.columns[LEVER_ARM].ravel()
    normal = normals.normal.copy()
    normal[columns, columns] += _UNDETERMINED**-2
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(normal), np.finfo(float).tiny))
    try:
        cofactor = np.linalg.inv(normal * scale[:, None] * scale) * scale[:, None] * scale
    except np.linalg.LinAlgError:
        return None
    variance = np.diagonal(cofactor)[columns]
    if not (np.isfinite(cofactor).all() and (variance > 0.0).all()):
        return None
    given = system_parameters[LEVER_ARM].values
    change = cofactor @ normals.rhs
    sigma0 = _sigma0(normals, change)
    return IndicatedLeverArms(
        given + change[columns].reshape(given.shape), sigma0 * np.sqrt(variance).reshape(given.shape)
    )


def _sigma0(normals: ParameterNormals, change: Floats) -> float:
    """σ0 with all parameters free, at least 1: that of the adjustment suffers from the wrong lever arm."""
    squares = normals.weighted_squares + float(normals.prior_squares.sum()) - float(normals.rhs @ change)
    redundancy = normals.redundancy - len(change) + int(normals.has_prior.sum())
    return float(np.sqrt(max(squares / redundancy, 1.0))) if redundancy > 0 else 1.0


def _freed(block: Block) -> tuple[Block, Bools]:
    """The block with lever arms and shifts free, and which components (f, 3) of the shifts were held."""
    system, held = [], np.zeros((0, 3), dtype=bool)
    for item in block.system:
        if item.family.name == GNSS_SHIFT:
            held = ~item.free
        free = item.family.name in (GNSS_SHIFT, LEVER_ARM)
        system.append(replace(item, free=np.ones_like(item.free)) if free else item)
    # Of the errors of a considered lever arm nothing is left when it is free.
    return replace(block, system=tuple(system), considered=None), held


def _is_prior_of(group: ObservationGroup, family: str) -> bool:
    return isinstance(group, DirectObservations) and group.family.name == family


def _of_others(group: ObservationGroup) -> ObservationGroup:
    """A prior of several families without what it says of the lever arm."""
    return group.without_family(LEVER_ARM) if isinstance(group, JointPrior) else group


def _taking_part(item: GroupResult) -> ObservationGroup:
    """The observations that were used; positions also if they were rejected by the dozen."""
    status = item.status
    left_out = np.isin(status, (ObservationStatus.REJECTED, ObservationStatus.NOT_USED)).all(axis=1)
    if isinstance(item.group, GnssPositions) and item.rejected > _MOST_REJECTED * len(status):
        return item.group
    return item.group.without(np.asarray(left_out))
