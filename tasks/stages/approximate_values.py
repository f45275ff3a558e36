"""Approximate values of orientations that were not given and of object points, and what looks wrong.

Everything that would make the adjustment wrong or impossible is looked for here, before it starts;
``aerocal doctor`` stops after this stage.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.approximate.intersection import IntersectionStatus, intersect
from adjust.arrays import Bools, Floats, Ints
from tasks.block.approximation import (
    MISMATCH,
    STATUS,
    USED,
    WEAK_ANGLE,
    Approximation,
    write_boresight,
    write_images,
    write_points,
)
from tasks.block.block_input import SurveyedPoints, block_of, image_point_observations, surveyed_points
from tasks.block.exposure_events import exposure_events
from tasks.block.found_orientations import found_orientations
from tasks.block.given_orientations import GivenOrientations
from tasks.block.oriented_images import has_attitude, has_position, measured_exposures, oriented_images
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame
from tasks.files.json_text import JSON
from tasks.first_run import announce_compilation
from tasks.plain_text import some_of
from tasks.plausibility.control import ControlDifferences, check_control, control_differences
from tasks.plausibility.coverage import spelled_otherwise
from tasks.plausibility.declared_accuracy import expected_intersections, tie_limits
from tasks.plausibility.distances import check_distances
from tasks.plausibility.flight_direction import check_flight_direction
from tasks.plausibility.misalignment import misalignment, misalignment_by_control
from tasks.plausibility.orientations import check_orientations
from tasks.plausibility.ray_residuals import flying_height, ray_residuals
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.project import ProjectSettings
from tasks.settings.quality import ChecksSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.tables.parquet import read_table, write_stage_table
from tasks.tables.places import distinct, places_of
from tasks.tables.schemas.deliveries import APPROXIMATE_ORIENTATIONS


def write_approximate_block(
    folder: Path,
    tables: Mapping[str, Artifact],
    project: ProjectSettings,
    checks: ChecksSettings,
    *,
    misaligned: bool,
) -> None:
    """Write the tables of approximate values; see `tasks.stages.approximate_values_stage`."""
    announce_compilation()
    map_frame = MapFrame.of(project.crs, project.heights)
    measured = read_table(tables["image_points"], categories=True)
    surveyed_table, given_distances = read_table(tables["control_points"]), read_table(tables["distances"])
    delivered, camera_table = read_table(tables["exposures"]), read_table(tables["cameras"])
    mounted, alone = _checked_alone(
        delivered, camera_table, measured, surveyed_table, map_frame, checks, misaligned=misaligned
    )
    oriented = found_orientations(delivered, mounted, measured, surveyed_table, given_distances, map_frame)
    own = measured_exposures(delivered, camera_table, measured)
    given, frame, unoriented = oriented_images(delivered, camera_table, measured, map_frame, oriented.table)
    if unoriented:
        measured = measured[~measured["image"].isin(unoriented)]
    surveyed = surveyed_points(surveyed_table, map_frame, frame)
    found = _intersected(given, frame, measured, surveyed, checks, misaligned=misaligned)
    # The largest table is written next to the checks.
    with ThreadPoolExecutor(1) as beside:
        points = beside.submit(write_points, folder, found, map_frame)
        write_images(folder, found, own[own["image"].isin(unoriented)])
        write_boresight(folder, found.given)
        write_stage_table(folder, APPROXIMATE_ORIENTATIONS, oriented.table, map_frame)
        notes = _checked(found, surveyed, surveyed_table, map_frame, checks, alone)
        of_distances = check_distances(given_distances, found.point, found.x_in_local)
        points.result()
    of_orientations = (*oriented.remarks, *([_unoriented(unoriented)] if unoriented else []))
    write_notes(folder, replace(notes, problems=(*of_orientations, *notes.problems, *of_distances)))


def _checked(
    found: Approximation,
    surveyed: SurveyedPoints,
    surveyed_table: pd.DataFrame,
    map_frame: MapFrame,
    checks: ChecksSettings,
    alone: tuple[str, ...],
) -> Notes:
    """What the given orientations and the control say about each other.

    Parameters
    ----------
    alone : suspicions of the orientations that were given, where others were found from them.
    """
    given, frame = found.given, found.frame
    place = places_of(surveyed.name, found.point)
    differences = control_differences(surveyed, frame, place, found.rays, _intersections(found))
    expected = expected_intersections(given, checks, found.height)
    unmeasured, is_suspicious = _unmeasured(surveyed, found, place)
    suspicions = (
        # Orientations found from wrong ones fit them, and hide the mistake.
        *(alone or found.suspicions),
        *(unmeasured if is_suspicious else []),
        *check_control(differences, surveyed_table, map_frame, frame, expected),
        *check_flight_direction(given.only(given.position_observed & given.attitude_observed)),
    )
    # The adjustment joins images to events, and would refuse what the doctor has not seen.
    exposure_events(given)
    problems = (*suspicions, *found.remarks, *_dropped(found), *([] if is_suspicious else unmeasured))
    figures: dict[str, JSON] = {"given_orientations": _figures(found, surveyed, place, differences)}
    return Notes(problems, figures, suspicions)


def _checked_alone(
    delivered: pd.DataFrame,
    cameras: pd.DataFrame,
    measured: pd.DataFrame,
    surveyed: pd.DataFrame,
    map_frame: MapFrame,
    checks: ChecksSettings,
    *,
    misaligned: bool,
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Cameras with the boresight that the delivered attitudes show, where some images have none; suspicions.

    The orientations of the others are found from these: a mistake in them has to be named before.
    """
    own = measured_exposures(delivered, cameras, measured)
    whole = has_position(own) & has_attitude(own)
    if whole.all() or not whole.any():
        return cameras, ()
    names = own.loc[whole, "image"]
    part = measured[measured["image"].isin(names)]
    given, frame, _ = oriented_images(delivered[delivered["image"].isin(names)], cameras, part, map_frame)
    points = surveyed_points(surveyed, map_frame, frame)
    found = _intersected(given, frame, part, points, checks, misaligned=misaligned)
    mountings = found.given.mountings
    result = cameras.copy()
    rows = pd.Index(result["camera"]).get_indexer(pd.Index(mountings.names))
    columns = [f"boresight_{name}_deg" for name in ("roll", "pitch", "yaw")]
    result.iloc[rows, result.columns.get_indexer(pd.Index(columns))] = np.rad2deg(mountings.boresight)
    return result, found.suspicions


