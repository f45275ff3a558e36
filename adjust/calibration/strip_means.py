"""What each strip says about misalignment and offset: its mean, its scatter, and its drift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.calibration.orientation_differences import COMPONENTS, OrientationDifferences
from adjust.calibration.robust_mean import robust_mean

# Exposures that a straight line and its standard deviation need.
_LEAST_FOR_DRIFT = 3
#: Headings further apart than this, radians, are different directions of flight.
HEADING_GAP = np.deg2rad(30.0)
#: Heights further apart than this part of the lower one are different flying heights.
HEIGHT_GAP = 0.10


@dataclass(frozen=True, slots=True, eq=False)
class StripMeans:
    """The strips, in the order of their numbers; k of them, nine components each.

    Attributes
    ----------
    strip : (k,) numbers.
    flight : (k,) the flight of each.
    place : (k,) median of its exposures' places: the order in which the strips of a flight were flown.
    count : (k,) exposures.
    mean : (k, 9) robust mean, radians and metres.
    sigma : (k, 9) its standard deviation from the scatter within the strip; NaN with one exposure.
    scatter : (k, 9) standard deviation of one exposure within the strip.
    drift : (k, 9) change from the first to the last exposure along the best straight line; NaN with fewer
        than three exposures.
    drift_sigma : (k, 9) its standard deviation.
    heading : (k,) radians.
    height : (k,) metres.
    heading_group, height_group : (k,) directions of flight and flying heights recognised from the data,
        numbered from 0 in ascending order.
    """

    strip: Ints
    flight: Ints
    place: Floats
    count: Ints
    mean: Floats
    sigma: Floats
    scatter: Floats
    drift: Floats
    drift_sigma: Floats
    heading: Floats
    height: Floats
    heading_group: Ints
    height_group: Ints


def strip_means(differences: OrientationDifferences) -> StripMeans:
    """Mean, scatter and drift of every strip."""
    strips = np.unique(differences.strip)
    own = [differences.only(differences.strip == strip) for strip in strips]
    means = [robust_mean(item.components, item.strip) for item in own]
    drifts = [_drift(item.place, item.components) for item in own]
    heading = np.array([_mean_direction(item.heading) for item in own])
    height = np.array([np.median(item.height) for item in own])
    return StripMeans(
        strip=strips,
        flight=np.array([item.flight[0] for item in own]),
        place=np.array([np.median(item.place) for item in own]),
        count=np.array([len(item.strip) for item in own]),
        mean=np.array([item.robust for item in means]),
        sigma=np.array([item.robust_sigma for item in means]),
        scatter=np.array([_scatter(item.components) for item in own]),
        drift=np.array([change for change, _ in drifts]),
        drift_sigma=np.array([sigma for _, sigma in drifts]),
        heading=heading,
        height=height,
        heading_group=direction_groups(heading),
        height_group=height_groups(height),
    )


def direction_groups(heading: Floats) -> Ints:
    """Groups (k,) of headings: the circle is cut wherever a gap wider than `HEADING_GAP` is."""
    turned = np.mod(heading, 2.0 * np.pi)
    order = np.argsort(turned, kind="stable")
    gap = np.diff(turned[order], append=turned[order[0]] + 2.0 * np.pi)
    if not np.any(gap > HEADING_GAP):
        return np.zeros(len(heading), dtype=np.int64)
    after = np.concatenate([[0], np.cumsum(gap > HEADING_GAP)[:-1]])
    # Headings on both sides of north are one direction unless the gap lies there.
    groups = int((gap > HEADING_GAP).sum())
    group = np.empty(len(heading), dtype=np.int64)
    group[order] = after % groups
    return group


def height_groups(height: Floats) -> Ints:
    """Groups (k,) of heights: cut wherever a gap wider than `HEIGHT_GAP` of the lower height is."""
    order = np.argsort(height, kind="stable")
    sorted_height = height[order]
    cut = np.diff(sorted_height) > HEIGHT_GAP * np.abs(sorted_height[:-1])
    group = np.empty(len(height), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(cut)])
    return group


def _mean_direction(heading: Floats) -> float:
    return float(np.arctan2(np.sin(heading).mean(), np.cos(heading).mean()))


def _scatter(values: Floats) -> Floats:
    """Standard deviation (9,) of one exposure, NaN where there is only one."""
    if len(values) < 2:
        return np.full(len(COMPONENTS), np.nan)
    return np.asarray(values.std(axis=0, ddof=1))


def _drift(place: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Change (9,) from the first to the last place along a straight line, and its standard deviation."""
    centred = place - place.mean()
    square = float(centred @ centred)
    if len(place) < _LEAST_FOR_DRIFT or square == 0.0:
        nothing = np.full(len(COMPONENTS), np.nan)
        return nothing, nothing
    slope = centred @ values / square
    residual = values - values.mean(axis=0) - np.outer(centred, slope)
    sigma = np.sqrt(np.sum(residual**2, axis=0) / (len(place) - 2) / square)
    length = float(np.ptp(place))
    return slope * length, sigma * length
