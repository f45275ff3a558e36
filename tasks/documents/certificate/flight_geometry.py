"""Overlaps, bases and line spacings of a flight, by height level and pair of opposite directions.

With the side s of the image on the ground (pixels along or across the flight times the ground sampling
distance), the base B between neighbouring exposures and the distance A of neighbouring lines,

    forward overlap 1 − B/s_along,    side overlap 1 − A/s_across.

Strips on the same line (forward and reverse) count as one line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.calibration.record import CalibratedCamera

# Strips nearer to each other than this part of the image's side on the ground fly the same line.
_SAME_LINE = 0.1
# Lines whose directions differ by less belong together, degrees.
_SAME_AXIS_DEG = 20.0


@dataclass(frozen=True)
class StripGroup:
    """Strips of one height along one axis; lengths in metres, None where there is nothing to measure.

    Attributes
    ----------
    level : index of the height.
    axis_deg : direction of the lines in the map, clockwise from north, 0 to 180°.
    strips, lines, images : how many.
    height_m : median height above ground.
    base_m, spacing_m : medians.
    forward_overlap, side_overlap : parts of the side of the image, for these medians; negative: a gap.
    """

    level: int
    axis_deg: float
    strips: int
    lines: int
    images: int
    height_m: float
    base_m: float | None
    spacing_m: float | None
    forward_overlap: float | None
    side_overlap: float | None

    @property
    def base_over_height(self) -> float | None:
        """Base over height above ground."""
        return None if self.base_m is None else self.base_m / self.height_m


@dataclass(frozen=True, eq=False)
class _Strip:
    """One strip: direction in the map (unit vector with x ≥ 0), places (n, 2)."""

    direction: Floats
    places: Floats


def strip_groups(images: pd.DataFrame, camera: CalibratedCamera) -> tuple[StripGroup, ...]:
    """The groups of a camera's images, by level and then by direction.

    Parameters
    ----------
    images : level, flight, strip, x_m, y_m, z_m, ground_m, gsd_m.
    """
    along, across = (
        (camera.columns, camera.rows) if camera.mount_deg % 180 == 0 else (camera.rows, camera.columns)
    )
    groups = []
    for level, of_level in images.groupby("level", sort=True):
        gsd = float(of_level["gsd_m"].median())
        height = float((of_level["z_m"] - of_level["ground_m"]).median())
        strips = [_strip(own) for _, own in of_level.groupby(["flight", "strip"], dropna=False)]
        lines = [strip for strip in strips if strip is not None]
        groups += [_group(int(str(level)), height, along * gsd, across * gsd, own) for own in _by_axis(lines)]
    return tuple(groups)


def _strip(images: pd.DataFrame) -> _Strip | None:
    """A strip in its direction; None for a single exposure."""
    places = images[["x_m", "y_m"]].to_numpy(np.float64)
    if len(places) < 2:
        return None
    _, spread, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
    if spread[0] == 0.0:
        return None
    direction = axes[0]
    # One of the two opposite directions of a line, so that all strips along it agree.
    if direction[0] < 0.0 or (direction[0] == 0.0 and direction[1] < 0.0):
        direction = -direction
    return _Strip(np.asarray(direction), places)


def _by_axis(strips: list[_Strip]) -> list[list[_Strip]]:
    """Strips that run along the same axis, in the order of their directions."""
    groups: list[list[_Strip]] = []
    least = np.cos(np.deg2rad(_SAME_AXIS_DEG))
    for strip in sorted(strips, key=lambda item: _axis_deg(item.direction)):
        found = next((own for own in groups if abs(own[0].direction @ strip.direction) > least), None)
        if found is None:
            groups.append([strip])
        else:
            found.append(strip)
    return groups


def _group(level: int, height: float, along: float, across: float, strips: list[_Strip]) -> StripGroup:
    # Directions on both sides of north-south point apart: turned to the first before they are averaged.
    first = strips[0].direction
    mean = np.sum([np.copysign(1.0, item.direction @ first) * item.direction for item in strips], axis=0)
    mean /= np.hypot(*mean)
    bases = np.concatenate([np.diff(np.sort(item.places @ mean)) for item in strips])
    aside = np.array([mean[1], -mean[0]])
    gaps = np.diff(np.sort([float((item.places @ aside).mean()) for item in strips]))
    gaps = _between_lines(gaps, _SAME_LINE * across)
    base = float(np.median(bases)) if len(bases) else None
    spacing = float(np.median(gaps)) if len(gaps) else None
    return StripGroup(
        level,
        _axis_deg(mean),
        len(strips),
        len(gaps) + 1,
        sum(len(item.places) for item in strips),
        height,
        base,
        spacing,
        None if base is None else 1.0 - base / along,
        None if spacing is None else 1.0 - spacing / across,
    )


def _between_lines(gaps: Floats, same: float) -> Floats:
    """Distances between neighbouring lines from those between neighbouring strips, in their order."""
    offsets = np.concatenate([[0.0], np.cumsum(gaps)])
    new = np.concatenate([[True], gaps > same])
    line = np.cumsum(new) - 1
    means = np.bincount(line, weights=offsets) / np.bincount(line)
    return np.asarray(np.diff(means))


def _axis_deg(direction: Floats) -> float:
    """Direction of a line clockwise from north, 0 to 180°."""
    return float(np.rad2deg(np.arctan2(direction[0], direction[1])) % 180.0)
