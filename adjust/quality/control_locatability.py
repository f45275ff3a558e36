"""Whether it can be determined which control point is wrong.

With few control points and no positions, the residuals of several are one contradiction: four heights over
the three of a plane have one residual between them. The height that is wrong may be one that hardly anything
controls, and then it is another point whose controlled coordinates stand out. An error of point j explains

    T_j = s_jᵀ M_jj⁻ s_j

of the misclosures, s and M being scores and normal matrix of errors of its coordinates. Point i cannot be
told from it where j explains nearly as much as i, and leaves nothing that i contradicts, T_ij − T_j.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.control_point import ControlPoints
from adjust.quality.locatability import ADVANTAGE
from adjust.quality.model_alternatives import ObservationAlternative, alternative_tests
from adjust.quality.single_error import equations_at, single_errors
from adjust.quality.snooping_statistic import normal_equivalent, of_present

# Eigenvalue of the cofactor of a residual below which a direction says nothing, not even of errors of metres.
_LEAST_CONTROL = 1e-3
# Further points that explain as much are more of the same.
_MOST = 10


@dataclass(frozen=True, eq=False)
class Doubtful:
    """Control points that contradict the block, and cannot be told from each other.

    Attributes
    ----------
    number : of their group among all groups.
    rows : (n,) of the group, those that are not to be rejected.
    points : indices of the object points one of which is wrong.
    size : the largest contradiction of theirs as |w| of a standard normal variable; 0 without any.
    """

    number: int
    rows: Bools
    points: Ints
    size: float


def doubtful_control(
    adjusted: Adjusted, critical_value: float, least: float = 0.0, chosen: tuple[Bools, ...] | None = None
) -> Doubtful | None:
    """Control points from which others cannot be told; None in a block without control points.

    Parameters
    ----------
    least : those are looked at whose errors explain more than that, as |w|, and more than the critical value.
    chosen : for each group (n,) those that are looked at in their place.
    """
    for number, group in enumerate(adjusted.observations.groups):
        if isinstance(group, ControlPoints):
            statistic, dimension = _explained(adjusted, group)
            size = normal_equivalent(statistic, dimension)
            candidates = size > max(critical_value, least) if chosen is None else chosen[number]
            rows, points = _not_located(adjusted, group, statistic, candidates, critical_value)
            return Doubtful(number, rows, points, float(size[rows].max(initial=0.0)))
    return None


def _not_located(
    adjusted: Adjusted, group: ControlPoints, statistic: Floats, candidates: Bools, critical_value: float
) -> tuple[Bools, Ints]:
    """Those of the candidates (n,) from which another point cannot be told, and all object points of both."""
    doubtful = np.zeros(len(candidates), dtype=bool)
    if not candidates.any():
        return doubtful, np.zeros(0, dtype=np.int64)
    suspects = np.flatnonzero(candidates | (statistic >= statistic[candidates].min() - ADVANTAGE))
    rows = np.sort(suspects[np.argsort(-statistic[suspects], kind="stable")[:_MOST]])
    involved = doubtful.copy()
    tests = alternative_tests(
        adjusted.system, adjusted.solution, [_error_of(group, row, axis) for row in rows for axis in range(3)]
    )
    axes = {int(row): range(3 * k, 3 * k + 3) for k, row in enumerate(rows)}
    alone = {row: tests.together(own)[0] for row, own in axes.items()}
    for row in rows[candidates[rows]].tolist():
        for other in axes:
            both = tests.together([*axes[row], *axes[other]])[0]
            nearly = alone[row] - alone[other] <= ADVANTAGE
            if other != row and nearly and both - alone[other] <= critical_value**2:
                doubtful[row] = True
                involved[[row, other]] = True
    return doubtful, np.unique(group.point[involved])


def _explained(adjusted: Adjusted, group: ControlPoints) -> tuple[Floats, Ints]:
    """What an error of each point explains (n,), also along what hardly anything controls; its dimension."""
    equations = equations_at(group, adjusted.state, adjusted.solution.linearization)
    found = single_errors(group, equations, adjusted.system.layout, adjusted.quality)
    values, vectors = np.linalg.eigh(of_present(group.stochastic, found.inside + found.considered))
    told = values > _LEAST_CONTROL
    along = np.einsum("nij,ni->nj", vectors, np.nan_to_num(found.pull))
    return np.sum(np.where(told, along**2 / np.where(told, values, 1.0), 0.0), axis=1), told.sum(axis=1)


def _error_of(group: ControlPoints, row: int, axis: int) -> ObservationAlternative:
    """An error of one coordinate; none where it is not used."""
    change = np.zeros(group.stochastic.present.shape)
    change[row, axis] = group.stochastic.present[row, axis]
    return ObservationAlternative(group.name, change)
