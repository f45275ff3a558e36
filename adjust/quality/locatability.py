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
from adjust.quality.detectability import UNCONTROLLED
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
    component : (k,) largest |w| of a controlled image coordinate of the ray.
    """

    ray: Ints
    statistic: Floats
    equivalent: Floats
    component: Floats

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
    wanted = np.zeros(len(state.object_point), dtype=bool)
    wanted[points] = True
    chosen = np.flatnonzero(wanted[rays.point] & rays.active)
    if len(chosen) == 0:
        return {}
    part = rays.only(chosen)
    equations = part.linearize(state)
    jacobian = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
    whitened = -equations.misclosure * part.inverse_sigma
    rows = jacobian * part.inverse_sigma[:, :, None]
    starts = np.flatnonzero(np.diff(part.point, prepend=-1))
    point, count = part.point[starts], np.diff(starts, append=len(part.point))
    statistic, component = np.empty(len(chosen)), np.empty(len(chosen))
    dimension = np.empty(len(chosen), dtype=np.int64)
    for k in np.unique(count):
        alike = np.flatnonzero(count == k)
        of_rays = starts[alike, None] + np.arange(k)
        known = np.array([surveyed.get(int(j), np.zeros((3, 3))) for j in point[alike]])
        statistic[of_rays], dimension[of_rays], component[of_rays] = _explain(
            rows[of_rays], whitened[of_rays], known
        )
    equivalent = normal_equivalent(statistic, dimension)
    return {
        int(j): Explanations(chosen[a:b], statistic[a:b], equivalent[a:b], component[a:b])
        for j, a, b in zip(point, starts, starts + count, strict=True)
    }


def _explain(rows: Floats, whitened: Floats, known: Floats) -> tuple[Floats, Ints, Floats]:
    """T_j (p, k), their dimensions, and the largest |w| of p object points with k rays each.

    Parameters
    ----------
    rows, whitened : (p, k, 2, 3) and (p, k, 2), whitened.
    known : (p, 3, 3) normal matrices of surveys.
    """
    p, k = rows.shape[:2]
    matrix = rows.reshape(p, 2 * k, 3)
    transposed = np.swapaxes(matrix, 1, 2)
    # A point whose rays are all but parallel has no remainder worth testing: pinv keeps it finite.
    inverse = np.linalg.pinv(transposed @ matrix + known, hermitian=True)
    remainder = np.eye(2 * k) - matrix @ inverse @ transposed
    misfit = (remainder @ whitened.reshape(p, 2 * k, 1)).reshape(p * k, 2)
    own = remainder.reshape(p, k, 2, k, 2)[:, np.arange(k), :, np.arange(k), :]
    of_rays = np.swapaxes(own, 0, 1).reshape(p * k, 2, 2)
    statistic, dimension = directional_statistic(misfit, of_rays)
    control = np.diagonal(of_rays, axis1=1, axis2=2)
    controlled = control >= UNCONTROLLED
    component = np.where(controlled, np.abs(misfit) / np.sqrt(np.where(controlled, control, 1.0)), 0.0)
    return statistic.reshape(p, k), dimension.reshape(p, k), component.max(axis=1).reshape(p, k)
