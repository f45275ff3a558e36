"""The network of a project: its orientations as given, its image points and control; nothing is adjusted."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM
from adjust.planning.network import (
    PlannedControl,
    PlannedDistances,
    PlannedExposures,
    PlannedNetwork,
    PlannedRays,
)
from adjust.rig import RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from tasks.block.approximation import USED
from tasks.block.block_input import SurveyedPoints, image_point_observations, surveyed_points
from tasks.block.exposure_events import exposure_events
from tasks.block.given_orientations import GivenOrientations
from tasks.block.oriented_images import oriented_images
from tasks.block.self_calibration import image_format_of
from tasks.block.shared_readings import heads_of_reading
from tasks.block.strip_motion import require_motion, strip_motion
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_from_map
from tasks.settings.adjustment import AdjustmentSettings, FreeParameter
from tasks.settings.project import ProjectSettings
from tasks.store.artifact import Artifact
from tasks.tables.parquet import read_table


def network_of_project(
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    distances: Artifact,
    approximate_points: Artifact,
    approximate_orientations: Artifact,
    project: ProjectSettings,
    adjustment: AdjustmentSettings,
    free: tuple[FreeParameter, ...] = (),
) -> PlannedNetwork:
    """The network of imported deliveries with approximate object points.

    What `adjustment.observe` leaves out is left out here, too.

    Parameters
    ----------
    free : system parameters that are to be estimated.

    Raises
    ------
    InputError
        If no image can be oriented, or strips or times are missing that free parameters or correlation times
        need.
    """
    map_frame, measured = MapFrame.of(project.crs, project.heights), read_table(image_points)
    approximate = read_table(approximate_points)
    camera_table = read_table(cameras)
    given, frame, _ = oriented_images(
        read_table(exposures),
        camera_table,
        measured,
        map_frame,
        read_table(approximate_orientations),
    )
    start = approximate[approximate["status"] == USED]
    x_in_local = local_from_map(map_frame, frame, start[["x_m", "y_m", "z_m"]].to_numpy(np.float64))
    names = tuple(start["point"])
    rays, _ = image_point_observations(measured, given.image, names, given.camera)
    events = exposure_events(given)
    rig, of_events = (None, given) if events is None else (events.rig, events.given)
    require_motion(of_events, adjustment.model_copy(update={"free": free}))
    surveyed = surveyed_points(read_table(control_points), map_frame, frame, near=approximate)
    mountings = given.mountings
    rows = camera_table.set_index("camera").loc[list(mountings.names)].reset_index().to_dict("records")
    turns = tuple(int(row["calibration_axes_deg"]) for row in rows)
    interior = np.array([[camera.focal_length, *camera.principal_point] for camera in mountings.cameras])
    return PlannedNetwork(
        frame,
        mountings.cameras,
        given.flights,
        given.strips,
        _exposures(of_events, adjustment),
        x_in_local,
        PlannedRays(rays.image, rays.point, rays.sigma),
        _control(names, surveyed, "control" in adjustment.observe),
        {
            INTERIOR_ORIENTATION: interior,
            BORESIGHT: mountings.boresight,
            LEVER_ARM: mountings.lever_arm,
            RELATIVE_POSITION: mountings.relative_position,
            RELATIVE_ROTATION: mountings.relative_rotation,
            SYNCHRONISATION_OFFSET: mountings.synchronisation_offset,
        },
        tuple(image_format_of(row, turn) for row, turn in zip(rows, turns, strict=True)),
        turns,
        _distances(names, read_table(distances)),
        rig,
    )


def _exposures(given: GivenOrientations, adjustment: AdjustmentSettings) -> PlannedExposures:
    """The exposures; heads share a reading, as in `tasks.block.observation_types`."""
    centre, local_from_camera = given.orientations()
    motion, n, heads = strip_motion(given), len(given.image), heads_of_reading(given)[:, None]
    return PlannedExposures(
        given.camera,
        given.flight_of_image,
        given.strip_of_image,
        _times(given, given.strip_of_image),
        motion.velocity,
        np.nan_to_num(given.rates),
        centre,
        local_from_camera,
        given.position_sigma * np.sqrt(heads) if "gnss" in adjustment.observe else np.full((n, 3), np.nan),
        given.local_from_grid,
        np.where(
            given.attitude_observed[:, None, None], given.attitude_covariance() * heads[:, None], np.eye(3)
        ),
        given.attitude_observed & ("ins" in adjustment.observe),
    )


def _times(given: GivenOrientations, strip: Ints) -> Floats:
    """Times (n,), s; where a delivery has none, the order of the names within the strips stands for them."""
    if np.isfinite(given.time_s).all():
        return given.time_s
    return np.asarray(pd.Series(strip).groupby(strip).cumcount().to_numpy(np.float64))


def _distances(points: tuple[str, ...], table: pd.DataFrame) -> PlannedDistances | None:
    own, names = table[table["role"] == "control"], pd.Index(points)
    ends = np.stack([names.get_indexer(pd.Index(own[name])) for name in ("point", "other_point")])
    kept = (ends >= 0).all(axis=0)
    if not kept.any():
        return None
    point, other = ends[:, kept].astype(np.int64)
    return PlannedDistances(point, other, own["sigma_m"].to_numpy(np.float64)[kept])


def _control(points: tuple[str, ...], surveyed: SurveyedPoints, observed: bool) -> PlannedControl:
    index = pd.Index(points).get_indexer(pd.Index(surveyed.name)).astype(np.int64)
    kept = np.flatnonzero((index >= 0) & ~surveyed.is_check & surveyed.present.any(axis=1) & observed)
    return PlannedControl(index[kept], surveyed.covariance[kept], surveyed.present[kept])
