"""A block oriented by GNSS, INS and a calibration, with all sources of its errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adjust.approximate.intersection import Intersection, intersect
from adjust.arrays import Floats
from adjust.block import Block
from adjust.georeferencing.direct_orientation import DirectOrientations, direct_orientations
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources
from adjust.observations.image_point import ImagePoints
from adjust.parameters import TIME_OFFSET
from tasks.block.block_input import block_of, image_point_observations, surveyed_points
from tasks.block.given_orientations import GivenOrientations, Mountings
from tasks.block.observation_types import gnss_positions, ins_attitudes
from tasks.block.oriented_images import oriented_images
from tasks.block.refracted_rays import without_refraction
from tasks.block.residual_grid import with_given_corrections
from tasks.block.self_calibration import BlockSelfCalibration, block_self_calibration
from tasks.block.shared_readings import heads_of_reading, reading_of_image
from tasks.block.strip_motion import require_successive_times
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame
from tasks.errors import InputError
from tasks.georeferencing.calibrated_cameras import calibrated_cameras
from tasks.georeferencing.calibrated_system import CalibratedSystem, calibrated_system
from tasks.georeferencing.calibration import Calibration
from tasks.georeferencing.shared_observations import SharedExposures, same_exposures, shared_errors
from tasks.settings.adjustment import AdjustmentSettings, SelfCalibrationSettings
from tasks.settings.direct_georeferencing import DirectGeoreferencingSettings
from tasks.settings.quality import ChecksSettings


@dataclass(frozen=True, eq=False)
class Delivery:
    """The input of a check: exposures, cameras, image points, control points (tables), and the CRS."""

    exposures: pd.DataFrame
    cameras: pd.DataFrame
    measured: pd.DataFrame
    control_points: pd.DataFrame
    map_frame: MapFrame


@dataclass(frozen=True, eq=False)
class CheckRules:
    """Settings of a check: its own, those shared with the adjustment, the minimum angle of intersection.

    Shared are refraction, corrections by mean residuals, biases of strips and errors correlated over time.
    """

    direct: DirectGeoreferencingSettings
    adjustment: AdjustmentSettings
    checks: ChecksSettings


@dataclass(frozen=True, eq=False)
class DirectlyOriented:
    """n images oriented without control, and m points intersected from them.

    Attributes
    ----------
    frame, map_frame : the local frame, and the CRS of the project.
    given : the images as delivered, with the calibrated mountings.
    points : names of the points.
    rays : their image points, refraction taken off and mean residuals added.
    object_point : (m, 3) their intersections, metres, local frame.
    sources : orientations, and what makes them wrong.
    flights : flight → flight of the calibration whose GNSS shift it has.
    from_calibration : how many exposures the calibration was made with, too.
    not_oriented : measured images without position or attitude of their own.
    """

    frame: AdjustmentFrame
    map_frame: MapFrame
    given: GivenOrientations
    points: tuple[str, ...]
    rays: ImagePoints
    object_point: Floats
    sources: ErrorSources
    flights: dict[str, str]
    from_calibration: SharedExposures
    not_oriented: tuple[str, ...]


def directly_oriented(delivery: Delivery, calibration: Calibration, rules: CheckRules) -> DirectlyOriented:
    """Orient the measured images with a calibration, and intersect all points that at least two images show.

    Points whose rays are nearly parallel or meet behind a camera are left out.

    Raises
    ------
    InputError
        If no image has an attitude, or the calibration does not fit the cameras and flights.
    """
    given, frame, not_oriented = _observed_images(delivery)
    require_successive_times(given, rules.adjustment)
    names = list(given.mountings.names)
    cameras = delivery.cameras.set_index("camera", drop=False).loc[names].reset_index(drop=True)
    cameras = calibrated_cameras(cameras, calibration)
    given = replace(given, mountings=Mountings.from_table(cameras))
    additional = block_self_calibration(given, cameras, SelfCalibrationSettings())
    measured = delivery.measured[delivery.measured["image"].isin(given.image)]
    seen = measured.groupby("point").size()
    points = tuple(str(name) for name in seen.index[seen >= 2])
    block = block_of(frame, given, points, np.zeros((len(points), 3)), AdjustmentSettings(), additional)
    system = calibrated_system(block, calibration, rules.direct.shift_of_flight)
    block = replace(block, system=system.parameters)
    _require_times(block, given)
    # Every head has the error of the reading it shares, and not that with which an adjustment counts it once.
    once = 1.0 / np.sqrt(heads_of_reading(given))[:, None]
    orientations = direct_orientations(
        gnss_positions(block, given, rules.adjustment).rescaled(once),
        ins_attitudes(given, rules.adjustment).rescaled(once),
        block.approximate_state().system,
        reading_of_image(given),
    )
    block, rays = _intersected(block, measured, additional, orientations, rules)
    common = _common_to_strip(given, rules)
    errors, shared = _with_shared(delivery, calibration, system, given, frame, orientations)
    return DirectlyOriented(
        frame,
        delivery.map_frame,
        given,
        block.points,
        rays,
        block.object_point,
        ErrorSources(orientations, given.strip_of_image, common, errors),
        dict(system.flights),
        shared,
        not_oriented,
    )


def _with_shared(
    delivery: Delivery,
    calibration: Calibration,
    system: CalibratedSystem,
    given: GivenOrientations,
    frame: AdjustmentFrame,
    orientations: DirectOrientations,
) -> tuple[CalibrationErrors, SharedExposures]:
    """Errors of the calibration with what they share with this flight, if it is the one it comes from."""
    flight = calibration.flight
    if flight is None or not system.estimated:
        return system.errors, SharedExposures()
    images = same_exposures(flight, delivery.exposures, delivery.map_frame.name)
    used = flight.influences.loc[flight.influences["observation"] == "position", "name"].unique()
    counted = SharedExposures(int(np.isin(used, list(images)).sum()), len(used))
    if counted.shared == 0:
        return system.errors, counted
    surveyed = surveyed_points(delivery.control_points, delivery.map_frame, frame)
    shared = shared_errors(flight, images, system, given, orientations, surveyed, delivery.control_points)
    return replace(system.errors, shared=shared), counted


def _observed_images(delivery: Delivery) -> tuple[GivenOrientations, AdjustmentFrame, tuple[str, ...]]:
    """Measured images with position and attitude, the local frame, and the others."""
    given, frame, unoriented = oriented_images(
        delivery.exposures, delivery.cameras, delivery.measured, delivery.map_frame
    )
    observed = given.attitude_observed & given.position_observed
    if not observed.any():
        raise InputError(
            "None of the measured images has position and attitude, so direct georeferencing is not "
            "possible.",
            "Give x, y, z and ω, φ, κ or heading, pitch, roll in the exposures.",
        )
    others = [name for name, known in zip(given.image, observed, strict=True) if not known]
    return given.only(observed), frame, tuple(sorted([*unoriented, *others]))


def _require_times(block: Block, given: GivenOrientations) -> None:
    """Refuse a calibrated time offset without velocities, which its effect depends on."""
    has_offset = any(item.family.name == TIME_OFFSET and item.values.any() for item in block.system)
    if has_offset and not np.isfinite(given.time_s).all():
        raise InputError(
            "The calibration has a time offset, but the exposures have no times.",
            "Add a time column (seconds) to the exposures.",
        )


def _intersected(
    block: Block,
    measured: pd.DataFrame,
    additional: BlockSelfCalibration | None,
    orientations: DirectOrientations,
    rules: CheckRules,
) -> tuple[Block, ImagePoints]:
    """The block with its points intersected where possible, and their corrected rays."""
    state = orientations.state
    block = replace(
        block, projection_centre=state.projection_centre, local_from_camera=state.local_from_camera
    )
    rays, _ = image_point_observations(
        measured, block.images, block.points, block.camera_of_image, additional
    )
    found = intersect(rays, state, len(block.points))
    kept = np.flatnonzero(_well_intersected(found, rules))
    points = tuple(block.points[j] for j in kept)
    block = replace(block, points=points, object_point=found.object_point[kept])
    rays, _ = image_point_observations(measured, block.images, points, block.camera_of_image, additional)
    if rules.adjustment.refraction == "standard":
        rays = without_refraction(rays, block)
    rays, _ = with_given_corrections(rays, block, rules.adjustment.residual_grid)
    return replace(block, object_point=intersect(rays, state, len(points)).object_point), rays


def _well_intersected(found: Intersection, rules: CheckRules) -> np.ndarray:
    """(m,) points whose rays meet in front of the cameras under an angle that is not too small."""
    least = np.deg2rad(rules.checks.min_intersection_angle_deg)
    return np.asarray(found.usable & (found.angle >= least))


def _common_to_strip(given: GivenOrientations, rules: CheckRules) -> Floats:
    """Standard deviations (6,) of what is common to a strip: east, north, up; roll, pitch, yaw.

    Raises
    ------
    InputError
        If there are such errors and the strips are not known.
    """
    position = rules.direct.strip_bias_m
    if position is None:
        is_free = "gnss_strip_bias" in rules.adjustment.free
        position = rules.adjustment.priors.gnss_strip_bias_m if is_free else (0.0, 0.0, 0.0)
    common = np.array([*position, *np.deg2rad(rules.direct.strip_bias_deg)])
    if common.any() and not all(given.strip):
        raise InputError(
            "The exposures contain no strips, but errors common to a strip are declared.",
            "Add a strip column to the exposures, or set direct_georeferencing.strip_bias_m and "
            "strip_bias_deg to 0.",
            entity="direct_georeferencing.strip_bias_m",
        )
    return common
