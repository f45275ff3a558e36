"""Object points by intersection of rays with given orientations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.compiled import kernel
from adjust.observations.image_point import ImagePoints
from adjust.observations.image_point_kernel import linearize_ray
from adjust.options import available_threads
from adjust.parameters import INTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.covisibility import point_starts
from adjust.solve.lanes import Lane, in_order, lanes
from adjust.solve.reduction_kernel import factorize_point

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
        found: tuple[Floats, Floats, Ints] = _intersected_rays(start[lane[0] : lane[1] + 1], *of_rays)
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


@kernel
def solve_factorized(lower: Floats, rhs: Floats) -> None:
    """Overwrite rhs (3,) with (L Lᵀ)⁻¹ rhs."""
    for k in range(3):
        for q in range(k):
            rhs[k] -= lower[k, q] * rhs[q]
        rhs[k] /= lower[k, k]
    for k in range(2, -1, -1):
        for q in range(k + 1, 3):
            rhs[k] -= lower[q, k] * rhs[q]
        rhs[k] /= lower[k, k]


@kernel
def _intersected_rays(
    point_start: Ints,
    image: Ints,
    camera_of_image: Ints,
    centres: Floats,
    rotations: Floats,
    interior: Floats,
    ideal: Floats,
    inverse_sigma: Floats,
) -> tuple[Floats, Floats, Ints]:
    """Least-squares intersection of the rays of every point.

    Starts from the point nearest to all rays, Σ (I − d dᵀ) X = Σ (I − d dᵀ) X0, and refines it on the
    collinearity equations. Returns points (m, 3), the largest angle between two rays (m,) in radians,
    and a status (m,): 0 intersected, 1 fewer than two rays, 2 rays parallel, 3 behind a camera.
    """
    m = point_start.shape[0] - 1
    points = np.full((m, 3), np.nan)
    angle = np.zeros(m)
    status = np.zeros(m, np.int64)
    most = 1
    for j in range(m):
        most = max(most, point_start[j + 1] - point_start[j])
    directions = np.empty((most, 3))
    normal = np.empty((3, 3))
    rhs = np.empty(3)
    misclosure = np.zeros((1, 2))
    of_exterior = np.zeros((1, 2, 6))
    of_system = np.zeros((1, 2, 3))
    of_point = np.zeros((1, 2, 3))
    no_slope = np.zeros((1, 2, 5))
    no_basis = np.zeros((1, 2, 0))
    # Not a literal, for which linearize_ray would be compiled once more.
    zero = np.int64(0)
    for j in range(m):
        first = point_start[j]
        count = point_start[j + 1] - first
        if count < 2:
            status[j] = 1
            continue
        normal[:, :] = 0.0
        rhs[:] = 0.0
        for a in range(count):
            e = image[first + a]
            inner = interior[camera_of_image[e]]
            x = ideal[first + a, 0] - inner[1]
            y = ideal[first + a, 1] - inner[2]
            length = np.sqrt(x * x + y * y + inner[0] * inner[0])
            for k in range(3):
                directions[a, k] = (
                    rotations[e, k, 0] * x + rotations[e, k, 1] * y - rotations[e, k, 2] * inner[0]
                ) / length
            for k in range(3):
                for q in range(3):
                    part = (1.0 if k == q else 0.0) - directions[a, k] * directions[a, q]
                    normal[k, q] += part
                    rhs[k] += part * centres[e, q]
            for b in range(a):
                cx = directions[a, 1] * directions[b, 2] - directions[a, 2] * directions[b, 1]
                cy = directions[a, 2] * directions[b, 0] - directions[a, 0] * directions[b, 2]
                cz = directions[a, 0] * directions[b, 1] - directions[a, 1] * directions[b, 0]
                sine = np.sqrt(cx * cx + cy * cy + cz * cz)
                angle[j] = max(angle[j], np.arcsin(min(1.0, sine)))
        if angle[j] < 1e-6 or not factorize_point(normal):
            status[j] = 2
            continue
        solve_factorized(normal, rhs)
        for k in range(3):
            points[j, k] = rhs[k]
        for _ in range(_REFINEMENTS):
            normal[:, :] = 0.0
            rhs[:] = 0.0
            front = True
            for i in range(first, first + count):
                if not linearize_ray(
                    i, j, zero, image, camera_of_image, centres, rotations, None, points, interior, ideal,
                    no_slope, no_basis, inverse_sigma, zero, misclosure, of_exterior, of_system, of_point,
                ):  # fmt: skip
                    front = False
                for c in range(2):
                    for k in range(3):
                        rhs[k] += of_point[0, c, k] * misclosure[0, c]
                        for q in range(3):
                            normal[k, q] += of_point[0, c, k] * of_point[0, c, q]
            if not front:
                status[j] = 3
                break
            if not factorize_point(normal):
                status[j] = 2
                break
            solve_factorized(normal, rhs)
            for k in range(3):
                points[j, k] += rhs[k]
            if rhs[0] * rhs[0] + rhs[1] * rhs[1] + rhs[2] * rhs[2] < 1e-16:
                break
    return points, angle, status
