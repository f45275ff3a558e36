"""How far the rays of tie points miss each other with given orientations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.intersection import Intersection, intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import GivenOrientations

# Rays used to try slips: enough for a median, few enough to be instant.
_TRIAL_POINTS = 3000


@dataclass(frozen=True, eq=False)
class RayResiduals:
    """How far the rays of tie points miss each other with given orientations.

    Attributes
    ----------
    residual_px : (n, 2) column, row; NaN where the point could not be intersected.
    median_px : median length over all image points; infinite if most could not be intersected.
    """

    residual_px: Floats
    median_px: float


def ray_residuals(
    rays: ImagePoints,
    state: State,
    points: int,
    pixel_size: Floats,
    intersection: Intersection | None = None,
) -> RayResiduals:
    """Residuals at the intersections of the rays of ``points`` object points.

    Parameters
    ----------
    pixel_size : (images,) metres.
    intersection : of these rays; None: they are still to be intersected.
    """
    if intersection is None:
        intersection = intersect(rays, state, points)
    misclosure = rays.misclosure(replace(state, object_point=intersection.object_point))
    misclosure[~intersection.usable[rays.point]] = np.nan
    residual_px = -misclosure / pixel_size[rays.image][:, None] * np.array([1.0, -1.0])
    length = np.hypot(residual_px[:, 0], residual_px[:, 1])
    several = np.bincount(rays.point, minlength=points)[rays.point] >= 2
    length = np.where(np.isfinite(length), length, np.inf)[several]
    return RayResiduals(residual_px, float(np.median(length)) if len(length) else 0.0)


def worst_camera(given: GivenOrientations, rays: ImagePoints, residual_px: Floats) -> float:
    """Largest median residual of the cameras, px: one of several may be wrong and the median not show it."""
    length = np.hypot(residual_px[:, 0], residual_px[:, 1])
    length = np.where(np.isfinite(length), length, np.inf)
    camera = given.camera[rays.image]
    several = np.bincount(rays.point)[rays.point] >= 2
    medians = [np.median(length[several & (camera == number)]) for number in np.unique(camera[several])]
    return float(max(medians, default=0.0))


def sample_of_rays(rays: ImagePoints, points: int) -> ImagePoints:
    """Rays of a limited number of points, those with most rays first, renumbered."""
    count = np.bincount(rays.point, minlength=points)
    chosen = np.sort(np.argsort(-count, kind="stable")[:_TRIAL_POINTS])
    number = np.full(points, -1, dtype=np.int64)
    number[chosen] = np.arange(len(chosen))
    return renumbered(rays, number[rays.point] >= 0, number)


def renumbered(rays: ImagePoints, kept: Bools, number: Ints) -> ImagePoints:
    """Some of the rays (n,), of points that have other numbers (points,)."""
    return rays.only(np.flatnonzero(kept), number[rays.point[kept]])


def flying_height(state: State, intersection: Intersection) -> float:
    """Median flying height above the intersected points, metres; 0 if none was intersected."""
    usable = intersection.usable
    if not usable.any():
        return 0.0
    height = np.median(state.projection_centre[:, 2]) - np.median(intersection.object_point[usable, 2])
    return float(max(height, 0.0))
