"""Relative orientation of two images, with the second solution that a plane object has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import poselib
from scipy import sparse

from adjust.approximate.intersection import intersect
from adjust.approximate.measured_images import (
    ENOUGH,
    LIMITS_PX,
    SOLVER_FROM_CAMERA,
    MeasuredImages,
    orientation,
)
from adjust.arrays import Bools, Floats, Ints

#: Common points of a pair: five, and three that confirm it.
FEWEST = 8
#: From this angle between the rays on, a wider one is no better for a start.
_WIDE = np.deg2rad(15.0)
# Below this one the depth says nothing.
_NARROW = np.deg2rad(1.0)
# An object is taken for plane if a homography suits so large a part of what a relative orientation suits.
_PLANE = 0.8
# Pairs with the most common points that are checked.
_CANDIDATES = 40
# Fits of a rotation to the rays of a pair, each to those that the one before brought together best.
_ROTATIONS = 4


@dataclass(frozen=True, eq=False)
class PairModel:
    """Two images oriented to each other: the first at the origin with the axes of its camera.

    Attributes
    ----------
    images : the two.
    projection_centre : (3,) of the second, of length 1.  rotation : (3, 3) first camera from second camera.
    worth : agreeing points, less where their rays meet under small angles.
    """

    images: tuple[int, int]
    projection_centre: Floats
    rotation: Floats
    worth: float


def pairs_by_common_points(measured: MeasuredImages, of_one: Bools, of_other: Bools) -> Ints:
    """Pairs (k, 2) of one of these images (n,) and another of those (n,), with the most common points first.

    No image is in more than a few of them, so that one place does not stand for the whole block. Pairs taken
    at one place, as heads of one body do, have the most common points and give no model: they come last.
    """
    rays = measured.rays
    kept = (of_one | of_other)[rays.image] & rays.active
    seen = sparse.csr_array(
        (np.ones(int(kept.sum()), dtype=np.int64), (rays.image[kept], rays.point[kept])),
        shape=(measured.images, measured.points),
    )
    common = sparse.coo_array(sparse.triu(seen @ seen.T, k=1))
    enough = common.data >= FEWEST
    one, other, count = common.row[enough], common.col[enough], common.data[enough]
    paired = (of_one[one] & of_other[other]) | (of_one[other] & of_other[one])
    one, other, count = one[paired], other[paired], count[paired]
    chosen, of_one_place = list[tuple[int, int]](), list[tuple[int, int]]()
    used = np.zeros(measured.images, dtype=np.int64)
    for k in np.lexsort((other, one, -count)):
        pair = int(one[k]), int(other[k])
        if max(used[list(pair)]) >= 6:
            continue
        if _at_one_place(measured, *pair):
            of_one_place.append(pair)
            continue
        chosen.append(pair)
        used[list(pair)] += 1
        if len(chosen) == _CANDIDATES:
            break
    pairs = [*chosen, *of_one_place][:_CANDIDATES]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _at_one_place(measured: MeasuredImages, one: int, other: int) -> bool:
    """Whether a rotation alone brings most of the common rays of two images together."""
    rows = _common(measured, one, other)
    u, v = (
        np.column_stack([measured.pixel[k], np.full(len(k), measured.focal_px(image))])
        for k, image in zip(rows, (one, other), strict=True)
    )
    u, v = (rays / np.linalg.norm(rays, axis=1, keepdims=True) for rays in (u, v))
    near = np.ones(len(u), dtype=bool)
    missed = np.zeros(len(u))
    for _ in range(_ROTATIONS):
        left, _, right = np.linalg.svd(v[near].T @ u[near])
        turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
        missed = np.linalg.norm(v - u @ turn.T, axis=1) * measured.focal_px(other)
        near = missed <= np.quantile(missed, ENOUGH)
    return bool(np.mean(missed <= LIMITS_PX[1]) >= ENOUGH)


def _common(measured: MeasuredImages, one: int, other: int) -> tuple[Ints, Ints]:
    """Rows (k,) of the image points of both images that they have in common."""
    point, (first, second) = measured.rays.point, (measured.rows_of_image[i] for i in (one, other))
    _, k, q = np.intersect1d(point[first], point[second], return_indices=True)
    return first[k], second[q]


def pair_models(measured: MeasuredImages, one: int, other: int) -> Iterator[PairModel]:
    """The relative orientations that the common points of two images allow, most likely first."""
    first, second = _common(measured, one, other)
    solutions, limit = _solutions(measured, (one, other), measured.pixel[first], measured.pixel[second])
    for rotation, shift in solutions:
        centre, turned = orientation(rotation, shift / np.linalg.norm(shift))
        # The solvers put the first camera at the origin in their axes; ours are those of the camera itself.
        model = (SOLVER_FROM_CAMERA @ centre, SOLVER_FROM_CAMERA @ turned)
        worth = _worth(measured, (first, second), (one, other), model, limit)
        if worth > 0.0:
            yield PairModel((one, other), *model, worth)


def _solutions(
    measured: MeasuredImages, images: tuple[int, int], x: Floats, y: Floats
) -> tuple[list[tuple[Floats, Floats]], float]:
    """R, t of the solvers, and the narrowest limit that most points keep, px."""
    cameras = [measured.camera(image) for image in images]
    focal = [measured.focal_px(image) for image in images]
    options = {"seed": 0, "max_iterations": 2000, "min_iterations": 200}
    result, limit, agreeing = list[tuple[Floats, Floats]](), LIMITS_PX[-1], 0
    for limit in LIMITS_PX:
        pose, info = poselib.estimate_relative_pose(
            x, y, *cameras, {"max_epipolar_error": limit, **options}, {}
        )
        agreeing = int(np.sum(info["inliers"]))
        if agreeing >= max(FEWEST, ENOUGH * len(x)):
            result = [(pose.R, pose.t)]
            break
    if not result:
        return [], limit
    homography, info = poselib.estimate_homography(
        x / focal[0] * focal[1], y, {"max_reproj_error": 2.0 * limit, **options}, {}
    )
    if np.sum(info["inliers"]) >= _PLANE * agreeing:
        scale = np.diag([1.0, 1.0, focal[1]])
        poses, _ = poselib.motion_from_homography(scale @ homography @ np.linalg.inv(scale))
        result += [(pose.R, pose.t) for pose in poses if np.linalg.norm(pose.t) > 1e-9]
    return result, limit


def _worth(
    measured: MeasuredImages,
    rows: tuple[Ints, Ints],
    images: tuple[int, int],
    model: tuple[Floats, Floats],
    limit: float,
) -> float:
    """Agreeing points in front of both, times the angle between their rays up to a wide one."""
    both = np.sort(np.concatenate(rows))
    both = both[np.argsort(measured.rays.point[both], kind="stable")]
    centre = np.zeros((measured.images, 3))
    local_from_camera = np.broadcast_to(np.eye(3), (measured.images, 3, 3)).copy()
    centre[images[1]], local_from_camera[images[1]] = model
    part = MeasuredImages(measured.rays.only(both), measured.cameras, measured.points)
    state = part.state(centre, local_from_camera, np.zeros((measured.points, 3)))
    found = intersect(part.rays, state, measured.points)
    missed = part.residual_px(part.state(centre, local_from_camera, np.nan_to_num(found.object_point)))
    good = np.zeros(measured.points, dtype=bool)
    good[part.rays.point] = found.usable[part.rays.point]
    good[part.rays.point[missed > 2.0 * limit]] = False
    good &= found.angle > _NARROW
    if good.sum() < FEWEST:
        return 0.0
    return float(good.sum() * min(float(np.median(found.angle[good])) / _WIDE, 1.0))
