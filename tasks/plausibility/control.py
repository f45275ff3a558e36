"""Whether the control points fit the given orientations, and if not, which slip would explain it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_map
from tasks.errors import InputError
from tasks.plain_text import some_of
from tasks.plausibility.declared_accuracy import ExpectedIntersections

# A common difference is a matter of the datum when it exceeds this many times its own scatter.
_COMMON_SCATTER = 5.0
_COMMON_HEIGHT_M = 5.0
_COMMON_PLAN_M = 2.0
# No geoid is further from the ellipsoid.
LARGEST_UNDULATION_M = 120.0
# Fewer points differ by their own mistakes.
_LEAST_COMMON = 3
# No camera is mounted otherwise than stated by more.
_LARGEST_TILT_DEG = 5.0
# Positions of one receiver may be wrong together, by no more than this many of their σ.
_COMMON_SIGMAS = 3.0
# From this part of the surveyed points on it is no error of single ones.
_MANY = 0.5


@dataclass(frozen=True, eq=False)
class ControlDifferences:
    """Intersections from the given orientations minus given coordinates.

    Attributes
    ----------
    point : names of the points that were intersected.
    enu : (k, 3) differences along east, north, up, metres; NaN where a coordinate is not known.
    rays : (k,) number of image points.
    is_check : (k,) whether the coordinates stay out of the adjustment.
    """

    point: tuple[str, ...]
    enu: Floats
    rays: Ints
    is_check: Bools


def control_differences(
    surveyed: SurveyedPoints, frame: AdjustmentFrame, place: Ints, rays: Ints, x_in_local: Floats
) -> ControlDifferences:
    """Differences at control and check points.

    Parameters
    ----------
    place : (k,) object point of each surveyed point; −1 without.
    rays : (m,) number of image points of each object point.
    x_in_local : (m, 3) their intersections, NaN where there is none.
    """
    found = (place >= 0) & np.isfinite(x_in_local[place]).all(axis=1)
    index = np.flatnonzero(found)
    computed = x_in_local[place[index]]
    given = surveyed.x_in_local[index]
    anchor = np.where(np.isfinite(given), given, computed)
    enu = np.einsum("nji,nj->ni", frame.local_from_enu(anchor), computed - anchor)
    enu[~surveyed.present[index][:, :2].all(axis=1), :2] = np.nan
    enu[:, 2] = np.nan
    if len(index):
        enu[:, 2] = frame.height(computed) - surveyed.height[index]
    names = tuple(surveyed.name[i] for i in index)
    return ControlDifferences(names, enu, rays[place[index]], surveyed.is_check[index])


def check_control(
    differences: ControlDifferences,
    table: pd.DataFrame,
    map_frame: MapFrame,
    frame: AdjustmentFrame,
    expected: ExpectedIntersections,
) -> list[str]:
    """Refuse control points with impossible coordinates; report suspicious ones.

    Parameters
    ----------
    expected : how far intersections may lie from their points.

    Returns
    -------
    problems : sentences about height systems and datums.

    Raises
    ------
    InputError
        If points lie further from their intersections than the limit.
    """
    limit_m = expected.limit_m
    distance = np.linalg.norm(np.nan_to_num(differences.enu), axis=1)
    far = distance > limit_m
    heights, datum = _common_height(differences, expected), _common_plan(differences, expected)
    if not far.any():
        return [f"{what} {remedy}" for what, remedy in filter(None, (heights, datum))]
    plan = np.linalg.norm(np.nan_to_num(differences.enu[:, :2]), axis=1)
    if heights is not None and (plan <= limit_m).all():
        raise InputError(*heights)
    if datum is not None and (np.linalg.norm(_about_median(differences.enu), axis=1) <= limit_m).all():
        raise InputError(*datum)
    if _swapped(differences, far, table, map_frame, frame, limit_m):
        raise InputError(
            f"x and y of {int(far.sum())} control points look swapped: with x and y exchanged they lie "
            "where their rays intersect.",
            "x is east and y is north in every input, regardless of the axis order of the CRS.",
        )
    names = [differences.point[i] for i in np.argsort(-distance, kind="stable") if far[i]]
    worst = differences.point.index(names[0])
    known = zip(("east", "north", "up"), differences.enu[worst], strict=True)
    off = ", ".join(f"{axis} {value:+z,.1f} m" for axis, value in known if np.isfinite(value))
    listed = f" ({len(names)} such points: {some_of(names)})"
    found = (
        f"The {int(differences.rays[worst])} rays intersect {distance[worst]:,.1f} m from the given position "
        f"({off}){listed if len(names) > 1 else ''}; more than {limit_m:g} m is an error."
    )
    remedy = "Check its coordinates, its CRS and heights, and whether its image points belong to this point"
    # A few check points that stand out, such as by one wrong image point, make no result wrong.
    if differences.is_check[far].all() and far.mean() < _MANY:
        return [
            *([] if heights is None else [" ".join(heights)]),
            f"Check point {names[0]}: {found} {remedy}.",
        ]
    raise InputError(
        found, f"{remedy}; or raise checks.control_distance_m.", entity=f"control point {names[0]}"
    )


def _swapped(
    differences: ControlDifferences,
    far: Bools,
    table: pd.DataFrame,
    map_frame: MapFrame,
    frame: AdjustmentFrame,
    limit_m: float,
) -> bool:
    """Whether exchanging x and y brings the far points to their intersections."""
    names = [differences.point[i] for i in np.flatnonzero(far)]
    rows = table.set_index("point").loc[names]
    given = rows[["x_m", "y_m", "z_m"]].fillna(0.0).to_numpy(np.float64)
    exchanged = given[:, [1, 0, 2]]
    if not np.asarray(map_frame.inside_area_of_use(exchanged)).all():
        return False
    as_given = local_from_map(map_frame, frame, given)
    axes = frame.local_from_enu(as_given)
    intersected = as_given + np.einsum("nij,nj->ni", axes, np.nan_to_num(differences.enu[far]))
    distance = np.linalg.norm((local_from_map(map_frame, frame, exchanged) - intersected)[:, :2], axis=1)
    return bool((distance <= limit_m).all())


def _common_height(
    differences: ControlDifferences, expected: ExpectedIntersections
) -> tuple[str, str] | None:
    """What is wrong and its remedy if all heights differ by the same amount, as between two height systems.

    How much they scatter is taken from themselves, and for fewer than three from what is expected.
    """
    up = differences.enu[:, 2]
    up = up[np.isfinite(up)]
    if len(up) == 0:
        return None
    median = float(np.median(up))
    scatter = float(_scatter(up[:, None])) if len(up) >= _LEAST_COMMON else expected.sigma_m
    notable = max(_COMMON_HEIGHT_M, _COMMON_SCATTER * scatter, _COMMON_SIGMAS * expected.common_m)
    if abs(median) < notable:
        return None
    points = "the one surveyed point comes" if len(up) == 1 else f"{len(up)} surveyed points come"
    spread = f" (scatter {scatter:.1f} m)" if len(up) >= _LEAST_COMMON else ""
    focal_length = 100.0 * abs(median) / expected.height if expected.height > 0.0 else np.inf
    alike = (
        f"; a focal-length error of {focal_length:.1f} % would have the same effect"
        if focal_length < 10.0
        else ""
    )
    found = (
        f"with the given orientations {points} out {abs(median):.1f} m "
        f"{'higher' if median > 0.0 else 'lower'} than given{spread}."
    )
    if abs(median) > LARGEST_UNDULATION_M:
        return (
            f"The heights of exposures and control do not belong together: {found}",
            "No geoid is so far from the ellipsoid: check the unit of the heights of both inputs "
            f"(height_unit), and their sign{alike}.",
        )
    return (
        "The heights of exposures and control refer to different height systems (geoid undulation?): "
        f"{found}",
        "Check `heights` of both inputs: ellipsoidal heights and altitudes above the geoid differ by the "
        f"undulation{alike}.",
    )


def _common_plan(differences: ControlDifferences, expected: ExpectedIntersections) -> tuple[str, str] | None:
    """What is wrong and its remedy if all points differ by the same amount in plan, as between two datums."""
    plan = differences.enu[:, :2]
    plan = plan[np.isfinite(plan).all(axis=1)]
    if len(plan) < _LEAST_COMMON:
        return None
    east, north = np.median(plan, axis=0)
    size, scatter = float(np.hypot(east, north)), float(_scatter(plan))
    if size < max(_COMMON_PLAN_M, _COMMON_SCATTER * scatter, expected.sigma_m):
        return None
    parts = (
        f"{abs(value):,.1f} m {words[int(value > 0.0)]}"
        for value, words in ((east, ("west", "east")), (north, ("south", "north")))
        if abs(value) > scatter
    )
    tilt = np.rad2deg(size / expected.height) if expected.height > 0.0 else np.inf
    alike = f"; where all strips run in one direction, a boresight of {tilt:.2f}° has the same effect"
    gnss = (
        f" An error common to all positions is gnss_shift (adjustment.free)"
        f"{alike if tilt < _LARGEST_TILT_DEG else ''}."
    )
    return (
        "The coordinates of exposures and control look like those of different datums: with the given "
        f"orientations {len(plan)} surveyed points come out {' and '.join(parts)} of what is given (scatter "
        f"{scatter:.1f} m).",
        "Check `crs` and units of both inputs (us-ft and ft differ by 2 ppm of the coordinates)."
        f"{gnss if size <= expected.limit_m else ''}",
    )


def _about_median(enu: Floats) -> Floats:
    """Differences (k, 3) less what all have in common in plan."""
    plan = np.nanmedian(enu[:, :2], axis=0)
    return np.asarray(np.nan_to_num(enu - np.array([plan[0], plan[1], 0.0])))


def _scatter(values: Floats) -> Floats:
    """Robust standard deviation of values (k, c) about their medians, of the component with the largest."""
    return np.asarray(1.4826 * np.median(np.abs(values - np.median(values, axis=0)), axis=0).max())
