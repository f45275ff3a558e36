"""Whether positions of an input can be in its declared CRS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tasks.coordinates.crs import MapFrame
from tasks.deliveries.source_rows import Places

_FOOT = 0.3048


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
    if len(outside) == 0:
        return
    first = int(outside[0])
    x, y = position[first, :2]
    swapped = frame.inside_area_of_use(position[outside][:, [1, 0, 2]]).all()
    feet = frame.is_projected and frame.inside_area_of_use(position[rows] * _FOOT).all()
    count = f" ({len(outside)} of {len(rows)} rows)" if len(rows) > 1 else ""
    what = (
        f"The position x = {x:.12g}, y = {y:.12g} of this {kind} is outside the area of {frame.name}{count}."
    )
    remedy = "Check the CRS declared for this file, and the units."
    declare = None
    if swapped:
        remedy = "x and y look swapped: x is east and y is north in every input. Exchange the two columns."
        declare = 'columns = { x = "y", y = "x" }'
    elif feet:
        remedy = 'In feet they lie inside: declare length_unit = "ft" (or "us-ft") if they are.'
        declare = 'length_unit = "ft"'
    raise replace(places.error(first, what, remedy, str(names[first])), declare=declare)


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
    lost = (np.isfinite(position) & ~np.isfinite(converted)).any(axis=1)
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
    row = int(np.argmax(lost))
    grids = [frame.heights.geoid.name for frame in frames if frame.heights.geoid is not None]
    if grids:
        names_of_grids = " or ".join(dict.fromkeys(grids))
        what = f"The position lies outside the geoid grid {names_of_grids} ({lost.sum()} rows)."
        remedy = "Give a geoid grid that covers the block."
    else:
        what = f"The position cannot be transformed into the CRS of the project ({lost.sum()} rows)."
        remedy = "Check the CRSs of this input and of the project."
    raise places.error(row, what, remedy, str(names[row]))