def _intersected(
    given: GivenOrientations,
    frame: AdjustmentFrame,
    measured: pd.DataFrame,
    surveyed: SurveyedPoints,
    checks: ChecksSettings,
    *,
    misaligned: bool,
) -> Approximation:
    """Intersect, check the orientations, and decide about every point."""
    points = distinct(measured["point"])
    rays, _ = image_point_observations(measured, given.image, points, given.camera)
    block = block_of(frame, given, points, np.zeros((len(points), 3)), AdjustmentSettings())
    state = block.approximate_state()
    intersection = intersect(rays, state, len(points))
    height = flying_height(state, intersection)
    limits = tie_limits(given, checks, height)
    remarks: list[str] = []
    for by_control in (False, True) if misaligned else ():
        if by_control:
            limit_m = expected_intersections(given, checks, height).limit_m
            place = surveyed.places_of_points(points)
            turned = misalignment_by_control(given, rays, state, place, limits, limit_m)
        else:
            turned = misalignment(given, rays, state, len(points), limits)
        if turned is not None:
            remarks.append(turned.sentence)
            given = turned.given
            state = block_of(
                frame, given, points, np.zeros((len(points), 3)), AdjustmentSettings()
            ).approximate_state()
            intersection = intersect(rays, state, len(points))
            height = flying_height(state, intersection)
            limits = tie_limits(given, checks, height)
    residuals = ray_residuals(rays, state, len(points), given.pixel_size, intersection)
    suspicions = check_orientations(given, rays, state, len(points), limits, residuals)

    residual_px = residuals.residual_px
    largest = _largest(rays.point, np.nan_to_num(np.hypot(residual_px[:, 0], residual_px[:, 1])), len(points))
    status = np.array([STATUS[code] for code in IntersectionStatus], dtype=object)[intersection.status]
    usable = intersection.usable
    status[usable & (intersection.angle < np.deg2rad(checks.min_intersection_angle_deg))] = WEAK_ANGLE
    allowed = _largest(rays.point, limits.of_image_px[rays.image], len(points))
    status[usable & (largest > 4.0 * allowed)] = MISMATCH
    x_in_local = np.where(usable[:, None], intersection.object_point, np.nan)
    count = np.bincount(rays.point, minlength=len(points)).astype(np.int64)
    _take_surveyed(points, surveyed, x_in_local, status, count)
    return Approximation(
        given,
        frame,
        rays,
        state,
        points,
        x_in_local,
        intersection.angle,
        count,
        status,
        residual_px,
        height,
        tuple(suspicions),
        tuple(remarks),
    )


def _largest(point: Ints, values: Floats, points: int) -> Floats:
    """The largest of the values (n,) of every object point (m,), sorted by point; 0 without any."""
    first, largest = np.flatnonzero(np.diff(point, prepend=-1)), np.zeros(points)
    largest[point[first]] = np.maximum.reduceat(values, first)
    return largest


