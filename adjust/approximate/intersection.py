"""Object points by intersection of rays with given orientations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from adjust.approximate import intersection_kernel
from adjust.arrays import Bools, Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.options import available_threads
from adjust.parameters import INTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.covisibility import point_starts
from adjust.solve.lanes import Lane, in_order, lanes

_REFINEMENTS = 8
_SETTLED = 1e-8  # metres


class IntersectionStatus(IntEnum):
    """Outcome of the intersection of one object point."""

    INTERSECTED = 0
    FEWER_THAN_TWO_RAYS = 1
    PARALLEL_RAYS = 2
    BEHIND_A_CAMERA = 3


@dataclass(frozen=True, eq=False)
class Intersection:
    """Object points intersected from given orientations.

    Attributes
    ----------
    object_point : (m, 3) metres, local frame; not usable where the status is not INTERSECTED.
    angle : (m,) largest angle between two rays of the point, radians.
    status : (m,) values of :class:`IntersectionStatus`.
    """

    object_point: Floats
    angle: Floats
    status: Ints

    @property
    def usable(self) -> Bools:
        """(m,) whether the point was intersected."""
        return np.equal(self.status, IntersectionStatus.INTERSECTED)


def intersect(image_points: ImagePoints, state: State, points: int) -> Intersection:
    """Intersect the rays of ``points`` object points with the orientations of a state.

    Least squares on the collinearity equations with the weights of the image points; the object
    points of the state are not used.
    """
    rays, start = image_points, point_starts(image_points.point, points)
    of_rays = (
        rays.image,
        rays.camera_of_image,
        state.pictures.projection_centre,
        state.pictures.local_from_camera,
        state.system[INTERIOR_ORIENTATION],
        rays.straight(state, np.zeros(0, dtype=np.int64)).xy,
        rays.inverse_sigma,
    )

    def work(lane: Lane) -> tuple[Floats, Floats, Ints]:
        found: tuple[Floats, Floats, Ints] = intersection_kernel.intersect(
            start[lane[0] : lane[1] + 1], *of_rays
        )
        return found

    parts = zip(*in_order(work, lanes(start), available_threads()), strict=True)
    found = Intersection(*map(np.concatenate, parts))
    if rays.self_calibration is None or rays.self_calibration.forward is None:
        return found
    # The kernel weighs ideal points, which a distortion has moved apart or together.
    return replace(found, object_point=_refined(rays, state, found))


def _refined(rays: ImagePoints, state: State, found: Intersection) -> Floats:
    """Object points (m, 3) with the least squares of the residuals in the distorted image."""
    points, rows = found.object_point.copy(), np.flatnonzero(found.usable[rays.point])
    usable = rays.only(rows)
    weight = usable.inverse_sigma
    for _ in range(_REFINEMENTS):
        equations = usable.linearize(replace(state, object_point=points))
        of_point = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
        weighted = np.swapaxes(of_point * weight[:, :, None] ** 2, 1, 2)
        normal, right = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
        np.add.at(normal, usable.point, weighted @ of_point)
        np.add.at(right, usable.point, np.einsum("rij,rj->ri", weighted, equations.misclosure))
        step = np.linalg.solve(normal[found.usable], right[found.usable][:, :, None])[:, :, 0]
        points[found.usable] += step
        if np.abs(step).max(initial=0.0) < _SETTLED:
            break
    return points
