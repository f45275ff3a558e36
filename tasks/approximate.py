"""Approximate values: object points by intersection from the given orientations, and what looks wrong.

Everything that would make the adjustment wrong or impossible is looked for here, before it starts;
``aerocal doctor`` stops after this stage.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.approximate.intersection import Intersection, IntersectionStatus, intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.block_input import SurveyedPoints, block_of, image_point_observations, surveyed_points
from tasks.block.given_orientations import GivenOrientations, Mountings
from tasks.block.track_attitudes import with_track_attitudes
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_frame, map_from_local
from tasks.errors import InputError
from tasks.first_run import announce_compilation
from tasks.plausibility.control import ControlDifferences, check_control, control_differences
from tasks.plausibility.declared_accuracy import expected_intersections, tie_limits
from tasks.plausibility.flight_direction import check_flight_direction
from tasks.plausibility.misalignment import misalignment
from tasks.plausibility.orientations import check_orientations, residuals_px
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.project import ProjectSettings
from tasks.settings.quality import ChecksSettings
from tasks.storage.artifact import Artifact
from tasks.storage.json_text import JSON
from tasks.storage.notes import Notes, write_notes
from tasks.storage.store import stored
from tasks.tables import schemas
from tasks.tables.parquet import read_table, write_table

USED = "used"
_STATUS = {
    IntersectionStatus.INTERSECTED: USED,
    IntersectionStatus.FEWER_THAN_TWO_RAYS: "single_ray",
    IntersectionStatus.PARALLEL_RAYS: "parallel_rays",
    IntersectionStatus.BEHIND_A_CAMERA: "behind_a_camera",
}
_WEAK_ANGLE = "weak_angle"
_MISMATCH = "mismatch"
_NO_ATTITUDE = "no_attitude"


@dataclass(frozen=True, eq=False)
class Approximation:
    """A block with its object points intersected, and what became of every point.

    Attributes
    ----------
    point : names of the m points measured in images of the block, ascending.
    x_in_local : (m, 3) NaN where there is no approximate value.
    angle : (m,) largest angle between two rays, radians.  rays : (m,).
    status : (m,) texts, "used" or why not.
    residual_px : (n, 2) column, row residuals of the image points at the intersections.
    height : median flying height above the intersections, metres.
    suspicions : slips of the orientations that the tie points suggest.
    remarks : what was found about them that is no slip.
    """

    given: GivenOrientations
    frame: AdjustmentFrame
    image_points: ImagePoints
    state: State
    point: tuple[str, ...]
    x_in_local: Floats
    angle: Floats
    rays: Ints
    status: np.ndarray
    residual_px: Floats
    height: float
    suspicions: tuple[str, ...]
    remarks: tuple[str, ...]


@stored("approximate_values")
def approximate_block(
    folder: Path,
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    project: ProjectSettings,
    checks: ChecksSettings,
    misaligned: bool = False,
) -> None:
    """Intersect all object points and refuse what contradicts itself.

    Writes images, approximate_points and approximate_boresight.parquet and notes.json.

    Parameters
    ----------
    misaligned : whether the boresight is to be estimated, so that it may be anything that is usual.

    Raises
    ------
    InputError
        If orientations, image points and control contradict each other.
    """
    announce_compilation()
    map_frame = MapFrame.of(project.crs, project.heights)
    measured = read_table(image_points)
    surveyed_table = read_table(control_points)
    given, frame, unoriented = oriented_images(
        read_table(exposures), read_table(cameras), measured, map_frame
    )
    measured = measured[~measured["image"].isin(unoriented)]
    surveyed = surveyed_points(surveyed_table, map_frame, frame)
    problems = [_no_attitude(unoriented)] if unoriented else []

    found = _intersected(given, frame, measured, surveyed, checks, misaligned=misaligned)
    given = found.given
    points_table = pd.DataFrame({"point": found.point, "rays": found.rays})
    differences = control_differences(surveyed, frame, points_table, _intersections(found))
    expected = expected_intersections(given, checks, found.height)
    suspicions = [
        *found.suspicions,
        *check_control(differences, surveyed_table, map_frame, frame, expected),
        *check_flight_direction(given),
    ]
    problems += suspicions
    problems += found.remarks
    problems += _dropped(found) + _unmeasured(surveyed, found)

    _write_images(folder, given, found, unoriented, read_table(exposures))
    x_in_map = np.full_like(found.x_in_local, np.nan)
    known = np.isfinite(found.x_in_local).all(axis=1)
    if known.any():
        x_in_map[known] = map_from_local(map_frame, frame, found.x_in_local[known])
    write_table(
        folder / "approximate_points.parquet",
        schemas.APPROXIMATE_POINTS,
        {
            "point": found.point,
            **{f"{axis}_m": x_in_map[:, k] for k, axis in enumerate("xyz")},
            "rays": found.rays,
            "angle_deg": np.rad2deg(found.angle),
            "status": found.status,
        },
        map_frame,
    )
    _write_boresight(folder, given)
    figures: dict[str, JSON] = {"given_orientations": _figures(found, surveyed, differences)}
    write_notes(folder, Notes(tuple(problems), figures, tuple(suspicions)))


def _write_boresight(folder: Path, given: GivenOrientations) -> None:
    """approximate_boresight.parquet: where the adjustment begins."""
    angles = np.rad2deg(given.mountings.boresight)
    write_table(
        folder / "approximate_boresight.parquet",
        schemas.APPROXIMATE_BORESIGHT,
        {
            "camera": list(given.mountings.names),
            **{f"{name}_deg": angles[:, k] for k, name in enumerate(("roll", "pitch", "yaw"))},
        },
    )


def oriented_images(
    exposures: pd.DataFrame, cameras: pd.DataFrame, measured: pd.DataFrame, map_frame: MapFrame
) -> tuple[GivenOrientations, AdjustmentFrame, tuple[str, ...]]:
    """Given orientations of the measured images, the local frame, and the images without attitude.

    Raises
    ------
    InputError
        If no measured image can be oriented, or one has no position.
    """
    own = exposures[exposures["image"].isin(measured["image"].unique())]
    mountings = Mountings.from_table(cameras[cameras["camera"].isin(own["camera"].unique())])
    if len(own) == 0:
        raise InputError(
            "No image point lies in an image of the exposures.", "Check that both name the images alike."
        )
    _require_positions(own)
    frame = local_frame(map_frame, own[["x_m", "y_m", "z_m"]].to_numpy(np.float64))
    given = GivenOrientations.from_tables(own, mountings, map_frame, frame)
    given = with_track_attitudes(given, frame, measured)
    unoriented = tuple(name for name, known in zip(given.image, given.has_attitude, strict=True) if not known)
    if len(unoriented) == len(given.image):
        raise InputError(
            "None of the exposures has an attitude, and none lies in a strip from which it could be taken.",
            "Give ω, φ, κ or heading, pitch, roll, or name the strips: a strip shows the heading.",
        )
    return given.only(given.has_attitude), frame, unoriented


def _require_positions(measured: pd.DataFrame) -> None:
    """Refuse measured images (rows of exposures) that have no position, not even an approximate one."""
    missing = measured[measured[["x_m", "y_m", "z_m"]].isna().any(axis=1)]
    if len(missing) == 0:
        return
    names = list(missing["image"])
    listed = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
    raise InputError(
        f"Positions are missing: {len(names):,} measured images have none, and fewer than two others of "
        f"their strip have one ({listed}).",
        "Deliver approximate positions with a large σ, name the strips, or take these images out.",
        entity=f"image {names[0]}",
    )


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
    points = tuple(np.unique(measured["point"].to_numpy(dtype=object)))
    rays, _ = image_point_observations(measured, given.image, points, given.camera)
    block = block_of(frame, given, points, np.zeros((len(points), 3)), AdjustmentSettings())
    state = block.approximate_state()
    placed = rays.only(np.flatnonzero(given.position_observed[rays.image]))
    intersection = intersect(placed, state, len(points))
    height = _height(state, intersection)
    limits = tie_limits(given, checks, height)
    turned = misalignment(given, placed, state, len(points), limits) if misaligned else None
    if turned is not None:
        given = turned.given
        state = block_of(
            frame, given, points, np.zeros((len(points), 3)), AdjustmentSettings()
        ).approximate_state()
        intersection = intersect(placed, state, len(points))
        height = _height(state, intersection)
        limits = tie_limits(given, checks, height)
    suspicions = check_orientations(given, placed, state, len(points), limits)
    intersection = _with_approximate_positions(intersection, rays, state)

    pixel_size = np.array([camera.pixel_size for camera in given.mountings.cameras])[given.camera]
    residual_px = residuals_px(rays, state, intersection, pixel_size)
    largest = np.zeros(len(points))
    # Approximate positions miss by far, and that says nothing against a point.
    length = np.where(
        given.position_observed[rays.image], np.hypot(residual_px[:, 0], residual_px[:, 1]), 0.0
    )
    np.maximum.at(largest, rays.point, np.nan_to_num(length))
    status = np.array([_STATUS[IntersectionStatus(code)] for code in intersection.status], dtype=object)
    usable = intersection.usable
    status[usable & (intersection.angle < np.deg2rad(checks.min_intersection_angle_deg))] = _WEAK_ANGLE
    status[usable & (largest > 4.0 * limits.wrong_px)] = _MISMATCH
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
        () if turned is None else (turned.sentence,),
    )


def _with_approximate_positions(found: Intersection, rays: ImagePoints, state: State) -> Intersection:
    """Intersections of the delivered positions; of all rays where those are too few."""
    too_few = found.status == IntersectionStatus.FEWER_THAN_TWO_RAYS
    both = intersect(rays, state, len(too_few))
    return Intersection(
        np.where(too_few[:, None], both.object_point, found.object_point),
        np.where(too_few, both.angle, found.angle),
        np.where(too_few, both.status, found.status),
    )


def _take_surveyed(
    points: tuple[str, ...], surveyed: SurveyedPoints, x_in_local: Floats, status: np.ndarray, count: Ints
) -> None:
    """Full control points that cannot be intersected keep their given position: one ray is worth having."""
    row = pd.Index(points).get_indexer(pd.Index(surveyed.name))
    for k in np.flatnonzero((row >= 0) & surveyed.complete & ~surveyed.is_check):
        j = row[k]
        if status[j] in ("single_ray", "parallel_rays", _WEAK_ANGLE) and count[j] > 0:
            x_in_local[j] = surveyed.x_in_local[k]
            status[j] = USED


def _height(state: State, intersection: Intersection) -> float:
    """Median flying height above the intersected points, 0 if none was intersected."""
    usable = intersection.usable
    if not usable.any():
        return 0.0
    height = np.median(state.projection_centre[:, 2]) - np.median(intersection.object_point[usable, 2])
    return float(max(height, 0.0))


def _intersections(found: Approximation) -> Floats:
    """Intersections proper (m, 3): NaN where a surveyed position stands in for them."""
    several = (found.rays >= 2) & (found.angle > 0.0)
    return np.where(several[:, None], found.x_in_local, np.nan)


def _no_attitude(images: tuple[str, ...]) -> str:
    listed = ", ".join(images[:5]) + (", …" if len(images) > 5 else "")
    return (
        f"{len(images)} images cannot be oriented and do not take part, because their exposures have no "
        f"attitude and are alone in their strip: {listed}."
    )


def _dropped(found: Approximation) -> list[str]:
    """Sentences that count the points that do not take part."""
    sentences = {
        "single_ray": "object points are measured in one image only and do not take part",
        "parallel_rays": "object points have parallel rays and do not take part",
        "behind_a_camera": "object points intersect behind a camera that sees them and do not take part",
        _WEAK_ANGLE: "object points have rays that meet under less than checks.min_intersection_angle_deg "
        "and do not take part",
        _MISMATCH: "object points have rays that miss each other too far to be the same point and do not "
        "take part",
    }
    result = []
    for status, words in sentences.items():
        index = np.flatnonzero(found.status == status)
        if len(index):
            named = ", ".join(found.point[i] for i in index[:3])
            result.append(f"{len(index):,} {words} ({named}{', …' if len(index) > 3 else ''}).")
    return result


def _unmeasured(surveyed: SurveyedPoints, found: Approximation) -> list[str]:
    """A sentence about control and check points that no image shows."""
    missing = [name for name in surveyed.name if name not in set(found.point)]
    if not missing:
        return []
    listed = ", ".join(missing[:5]) + (", …" if len(missing) > 5 else "")
    return [
        f"{len(missing)} control or check points are measured in no image and do not take part: {listed}."
    ]


def _write_images(
    folder: Path,
    given: GivenOrientations,
    found: Approximation,
    unoriented: tuple[str, ...],
    exposures: pd.DataFrame,
) -> None:
    """images.parquet: heading and height above the object points of every image of the block."""
    used = (found.status == USED)[found.image_points.point]
    ground = np.full(len(given.image), np.nan)
    frame = pd.DataFrame(
        {
            "image": found.image_points.image[used],
            "z": found.frame.height(found.x_in_local[found.image_points.point[used]]),
        }
    )
    medians = frame.groupby("image")["z"].median()
    ground[medians.index.to_numpy()] = medians.to_numpy()
    above = found.frame.height(found.state.projection_centre) - ground
    absent = exposures.set_index("image").loc[list(unoriented)]
    nothing = np.full(len(unoriented), np.nan)
    names = given.mountings.names
    write_table(
        folder / "images.parquet",
        schemas.IMAGES,
        {
            "image": [*given.image, *unoriented],
            "camera": [*(names[i] for i in given.camera), *absent["camera"]],
            "strip": [*(s or None for s in given.strip), *absent["strip"]],
            "flight": [*(f or None for f in given.flight), *absent["flight"]],
            "heading_deg": np.concatenate([np.rad2deg(given.headings()) % 360.0, nothing]),
            "height_above_ground_m": np.concatenate([above, nothing]),
            "status": [USED] * len(given.image) + [_NO_ATTITUDE] * len(unoriented),
        },
    )


def _figures(
    found: Approximation, surveyed: SurveyedPoints, differences: ControlDifferences
) -> dict[str, JSON]:
    """How well the given orientations fit: residuals of tie points, differences and residuals at control."""
    names = pd.Index(found.point)
    is_surveyed = names.isin(pd.Index(surveyed.name))
    used = found.status == USED
    ties = (used & ~is_surveyed)[found.image_points.point]
    return {
        "tie_rms_px": _rms(found.residual_px[ties]),
        "control": [
            {"point": name, "dx_m": float(d[0]), "dy_m": float(d[1]), "dz_m": float(d[2]), "rays": int(rays)}
            for name, d, rays in zip(differences.point, differences.enu, differences.rays, strict=True)
        ],
        "control_reprojection_rms_px": _rms(_control_residuals(found, surveyed, names)),
    }


def _control_residuals(found: Approximation, surveyed: SurveyedPoints, names: pd.Index) -> Floats:
    """Residuals (k, 2) px of fully surveyed points projected with the given orientations."""
    row = names.get_indexer(pd.Index(surveyed.name))
    chosen: Bools = (row >= 0) & surveyed.complete
    object_point = np.full((len(names), 3), np.nan)
    object_point[row[chosen]] = surveyed.x_in_local[chosen]
    kept = np.isfinite(object_point[found.image_points.point]).all(axis=1)
    state = replace(found.state, object_point=np.nan_to_num(object_point))
    misclosure = found.image_points.misclosure(state)[kept]
    cameras = found.given.mountings.cameras
    pixel = np.array([camera.pixel_size for camera in cameras])[found.given.camera]
    return np.asarray(-misclosure / pixel[found.image_points.image[kept]][:, None] * np.array([1.0, -1.0]))


def _rms(residual_px: Floats) -> list[float] | None:
    """Root mean square of column and row, null without observations."""
    if len(residual_px) == 0:
        return None
    column, row = np.sqrt(np.mean(residual_px**2, axis=0))
    return [float(column), float(row)]
