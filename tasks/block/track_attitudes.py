"""Approximate attitudes where there is no INS: level flight along the strip.

The heading is the direction from exposure to exposure, in the order of time, or of the image names
where there is no time. Names may count against the flight; of the two directions the one is taken
with which the rays of the strip's points meet in front of the cameras.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats, Ints
from tasks.block.block_input import block_of, image_point_observations
from tasks.block.given_orientations import GivenOrientations
from tasks.coordinates.local_frame import AdjustmentFrame
from tasks.settings.adjustment import AdjustmentSettings

# What level flight along the track is good for: crab angle and tilts.
_SIGMA = float(np.deg2rad(5.0))
# Points that decide about the direction of a strip.
_TRIAL_POINTS = 500


def with_track_attitudes(
    given: GivenOrientations, frame: AdjustmentFrame, measured: pd.DataFrame
) -> GivenOrientations:
    """The orientations, with attitudes from the track for exposures that have none.

    Exposures that are alone in their strip keep none. ``attitude_observed`` stays false for all of them.
    """
    missing = ~given.has_attitude
    if not missing.any():
        return given
    headings = _track_headings(given)
    fill = missing & np.isfinite(headings)
    completed = _filled(given, fill, headings)
    for strip in np.unique(given.strip_of_image[fill]):
        own = fill & (given.strip_of_image == strip)
        if np.isfinite(given.time_s[own]).all():
            continue
        reversed_headings = np.where(own, headings + np.pi, headings)
        turned = _filled(given, fill, reversed_headings)
        if _in_front(turned, frame, measured, own) > _in_front(completed, frame, measured, own):
            completed, headings = turned, reversed_headings
    return completed


def _track_headings(given: GivenOrientations) -> Floats:
    """Heading (n,) of the track, radians from true north; NaN for an exposure alone in its strip."""
    headings = np.full(len(given.image), np.nan)
    for strip in np.unique(given.strip_of_image):
        index = np.flatnonzero(given.strip_of_image == strip)
        if len(index) < 2:
            continue
        if np.isfinite(given.time_s[index]).all():
            index = index[np.argsort(given.time_s[index], kind="stable")]
        along = np.gradient(given.observed[index], axis=0)
        enu = np.einsum("nji,nj->ni", given.local_from_enu[index], along)
        headings[index] = np.arctan2(enu[:, 0], enu[:, 1])
    return headings


def _filled(given: GivenOrientations, fill: np.ndarray, headings: Floats) -> GivenOrientations:
    """Level attitudes with the given headings where ``fill`` is true."""
    level = np.stack([headings, np.zeros_like(headings), np.zeros_like(headings)], axis=1)
    return replace(
        given,
        angles=np.where(fill[:, None], level, given.angles),
        angle_sigma=np.where(fill[:, None], _SIGMA, given.angle_sigma),
        is_heading=given.is_heading | fill,
    )


def _in_front(
    given: GivenOrientations, frame: AdjustmentFrame, measured: pd.DataFrame, own: np.ndarray
) -> int:
    """Number of points of the own images that intersect in front of their cameras."""
    strip = given.only(own)
    inside = measured[measured["image"].isin(strip.image)]
    count = inside["point"].value_counts()
    names = tuple(sorted(count.index[count >= 2]))[:_TRIAL_POINTS]
    if not names:
        return 0
    camera: Ints = strip.camera
    rays, _ = image_point_observations(inside, strip.image, names, camera)
    block = block_of(frame, strip, names, np.zeros((len(names), 3)), AdjustmentSettings())
    return int(intersect(rays, block.approximate_state(), len(names)).usable.sum())
