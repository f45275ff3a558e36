"""Resection of an image from three object points at a time; the solution on which most others agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import poselib

from adjust.approximate.measured_images import ENOUGH, LIMITS_PX, MeasuredImages, orientation
from adjust.arrays import Bools, Floats, Ints

#: Points that make a resection: three, one that tells their four solutions apart, and two that confirm it.
FEWEST = 6


@dataclass(frozen=True, eq=False)
class Resection:
    """An image oriented in object points.

    Attributes
    ----------
    projection_centre : (3,) metres.  local_from_camera : (3, 3).
    agreeing : (k,) which of the points keep the limit.
    limit_px : the limit.
    """

    projection_centre: Floats
    local_from_camera: Floats
    agreeing: Bools
    limit_px: float

    @property
    def part(self) -> float:
        """Fraction of the points that agree."""
        return float(self.agreeing.mean())


def resect(measured: MeasuredImages, image: int, rows: Ints, object_point: Floats) -> Resection | None:
    """Orient an image in the object points (k, 3) of some of its image points (k,); None if it cannot be.

    Takes the narrowest limit that most points keep.
    """
    if len(rows) < FEWEST:
        return None
    middle, size = object_point.mean(axis=0), max(float(np.ptp(object_point, axis=0).max()), 1e-12)
    found: Resection | None = None
    for limit in LIMITS_PX:
        pose, info = poselib.estimate_absolute_pose(
            measured.pixel[rows],
            (object_point - middle) / size,
            measured.camera(image),
            {"max_reproj_error": limit, "seed": 0, "max_iterations": 2000, "min_iterations": 100},
            {},
        )
        agreeing = np.array(info["inliers"], dtype=bool)
        if agreeing.sum() < FEWEST:
            continue
        centre, rotation = orientation(pose.R, pose.t)
        found = Resection(middle + size * centre, rotation, agreeing, limit)
        if found.part >= ENOUGH:
            return found
    return found if found is not None and 2.0 * found.part >= ENOUGH else None
