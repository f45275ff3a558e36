"""Offsets of the strips less what a shift of each flight and a lever arm of each mounting explain."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.calibration.orientation_differences import LEVER_ARM, SHIFT
from adjust.calibration.strip_means import StripMeans
from adjust.calibration.strip_offsets import body_fixed, linear_fit, map_fixed

TestedAxes: TypeAlias = Literal["body", "map"]
_HUBER_LIMIT = 1.5
_ROUNDS = 50


def tested_axes(strips: StripMeans) -> TestedAxes:
    """The axes in which most strips agree better, whatever the others say."""
    spreads = [_robust_spread(strips.mean[:, part][:, :2]) for part in (LEVER_ARM, SHIFT)]
    return "map" if spreads[1] < spreads[0] else "body"


def stable_offsets(strips: StripMeans, part: Ints, kept: Bools, axes: TestedAxes) -> Floats:
    """Offsets (k, 3) along these axes, the vertical one last and as it is.

    With fewer strips than unknowns, what is subtracted is only the mean offset in these axes.

    Parameters
    ----------
    part : (k,) strips of one number have one lever arm.
    kept : (k,) the strips that say what is subtracted.
    """
    own = LEVER_ARM if axes == "body" else SHIFT
    vertical = strips.mean[:, own][:, 2:]
    count = len(part)
    design = np.hstack([map_fixed(strips.flight), body_fixed(strips.heading, part)])
    if design.shape[1] > count:
        in_axes = strips.mean[:, own][:, :2]
        return np.hstack([in_axes - in_axes[kept].mean(axis=0), vertical])
    left = _left_by(design, strips.mean[:, SHIFT][:, :2].ravel(), kept)
    if axes == "body":
        left = body_fixed(strips.heading, np.arange(count)).T @ left
    return np.hstack([left.reshape(-1, 2), vertical])


def _robust_spread(plan: Floats) -> float:
    """Median distance of strip means (k, 2) from their median."""
    return float(np.median(np.linalg.norm(plan - np.median(plan, axis=0), axis=1)))


def _left_by(design: Floats, offset: Floats, kept: Bools) -> Floats:
    """Residuals (2 k,) of a fit to the strips that are kept, with Huber's weights."""
    weight = kept.astype(np.float64)
    left = offset
    for _ in range(_ROUNDS):
        root = np.repeat(np.sqrt(weight), 2)
        fitted = linear_fit(design * root[:, None], offset * root)
        before, left = left, offset - design @ fitted.solution
        distance = np.linalg.norm(left.reshape(-1, 2), axis=1)
        limit = _HUBER_LIMIT * max(float(np.median(distance[kept])), 1e-12)
        weight = kept * limit / np.maximum(distance, limit)
        if np.abs(left - before).max() < 1e-9:
            break
    return np.asarray(left)
