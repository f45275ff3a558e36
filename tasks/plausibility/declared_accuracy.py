"""What the declared standard deviations explain: misses of rays and distances of control points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from adjust.arrays import Floats
from tasks.block.given_orientations import GivenOrientations
from tasks.settings.quality import ChecksSettings

# What is expected from the declared sigmas is allowed this many times over before anything is called wrong.
_ALLOWANCE = 10.0
# So many times over, and so many pixels, it is worth looking for a slip.
_SUSPICIOUS = 3.0
_SUSPICIOUS_PX = 5.0
# An intersection is this much worse in height than in plan: a usual ratio of height and base.
_HEIGHT_TO_BASE = 3.0


@dataclass(frozen=True)
class TieLimits:
    """Median residuals of tie points at the intersections from the given orientations, px.

    Attributes
    ----------
    suspicious_px : above it a mistake that explains the residuals is named.
    wrong_px : above it the orientations are called wrong.
    of_image_px : (n,) the same for a single image, with its own standard deviations.
    because : what makes it an error: the stated standard deviations, and the keys they are in.
    """

    suspicious_px: float
    wrong_px: float
    of_image_px: Floats
    because: str = ""


@dataclass(frozen=True)
class ExpectedIntersections:
    """How far intersections with the given orientations may lie from the surveyed points.

    Attributes
    ----------
    sigma_m : standard deviation that the declared ones of positions and attitudes explain, metres.
    limit_m : distance above which a point is called wrong, metres.
    height : flying height above the points, metres.
    common_m : standard deviation of what all of them may have in common: that of a position.
    """

    sigma_m: float
    limit_m: float
    height: float
    common_m: float


def tie_limits(given: GivenOrientations, checks: ChecksSettings, height: float) -> TieLimits:
    """Limits from settings and declared sigmas.

    Parameters
    ----------
    height : flying height above the intersected points, metres. Wrong orientations can make it anything,
        so the distance between neighbouring exposures, which is always smaller, bounds it from below.
    """
    cameras = given.mountings.cameras
    scale = np.array([camera.focal_length / camera.pixel_size for camera in cameras])[given.camera]
    attitude = np.nan_to_num(given.angle_sigma).max(axis=1)
    position = np.nan_to_num(given.position_sigma).max(axis=1) / max(height, _spacing(given), 1.0)
    of_image = scale * np.hypot(attitude, position)
    expected = float(np.median(of_image))
    wrong = max(checks.tie_residual_px, _ALLOWANCE * expected)
    stated = float(np.median(np.nan_to_num(given.position_sigma).max(axis=1)))
    because = (
        f"(ten times what the stated σ of {stated:.3g} m and {np.rad2deg(np.median(attitude)):.3g}° explain, "
        "inputs.exposures.sigma, or checks.tie_residual_px)"
    )
    suspicious = min(max(_SUSPICIOUS_PX, _SUSPICIOUS * expected), wrong)
    return TieLimits(suspicious, wrong, np.maximum(wrong, _ALLOWANCE * of_image), because)


def expected_intersections(
    given: GivenOrientations, checks: ChecksSettings, height: float
) -> ExpectedIntersections:
    """Distances of control points from their intersections.

    Attitudes of σ move an intersection by about h σ in plan and three times that in height; attitudes
    taken from the track are no reason to doubt the control.
    """
    attitude = float(np.median(np.nan_to_num(given.angle_sigma).max(axis=1)))
    position = float(np.median(np.nan_to_num(given.position_sigma).max(axis=1)))
    sigma = _HEIGHT_TO_BASE * (position + height * attitude)
    return ExpectedIntersections(sigma, max(checks.control_distance_m, _ALLOWANCE * sigma), height, position)


def _spacing(given: GivenOrientations) -> float:
    """Median distance of an exposure to the nearest one that is not at the same place, metres."""
    plan = given.observed[:, :2]
    if len(plan) < 2:
        return 0.0
    distance = np.asarray(cKDTree(plan).query(plan, k=min(len(plan), 4))[0])
    apart = np.where(distance[:, 1:] > 1.0, distance[:, 1:], np.inf).min(axis=1)
    return float(np.median(apart)) if np.isfinite(apart).all() else 0.0
