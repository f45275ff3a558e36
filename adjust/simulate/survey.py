"""Surveyed points: where control and check points lie, and which of their coordinates are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from adjust.arrays import Bools, Floats, Ints

SurveyKind = Literal["full", "height", "plan"]
Layout = Literal["grid", "perimeter", "spread", "list"]

_PRESENT = {"full": (True, True, True), "height": (False, False, True), "plan": (True, True, False)}
# Side of the grid of places from which a spread layout chooses.
_CANDIDATES = 40


@dataclass(frozen=True)
class SurveyLayout:
    """A set of surveyed points laid out alike.

    Attributes
    ----------
    layout : "grid": columns × rows, in the middle of their cells; "perimeter": evenly along the border;
        "spread": each as far as possible from those before it; "list": the given places.
    kind : which coordinates are known.
    columns, rows : of a grid.  count : of the other layouts.  places : (x, y) metres of a list.
    control : how many of them are control points, those spread best over the area; the others are check
        points. None: all.
    margin : part of the sides of the covered rectangle that is left free along its borders.
    extent : sides of the rectangle about the origin that replaces the covered one; None: that one.
    """

    layout: Layout
    kind: SurveyKind = "full"
    columns: int = 0
    rows: int = 0
    count: int = 0
    places: tuple[tuple[float, float], ...] = ()
    control: int | None = None
    margin: float = 0.03
    extent: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Survey:
    """k surveyed points.

    Attributes
    ----------
    place : (k, 2) metres, local frame.
    present : (k, 3) which of east, north, up are known.
    is_check : (k,).
    """

    place: Floats
    present: Bools
    is_check: Bools


def survey_of(layouts: tuple[SurveyLayout, ...], rectangle: Floats) -> Survey:
    """All points of the layouts within a covered rectangle (2, 2), lower and upper corner."""
    places, present, checks = [np.empty((0, 2))], [np.empty((0, 3), dtype=bool)], [np.empty(0, dtype=bool)]
    for layout in layouts:
        place = _places(layout, rectangle)
        is_check = np.ones(len(place), dtype=bool)
        is_check[spread_order(place, layout.control)] = False
        places.append(place)
        present.append(np.tile(np.array(_PRESENT[layout.kind]), (len(place), 1)))
        checks.append(is_check)
    return Survey(np.concatenate(places), np.concatenate(present), np.concatenate(checks))


def _places(layout: SurveyLayout, rectangle: Floats) -> Floats:
    """Plan positions (k, 2) of a layout."""
    if layout.extent is not None:
        rectangle = np.array([[-0.5], [0.5]]) * np.array(layout.extent)
    inset = layout.margin * (rectangle[1] - rectangle[0])
    low, size = rectangle[0] + inset, rectangle[1] - rectangle[0] - 2.0 * inset
    if layout.layout == "grid":
        return np.asarray(low + size * _grid(layout.columns, layout.rows))
    if layout.layout == "perimeter":
        return np.asarray(low + size * along_border(layout.count))
    if layout.layout == "spread":
        candidates = low + size * _grid(_CANDIDATES, _CANDIDATES)
        return np.asarray(candidates[spread_order(candidates, layout.count)])
    return np.array(layout.places, dtype=np.float64).reshape(-1, 2)


def _grid(columns: int, rows: int) -> Floats:
    """Middles (columns · rows, 2) of the cells of the unit square, row after row from below."""
    x, y = (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows
    return np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)


def along_border(count: int) -> Floats:
    """Points (count, 2) evenly along the border of the unit square, from the corner (0, 0)."""
    way = 4.0 * np.arange(count) / count
    side, rest = np.floor(way).astype(np.int64), way % 1.0
    zero, one = np.zeros(count), np.ones(count)
    x = np.choose(side, [rest, one, 1.0 - rest, zero])
    y = np.choose(side, [zero, rest, one, 1.0 - rest])
    return np.stack([x, y], -1)


def spread_order(place: Floats, most: int | None = None) -> Ints:
    """Order (k,) in which every next point is the farthest from those before it; at most so many of them.

    Distances are parts of the sides of the area. The first is the farthest from the middle, so the first
    four of a rectangle lie in its corners, and the first m are a well spread choice for every m, each
    containing the smaller ones.
    """
    number = len(place) if most is None else min(most, len(place))
    if number == 0:
        return np.empty(0, dtype=np.int64)
    low, high = place.min(axis=0), place.max(axis=0)
    part = (place - 0.5 * (low + high)) / np.maximum(high - low, 1e-9)
    order = [int(np.argmax(np.hypot(*part.T)))]
    distance = np.hypot(*(part - part[order[0]]).T)
    distance[order[0]] = -1.0
    while len(order) < number:
        order.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.hypot(*(part - part[order[-1]]).T))
        distance[order[-1]] = -1.0
    return np.array(order, dtype=np.int64)
