"""The bundle adjustment as a stage."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.errors import AdjustmentError
from adjust.observations.base import ObservationGroup
from adjust.options import AdjustmentOptions
from adjust.result import AdjustmentResult
from adjust.solve.gauss_newton import Iteration
from adjust.solve.normal_equations import Observations
from tasks.approximate import USED, oriented_images
from tasks.block.adjustment_figures import adjustment_figures, adjustment_problems
from tasks.block.block_input import (
    SurveyedPoints,
    block_of,
    gnss_positions,
    image_point_observations,
    ins_attitudes,
    priors,
    surveyed_points,
)
from tasks.block.block_input import (
    control_points as control_observations,
)
from tasks.block.given_orientations import GivenOrientations
from tasks.block.parameter_tables import write_parameters
from tasks.block.refracted_rays import without_refraction
from tasks.block.result_tables import (
    AdjustedBlock,
    write_control_residuals,
    write_exterior_orientations,
    write_object_points,
    write_residuals,
)
from tasks.block.strip_motion import require_motion
from tasks.block.variance_figures import with_estimated_sigmas
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_from_map
from tasks.errors import NotComputableError
from tasks.first_run import announce_compilation
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.project import ProjectSettings
from tasks.storage.artifact import Artifact
from tasks.storage.notes import Notes, write_notes
from tasks.storage.store import stored
from tasks.tables.parquet import read_table

_log = logging.getLogger("aerocal")


@stored("bundle_adjustment")
def adjust_bundle(
    folder: Path,
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    approximate_points: Artifact,
    project: ProjectSettings,
    adjustment: AdjustmentSettings,
) -> None:
    """Adjust the block and write orientations, points, residuals, parameters and their quality.

    Raises
    ------
    NotComputableError
        If the datum is not determined or the iteration diverges.
    """
    map_frame = MapFrame.of(project.crs, project.heights)
    measured = read_table(image_points)
    approximate = read_table(approximate_points)
    given, frame, _ = oriented_images(read_table(exposures), read_table(cameras), measured, map_frame)
    require_motion(given, adjustment)
    surveyed = surveyed_points(read_table(control_points), map_frame, frame, near=approximate)
    if "control" not in adjustment.observe:
        surveyed = replace(surveyed, is_check=np.ones_like(surveyed.is_check))

    start = approximate[approximate["status"] == USED]
    x_in_local = local_from_map(map_frame, frame, start[["x_m", "y_m", "z_m"]].to_numpy(np.float64))
    block = block_of(frame, given, tuple(start["point"]), x_in_local, adjustment)
    observations, rows = _observations(block, given, surveyed, measured, adjustment)
    result = _adjusted(block, observations, adjustment)

    never_used = np.ones(len(measured), dtype=bool)
    never_used[rows] = False
    sigma0 = result.test.sigma0 if adjustment.sigma0 == "a_posteriori" and result.test.redundancy > 0 else 1.0
    surveyed = with_estimated_sigmas(surveyed, result)
    adjusted = AdjustedBlock(block, result, map_frame, frame, sigma0, surveyed, measured[never_used])
    write_exterior_orientations(folder, adjusted)
    write_object_points(folder, adjusted)
    write_residuals(folder, adjusted)
    write_control_residuals(folder, adjusted)
    parameters = write_parameters(folder, adjusted, adjustment.confidence)
    figures = adjustment_figures(adjusted, adjustment, parameters)
    write_notes(folder, Notes(adjustment_problems(adjusted, adjustment), figures))


def _observations(
    block: Block,
    given: GivenOrientations,
    surveyed: SurveyedPoints,
    measured: pd.DataFrame,
    settings: AdjustmentSettings,
) -> tuple[Observations, np.ndarray]:
    """All observation groups of the block, and the rows of the image point table that are in it."""
    rays, rows = image_point_observations(measured, block.images, block.points, block.camera_of_image)
    if settings.refraction == "standard":
        rays = without_refraction(rays, block)
    others: list[ObservationGroup] = []
    control = control_observations(block, surveyed)
    if "control" in settings.observe and control is not None:
        others.append(control)
    if "gnss" in settings.observe:
        others.append(gnss_positions(block, given))
    if "ins" in settings.observe and given.attitude_observed.any():
        others.append(ins_attitudes(given))
    return Observations(rays, (*others, *priors(block, settings))), rows


def _adjusted(block: Block, observations: Observations, settings: AdjustmentSettings) -> AdjustmentResult:
    """Run the adjustment and report its progress."""
    options = AdjustmentOptions(
        critical_value=settings.rejection.critical_value,
        test=settings.rejection.test,
        reference_variance=settings.rejection.reference_variance,
        robust=settings.rejection.robust,
        most_iterations=settings.max_iterations,
        confidence=settings.confidence,
        variance_components=settings.variance_components,
    )
    _log.info(
        "bundle_adjustment: %d images, %d object points, %d observations, %d unknowns",
        len(block.images),
        len(block.points),
        observations.count,
        block.layout.unknowns,
    )
    announce_compilation()
    try:
        return adjust_block(block, observations, options, _report)
    except AdjustmentError as error:
        raise NotComputableError(str(error)) from error


def _report(iteration: Iteration) -> None:
    """One line for each iteration."""
    _log.info(
        "bundle_adjustment: iteration %d, vPv %.6g, largest change below %.2g of its standard deviation%s",
        iteration.number,
        iteration.weighted_squares,
        iteration.largest_move,
        f", damped with {iteration.damping:g}" if iteration.damping > 0 else "",
    )