def _take_surveyed(
    points: tuple[str, ...], surveyed: SurveyedPoints, x_in_local: Floats, status: np.ndarray, count: Ints
) -> None:
    """Keep full control points that cannot be intersected at their given positions: one ray is useful."""
    row = places_of(surveyed.name, points)
    for k in np.flatnonzero((row >= 0) & surveyed.complete & ~surveyed.is_check):
        j = row[k]
        if status[j] in ("single_ray", "parallel_rays", WEAK_ANGLE) and count[j] > 0:
            x_in_local[j] = surveyed.x_in_local[k]
            status[j] = USED


def _intersections(found: Approximation) -> Floats:
    """Intersections proper (m, 3): NaN where a surveyed position replaces them."""
    several = (found.rays >= 2) & (found.angle > 0.0)
    return np.where(several[:, None], found.x_in_local, np.nan)


def _unoriented(images: tuple[str, ...]) -> str:
    return (
        f"{len(images)} images cannot be oriented and are not used: {some_of(images)}. They have no complete "
        "orientation, are alone in their strip or in none, and have too few image points in common with the "
        "others (6 are needed, well spread): measure more, or give their positions and attitudes."
    )


def _dropped(found: Approximation) -> list[str]:
    """Sentences that count the points that are not used."""
    sentences = {
        "single_ray": "object points are measured in one image only and are not used",
        "parallel_rays": "object points have parallel rays and are not used",
        "behind_a_camera": "object points intersect behind a camera that sees them and are not used",
        WEAK_ANGLE: "object points have rays that intersect at less than "
        "checks.min_intersection_angle_deg and are not used",
        MISMATCH: "object points have rays that miss each other by too much to be the same point and are "
        "not used",
    }
    result = []
    for status, words in sentences.items():
        index = np.flatnonzero(found.status == status)
        if len(index):
            result.append(f"{len(index):,} {words} ({some_of([found.point[i] for i in index], 3)}).")
    return result


def _unmeasured(surveyed: SurveyedPoints, found: Approximation, place: Ints) -> tuple[list[str], bool]:
    """A sentence about control and check points that no image shows, and whether the delivery is to blame.

    It is where all of them are missing, or their names are spelled otherwise in the image points.
    """
    missing = [name for name, index in zip(surveyed.name, place, strict=True) if index < 0]
    if not missing:
        return [], False
    otherwise = spelled_otherwise(missing, found.point)
    sentence = (
        f"{len(missing)} of {len(surveyed.name)} control and check points are not measured in any image and "
        f"are not used: {some_of(missing)}.{otherwise}"
    )
    return [sentence], bool(otherwise) or len(missing) == len(surveyed.name)


def _figures(
    found: Approximation, surveyed: SurveyedPoints, place: Ints, differences: ControlDifferences
) -> dict[str, JSON]:
    """How well the given orientations fit: residuals of tie points, differences and residuals at control."""
    is_surveyed = np.zeros(len(found.point), dtype=bool)
    is_surveyed[place[place >= 0]] = True
    used = found.status == USED
    ties = (used & ~is_surveyed)[found.image_points.point]
    return {
        "tie_rms_px": _rms(found.residual_px[ties]),
        "control": [
            {"point": name, "dx_m": float(d[0]), "dy_m": float(d[1]), "dz_m": float(d[2]), "rays": int(rays)}
            for name, d, rays in zip(differences.point, differences.enu, differences.rays, strict=True)
        ],
        "control_reprojection_rms_px": _rms(_control_residuals(found, surveyed, place)),
    }


def _control_residuals(found: Approximation, surveyed: SurveyedPoints, place: Ints) -> Floats:
    """Residuals (k, 2) px of fully surveyed points, at these places (k,), with the given orientations."""
    chosen: Bools = (place >= 0) & surveyed.complete
    object_point = np.full((len(found.point), 3), np.nan)
    object_point[place[chosen]] = surveyed.x_in_local[chosen]
    kept = np.isfinite(object_point[found.image_points.point]).all(axis=1)
    state = replace(found.state, object_point=np.nan_to_num(object_point))
    misclosure = found.image_points.misclosure(state)[kept]
    pixel = found.given.pixel_size[found.image_points.image[kept]]
    return np.asarray(-misclosure / pixel[:, None] * np.array([1.0, -1.0]))


def _rms(residual_px: Floats) -> list[float] | None:
    """Root mean square of column and row, null without observations."""
    if len(residual_px) == 0:
        return None
    column, row = np.sqrt(np.mean(residual_px**2, axis=0))
    return [float(column), float(row)]
