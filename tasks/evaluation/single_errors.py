"""Single observations that may be wrong, as alternatives of the model.

One wrong position looks like a shift of its strip, one wrong control point like a tilt of all. Beside these
alternatives it is the likelier one, and what it explains is left to nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import special

from adjust.observations.base import ObservationGroup
from adjust.observations.control_point import ControlPoints
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.quality.model_alternatives import ObservationAlternative
from adjust.result import GroupResult, ObservationStatus
from tasks.evaluation.alternative import Alternative
from tasks.evaluation.result_tables import AdjustedBlock

# Of calling any observation of a sound group wrong.
_ERROR_PROBABILITY = 0.005
#: Observations of each group that are tested one by one; more have one cause.
MOST_SINGLE = 10


def single_errors(adjusted: AdjustedBlock) -> tuple[Alternative, ...]:
    """The positions, attitudes and control points with the largest residuals that nothing has rejected.

    Each has an alternative for every component; they are in the axes of the observations.
    """
    found = (item for group in adjusted.result.groups[1:] for item in _of_group(adjusted, group))
    return tuple(found)


def _of_group(adjusted: AdjustedBlock, tested: GroupResult) -> Iterator[Alternative]:
    group = tested.group
    named = _named(adjusted, group)
    if named is None:
        return
    kind, entities = named
    used = tested.status == ObservationStatus.USED
    scale = max(1.0, adjusted.result.test.sigma0)
    w = np.where(used, np.abs(np.nan_to_num(tested.standardized)) / scale, 0.0).max(axis=1)
    limit = special.ndtri(1.0 - 0.5 * _ERROR_PROBABILITY / max(int(used.sum()), 1))
    worst = np.argsort(-w, kind="stable")[:MOST_SINGLE]
    for number in worst[w[worst] > limit].tolist():
        for axis in np.flatnonzero(used[number]).tolist():
            change = np.zeros(tested.residual.shape)
            change[number, axis] = 1.0
            name = group.components[axis]
            factor, unit = (float(np.rad2deg(1.0)), "deg") if group.unit == "rad" else (1.0, "m")
            model = ObservationAlternative(group.name, change)
            yield Alternative(f"{kind}_{name}", entities[number], "all", "", unit, factor, model, limit)


def _named(adjusted: AdjustedBlock, group: ObservationGroup) -> tuple[str, list[str]] | None:
    """What an observation of a group is called, and the event or point of each; None: not tested here."""
    if isinstance(group, GnssPositions):
        return "gnss_position", [adjusted.block.events[event] for event in group.event]
    if isinstance(group, InsAttitudes):
        return "ins_attitude", [adjusted.block.events[event] for event in group.event]
    if isinstance(group, ControlPoints):
        return "control_point", [adjusted.block.points[point] for point in group.point]
    return None
