"""The rough misalignment of camera and INS, from tie or control points, that a first calibration starts from.

A camera is mounted some tenths of a degree, up to two degrees, off the axes of the INS, which nobody knows
before the first calibration. Rays of tie points then miss each other by hundreds of pixels wherever images of
different headings, heights or strips meet. What minimises these misses is good enough to begin with. In
strips of one direction a roll moves all intersections alike, by 70 m for 0.67° at 6,000 m; there only control
points show it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import GivenOrientations
from tasks.plausibility.declared_accuracy import TieLimits
from tasks.plausibility.orientations import best_slips
from tasks.plausibility.ray_residuals import ray_residuals, sample_of_rays

#: Larger than this, radians, it is not a misalignment any more but a slip.
LARGEST = np.deg2rad(3.0)
# It must leave this part of the residuals at most.
_LEFT = 0.3
_MOST_TRIALS = 30
# A mistake that leaves no more than this many times as much explains it as well.
_AS_WELL = 1.5


@dataclass(frozen=True, eq=False)
class Misalignment:
    """What the tie points indicate.

    Attributes
    ----------
    given : the orientations with it.
    angles : (c, 3) roll, pitch, yaw of every camera in addition to the given boresight, radians.
    control_m : how far surveyed points were from their intersections, if they show it; 0: tie points do.
    """

    given: GivenOrientations
    angles: Floats
    control_m: float = 0.0

    @property
    def sentence(self) -> str:
        """The result as a sentence."""
        found = "; ".join(
            f"camera {name} roll {roll:+z.2f}°, pitch {pitch:+z.2f}°, yaw {yaw:+z.2f}°"
            for name, (roll, pitch, yaw) in zip(
                self.given.mountings.names, np.rad2deg(self.angles), strict=True
            )
        )
        shown, otherwise = "tie points", ""
        if self.control_m:
            shown = "control points"
            otherwise = (
                f" Tie points do not show it here: otherwise the coordinates are {self.control_m:.0f} m off."
            )
        return (
            f"The {shown} show a misalignment of camera and INS: {found} relative to the given "
            "boresight. The adjustment uses it as initial value; declare it as boresight_deg"
            f"{', of heads as rotation_deg,' if self.given.mountings.has_heads else ''} if it is known."
            f"{otherwise}"
        )


def misalignment(
    given: GivenOrientations, rays: ImagePoints, state: State, points: int, limits: TieLimits
) -> Misalignment | None:
    """The misalignment that explains how far rays miss each other; None if none does, or a mistake does too.

    Parameters
    ----------
    state : with the given orientations.
    limits : above which an explanation is looked for at all.
    """
    pixel_size = given.pixel_size
    now_px = ray_residuals(rays, state, points, pixel_size).median_px
    if now_px <= limits.suspicious_px:
        return None
    sample = sample_of_rays(rays, points)
    several = int(sample.point.max()) + 1
    cameras = len(given.mountings.cameras)
    # Robust against mismatches, and blunt where the rays do not meet at all.
    blunt = float(np.clip(now_px, 1.0, 1e4)) if np.isfinite(now_px) else 1e4

    def residuals(angles: Floats) -> Floats:
        trial = _turned(given, angles.reshape(cameras, 3))
        return ray_residuals(sample, _state_of(state, trial), several, pixel_size).residual_px

    angles = fitted(residuals, 3 * cameras, blunt).reshape(cameras, 3)
    turned = _turned(given, angles)
    left = ray_residuals(rays, _state_of(state, turned), points, pixel_size).median_px
    if np.abs(angles).max() > LARGEST or left > _LEFT * now_px:
        return None
    slips, of_slip = best_slips(given, sample, state, now_px)
    if len(slips) == 1 and of_slip <= _AS_WELL * left:
        return None
    return Misalignment(turned, angles)


def misalignment_by_control(
    given: GivenOrientations,
    rays: ImagePoints,
    state: State,
    place: Floats,
    limits: TieLimits,
    limit_m: float,
) -> Misalignment | None:
    """The misalignment that explains how far surveyed points are from the intersections; None if none does.

    Parameters
    ----------
    state : with the given orientations.
    place : (points, 3) surveyed positions of the object points, metres, local frame; NaN where there is none.
    limits : what tie points may miss each other by with it.
    limit_m : distance above which an explanation is looked for.
    """
    surveyed = np.flatnonzero(np.isfinite(place).all(axis=1))
    number = np.full(len(place), -1, dtype=np.int64)
    number[surveyed] = np.arange(len(surveyed))
    own = rays.only(np.flatnonzero(number[rays.point] >= 0))
    own = replace(own, point=number[own.point])

    def differences(trial: GivenOrientations) -> Floats:
        found = intersect(own, _state_of(state, trial), len(surveyed))
        return np.where(found.usable[:, None], found.object_point - place[surveyed], np.nan)

    now = np.linalg.norm(differences(given), axis=1)
    if not (now > limit_m).any():
        return None
    typical = float(np.nanmedian(now))
    cameras = len(given.mountings.cameras)

    def residuals(angles: Floats) -> Floats:
        return differences(_turned(given, angles.reshape(cameras, 3))) / typical

    # One wrong point among many must not turn the others.
    angles = fitted(residuals, 3 * cameras, 1.0).reshape(cameras, 3)
    turned = _turned(given, angles)
    left = float(np.nanmedian(np.linalg.norm(differences(turned), axis=1)))
    misses = ray_residuals(rays, _state_of(state, turned), len(place), given.pixel_size).median_px
    if np.abs(angles).max() > LARGEST or left > _LEFT * typical or misses > limits.suspicious_px:
        return None
    return Misalignment(turned, angles, typical)


def fitted(residuals: Callable[[Floats], Floats], unknowns: int, blunt: float, unit: float = 1e-3) -> Floats:
    """The unknowns, zero at first, that make residuals least, whatever single ones say.

    Parameters
    ----------
    blunt : residuals of ten times as much count no more, and NaN as those.
    unit : of the unknowns: what changes the residuals notably.
    """
    # Loaded late: few blocks need it, and it takes a tenth of a second.
    from scipy.optimize import least_squares

    def blunted(values: Floats) -> Floats:
        found = np.nan_to_num(residuals(values), nan=10.0 * blunt)
        return np.clip(found, -10.0 * blunt, 10.0 * blunt).ravel()

    found = least_squares(
        blunted, np.zeros(unknowns), loss="soft_l1", f_scale=0.1 * blunt, x_scale=unit, max_nfev=_MOST_TRIALS
    )
    return np.asarray(found.x)


def _turned(given: GivenOrientations, angles: Floats) -> GivenOrientations:
    """Orientations whose boresight is the given one and small angles (c, 3) more."""
    return given.turned(given.mountings.boresight + angles)


def _state_of(state: State, given: GivenOrientations) -> State:
    centre, local_from_camera = given.orientations()
    return replace(state, projection_centre=centre, local_from_camera=local_from_camera)
