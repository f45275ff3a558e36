"""Whether it can be determined which ray of an object point is wrong.

A misfit of k rays is explained by an error of ray j in so far as T_j = u_jᵀ R_jj⁻ u_j takes it away. The
rays along one strip cross-check each other's y-parallax but not which of them is wrong along the base:
then all T_j are alike, and rejecting the largest would be a guess that leaves the error in the block
two times in three. The orientations are held here: they hardly follow one point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import OBJECT_POINT, State
from adjust.quality.snooping_statistic import directional_statistic, normal_equivalent

#: Advantage in T of the best explanation over the second, 2 ln 20: it is then twenty times as likely.
ADVANTAGE = 6.0


@dataclass(frozen=True, eq=False)
class Explanations:
    """How well an error of each ray of one object point explains its misfit.

    Attributes
    ----------
    ray : (k,) indices of the rays.
    statistic : (k,) T_j.
    equivalent : (k,) the same on the scale of a standard normal variable.
    """

    ray: Ints
    statistic: Floats
    equivalent: Floats

    def likeliest(self, count: int) -> Ints:
        """Indices of the rays whose error would explain the misfit best."""
        return self.ray[np.argsort(-self.statistic, kind="stable")[:count]]

    @property
    def is_located(self) -> bool:
        """Whether one ray explains the misfit clearly better than any other."""
        if len(self.ray) < 2:
            return False
        second, first = np.sort(self.statistic)[-2:]
        return bool(first - second > ADVANTAGE)


def explanations(
    rays: ImagePoints, state: State, points: Ints, surveyed: dict[int, Floats]
) -> dict[int, Explanations]:
    """Explanations of the misfit of some object points by their active rays.

    Parameters
    ----------
    points : (p,) indices.
    surveyed : index of an object point → normal matrix (3, 3) of its survey.
    """
    chosen = np.flatnonzero(np.isin(rays.point, points) & rays.active)
    if len(chosen) == 0:
        return {}
    part = rays.only(chosen)
    equations = part.linearize(state)
    jacobian = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
    whitened = -equations.misclosure * part.inverse_sigma
    rows = jacobian * part.inverse_sigma[:, :, None]
    starts = np.flatnonzero(np.diff(part.point, prepend=-1))
    found = {}
    for first, last in zip(starts, [*starts[1:], len(part.point)], strict=True):
        point = int(part.point[first])
        known = surveyed.get(point, np.zeros((3, 3)))
        found[point] = _explain(chosen[first:last], rows[first:last], whitened[first:last], known)
    return found


def _explain(ray: Ints, rows: Floats, whitened: Floats, known: Floats) -> Explanations:
    """T_j of one object point from its whitened rows (k, 2, 3) and residuals (k, 2)."""
    k = len(ray)
    matrix = rows.reshape(2 * k, 3)
    # A point whose rays are all but parallel has no remainder worth testing: pinv keeps it finite.
    remainder = np.eye(2 * k) - matrix @ np.linalg.pinv(matrix.T @ matrix + known, hermitian=True) @ matrix.T
    misfit = (remainder @ whitened.ravel()).reshape(k, 2)
    own = remainder.reshape(k, 2, k, 2)[np.arange(k), :, np.arange(k), :]
    statistic, dimension = directional_statistic(misfit, own)
    return Explanations(ray, statistic, normal_equivalent(statistic, dimension))
