"""How far the rays of tie points miss each other with given orientations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.intersection import Intersection, intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State

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


def sample_of_rays(rays: ImagePoints, points: int) -> ImagePoints:
    """Rays of a limited number of points, those with most rays first, renumbered."""
    count = np.bincount(rays.point, minlength=points)
    chosen = np.sort(np.argsort(-count, kind="stable")[:_TRIAL_POINTS])
    number = np.full(points, -1, dtype=np.int64)
    number[chosen] = np.arange(len(chosen))
    return subset(rays, number[rays.point] >= 0, number)


def subset(rays: ImagePoints, kept: Bools, number: Ints) -> ImagePoints:
    """Some of the rays (n,), their object points renumbered: `number` (points,) is the new one of each."""
    return ImagePoints(
        rays.image[kept],
        number[rays.point[kept]],
        rays.camera_of_image,
        rays.xy[kept],
        rays.sigma[kept],
        rays.active[kept],
    )
