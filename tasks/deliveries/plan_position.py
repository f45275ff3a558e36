"""Whether positions of an input can be in its declared CRS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tasks.coordinates.crs import MapFrame
from tasks.deliveries.source_rows import Places

_FOOT = 0.3048
_MILLION = 1e6
_EARTH_RADIUS_M = 6.371e6
# No local system begins so far from its block.
_FAR_M = 1e5
# Longitude east of the antimeridian may be counted on.
_MOST_DEGREES = (360.0, 90.0)
_LARGEST_BLOCK_DEG = 2.0


def refuse_outside_area(
    frame: MapFrame, position: NDArray[np.float64], places: Places, names: Sequence[str], kind: str
) -> None:
    """Raise if a position (n, 3) lies outside the area of use of its CRS; rows without plan are ignored.

    Raises
    ------
    InputError
        Naming the first such row and, where exchanging x and y would fit, saying so.
    """
    rows = np.flatnonzero(np.isfinite(position[:, :2]).all(axis=1))
    outside = rows[~frame.inside_area_of_use(position[rows])]
    if frame.is_projected and len(rows) > 1 and _looks_like_degrees(position[rows]):
        # The zones of WGS 84 begin at the equator, where so small numbers are.
        outside = rows
    if len(outside) == 0:
        return
    first = int(outside[0])
    x, y = position[first, :2]
    count = f" ({len(outside)} of {len(rows)} rows)" if len(rows) > 1 else ""
    what = (
        f"The position x = {x:.12g}, y = {y:.12g} of this {kind} is outside the area of {frame.name}{count}."
    )
    remedy, declare = _explanation(frame, position[rows], position[outside])
    raise replace(places.error(first, what, remedy, str(names[first])), declare=declare)


def _explanation(
    frame: MapFrame, position: NDArray[np.float64], outside: NDArray[np.float64]
) -> tuple[str, str | None]:
    """The remedy for positions (n, 3) of which some (k, 3) are outside, and the line that declares it."""
    if frame.is_projected and _looks_like_degrees(outside):
        return "They look like longitude and latitude: declare a geographic CRS for this file.", None
    if frame.inside_area_of_use(outside[:, [1, 0, 2]]).all():
        remedy = "x and y look swapped: x is east and y is north in every input. Exchange the two columns."
        return remedy, 'columns = { x = "y", y = "x" }'
    if frame.is_projected and frame.inside_area_of_use(position * _FOOT).all():
        remedy = 'In feet they lie inside: declare length_unit = "ft" (or "us-ft") if they are.'
        return remedy, 'length_unit = "ft"'
    zone = int(outside[0, 0] // _MILLION)
    if frame.is_projected and frame.inside_area_of_use(outside - [zone * _MILLION, 0.0, 0.0]).all():
        return (
            f"Without {zone} millions of x they lie inside: if that is the number of the zone, subtract "
            f"{zone * _MILLION:,.0f} m, or declare a CRS that counts so.",
            None,
        )
    return "Check the CRS declared for this file, and the units.", None


def _looks_like_degrees(position: NDArray[np.float64]) -> bool:
    """Whether positions (n, 3) may be longitude and latitude of one block."""
    plan = position[:, :2]
    return bool((np.abs(plan) <= _MOST_DEGREES).all() and (np.ptp(plan, axis=0) < _LARGEST_BLOCK_DEG).all())


def about_map_as_local(frame: MapFrame, position: NDArray[np.float64]) -> str | None:
    """A sentence about positions (n, 3) that are declared as local and look like those of a map, or None."""
    plan = position[np.isfinite(position[:, :2]).all(axis=1), :2]
    if not frame.is_local or len(plan) == 0:
        return None
    x, y = np.median(plan, axis=0)
    if abs(y) < _FAR_M:
        return None
    size = float(np.ptp(plan, axis=0).max())
    return (
        f"The positions are declared as Cartesian (local), but look like those of a map (x = {x:,.0f} m, y = "
        f"{y:,.0f} m): then the curvature of the earth, {size**2 / (8.0 * _EARTH_RADIUS_M):.2f} m over the "
        f"{size / 1e3:.1f} km of the block, the scale of the map and its convergence are neglected. Declare "
        "the CRS if they are of one."
    )


def refuse_without_image(
    frames: tuple[MapFrame, MapFrame],
    position: NDArray[np.float64],
    converted: NDArray[np.float64],
    places: Places,
    names: Sequence[str],
) -> None:
    """Raise if a position has no place in the project's CRS and heights, or none in the area of that CRS.

    Raises
    ------
    InputError
        Naming the row and the geoid grid or the area it lies outside of.
    """
    lost = np.asarray((np.isfinite(position) & ~np.isfinite(converted)).any(axis=1))
    if not lost.any():
        rows = np.flatnonzero(np.isfinite(converted[:, :2]).all(axis=1))
        outside = rows[~frames[1].inside_area_of_use(converted[rows])]
        if len(outside):
            raise places.error(
                int(outside[0]),
                f"The position is outside the area of {frames[1].name}, the CRS of the results "
                f"({len(outside)} of {len(rows)} rows).",
                "Correct crs in [project], or that of this file.",
                str(names[outside[0]]),
            )
        return
    grids = [frame.heights.geoid.name for frame in frames if frame.heights.geoid is not None]
    if grids:
        names_of_grids = " or ".join(dict.fromkeys(grids))
        what = f"The position lies outside the geoid grid {names_of_grids} ({lost.sum()} rows)."
        remedy = "Give a geoid grid that covers the block."
    else:
        what = f"The position cannot be transformed into the CRS of the project ({lost.sum()} rows)."
        remedy = "Check the CRSs of this input and of the project."
    places.refuse(lost, names, what, remedy)
