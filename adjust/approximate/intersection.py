"""Object points by intersection of rays with given orientations."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from adjust.approximate import intersection_kernel
from adjust.arrays import Bools, Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION, State
from adjust.solve.covisibility import point_starts


class IntersectionStatus(IntEnum):
    """What became of the intersection of one object point."""

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

    Least squares on the collinearity equations of the ideal image points with the weights of the measured
    ones; the object points of the state are not used.
    """
    rays = image_points
    object_point, angle, status = intersection_kernel.intersect(
        point_starts(rays.point, points),
        rays.image,
        rays.camera_of_image,
        state.projection_centre,
        state.local_from_camera,
        state.system[INTERIOR_ORIENTATION],
        rays.straight(state, np.zeros(0, dtype=np.int64)).xy,
        rays.inverse_sigma,
    )
    return Intersection(object_point, angle, status)
