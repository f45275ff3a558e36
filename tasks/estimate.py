"""The bundle adjustment as a stage."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.calibration.elimination import Elimination
from adjust.calibration.elimination_rules import PRESETS
from adjust.calibration.parameter_selection import SelectedAdjustment, adjust_with_selection, columns_of
from adjust.errors import AdjustmentError, DatumDefectError
from adjust.model_tests import examined_model
from adjust.observations.base import ObservationGroup
from adjust.options import AdjustmentOptions
from adjust.parameters import ADDITIONAL_PARAMETERS
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
from tasks.block.model_alternatives import model_alternatives
from tasks.block.model_findings import model_findings
from tasks.block.model_test_tables import ExaminedModel, write_model_alternatives
from tasks.block.parameter_tables import write_parameters
from tasks.block.refracted_rays import without_refraction
from tasks.block.residual_grid import block_grids, with_given_corrections
from tasks.block.residual_grid_figures import (
    residual_grid_figures,
    residual_grid_sentences,
    write_residual_autocorrelation,
)
from tasks.block.residual_grid_file import write_residual_grid
from tasks.block.residual_table import write_residuals
from tasks.block.result_tables import (
    AdjustedBlock,
    write_exterior_orientations,
    write_object_points,
)
from tasks.block.self_calibration import BlockSelfCalibration, block_self_calibration
from tasks.block.self_calibration_tables import (
    eliminated_parameters,
    self_calibration_figures,
    self_calibration_sentences,
    write_self_calibration,
)
from tasks.block.strip_motion import require_motion
from tasks.block.surveyed_differences import write_control_residuals
from tasks.block.variance_figures import with_estimated_sigmas
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_from_map
from tasks.errors import NotComputableError
from tasks.first_run import announce_compilation
from tasks.plausibility.lever_arm import lever_arm_suspicions, suspicions_without_rejection
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.project import ProjectSettings
from tasks.storage.artifact import Artifact
from tasks.storage.json_text import JSON
from tasks.storage.notes import Notes, write_notes
from tasks.storage.store import stored
from tasks.tables.parquet import read_table

_log = logging.getLogger("aerocal")

_FREE_NETWORK = (
    'For that set adjustment.datum = "free_network"; then only what does not depend on the position, '
    "attitude and scale of the whole block may be used."
)


@stored("bundle_adjustment")
def adjust_bundle(
    folder: Path,
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    approximate_points: Artifact,
    approximate_boresight: Artifact,
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
    measured, camera_table = read_table(image_points), read_table(cameras)
    approximate = read_table(approximate_points)
    given, frame, _ = oriented_images(read_table(exposures), camera_table, measured, map_frame)
    require_motion(given, adjustment)
    surveyed = surveyed_points(read_table(control_points), map_frame, frame, near=approximate)
    if "control" not in adjustment.observe:
        surveyed = replace(surveyed, is_check=np.ones_like(surveyed.is_check))

    start = approximate[approximate["status"] == USED]
    x_in_local = local_from_map(map_frame, frame, start[["x_m", "y_m", "z_m"]].to_numpy(np.float64))
    calibration = block_self_calibration(given, camera_table, adjustment.self_calibration)
    begin = given.with_boresight(read_table(approximate_boresight)).orientations()
    block = block_of(frame, given, tuple(start["point"]), x_in_local, adjustment, calibration, begin)
    observations, rows = _observations(block, given, surveyed, measured, adjustment, calibration)
    rays, fields = with_given_corrections(observations.image_points, block, adjustment.residual_grid)
    observations = replace(observations, image_points=rays)
    arms = (given.mountings.names, given.mountings.lever_arm)
    try:
        block, result, selection = _adjusted(block, observations, adjustment)
    except NotComputableError as error:
        slips = suspicions_without_rejection(*arms, block, observations, _options(adjustment))
        raise NotComputableError(" ".join((*slips, str(error)))) from error
    grids = block_grids(
        block,
        observations,
        result,
        fields,
        camera_table,
        adjustment.residual_grid,
        _options(adjustment),
        _report,
    )
    result = grids.result

    never_used = np.ones(len(measured), dtype=bool)
    never_used[rows] = False
    sigma0 = result.test.sigma0 if adjustment.sigma0 == "a_posteriori" and result.test.redundancy > 0 else 1.0
    surveyed = with_estimated_sigmas(surveyed, result)
    adjusted = AdjustedBlock(block, result, map_frame, frame, sigma0, surveyed, measured[never_used])
    write_exterior_orientations(folder, adjusted)
    write_object_points(folder, adjusted)
    write_residuals(folder, adjusted)
    write_control_residuals(folder, adjusted)
    eliminated: frozenset[tuple[str, str]] = frozenset()
    problems: tuple[str, ...] = ()
    own_figures: JSON = None
    if calibration is not None and selection is not None:
        offered = write_self_calibration(folder, selection, calibration, sigma0)
        eliminated = eliminated_parameters(offered)
        own_figures = self_calibration_figures(selection, offered, adjustment)
        problems = tuple(self_calibration_sentences(selection))
    parameters = write_parameters(folder, adjusted, adjustment.confidence, eliminated)
    tested = _examined_model(adjusted, given, observations, camera_table, _options(adjustment))
    alternatives = write_model_alternatives(folder, tested)
    findings = model_findings(alternatives)
    write_residual_grid(folder, block.cameras, grids.grids, grids.fields, adjustment.confidence)
    write_residual_autocorrelation(folder, block.cameras, grids)
    figures = adjustment_figures(adjusted, adjustment, parameters) | {
        "self_calibration": own_figures,
        "model_findings": [item.to_json() for item in findings],
        **tested.figures(),
        "residual_grid": residual_grid_figures(block.cameras, grids, adjustment.confidence),
    }
    of_images = residual_grid_sentences(block.cameras, grids, adjustment.confidence)
    slips = lever_arm_suspicions(*arms, block, result)
    said = (
        *slips,
        *(item.sentence for item in findings),
        *adjustment_problems(adjusted, adjustment),
        *problems,
        *of_images,
    )
    write_notes(folder, Notes(said, figures, slips))


def _observations(
    block: Block,
    given: GivenOrientations,
    surveyed: SurveyedPoints,
    measured: pd.DataFrame,
    settings: AdjustmentSettings,
    calibration: BlockSelfCalibration | None,
) -> tuple[Observations, np.ndarray]:
    """All observation groups of the block, and the rows of the image point table that are in it."""
    rays, rows = image_point_observations(
        measured, block.images, block.points, block.camera_of_image, calibration
    )
    if settings.refraction == "standard":
        rays = without_refraction(rays, block)
    others: list[ObservationGroup] = []
    control = control_observations(block, surveyed)
    if "control" in settings.observe and control is not None:
        others.append(control)
    if "gnss" in settings.observe:
        others.append(gnss_positions(block, given, settings))
    if "ins" in settings.observe and given.attitude_observed.any():
        others.append(ins_attitudes(given, settings))
    others += priors(block, settings)
    prior = None if calibration is None else calibration.prior(settings.self_calibration.sigma_um)
    return Observations(rays, tuple(others if prior is None else [*others, prior])), rows


def _examined_model(
    adjusted: AdjustedBlock,
    given: GivenOrientations,
    observations: Observations,
    cameras: pd.DataFrame,
    options: AdjustmentOptions,
) -> ExaminedModel:
    """The alternatives of the model, tested at the adjusted values."""
    alternatives = model_alternatives(adjusted.block, given, observations, cameras)
    models = [item.model for item in alternatives]
    return ExaminedModel(
        adjusted, alternatives, examined_model(adjusted.block, adjusted.result, models, options)
    )


def _options(settings: AdjustmentSettings) -> AdjustmentOptions:
    return AdjustmentOptions(
        critical_value=settings.rejection.critical_value,
        test=settings.rejection.test,
        reference_variance=settings.rejection.reference_variance,
        robust=settings.rejection.robust,
        most_iterations=settings.max_iterations,
        confidence=settings.confidence,
        variance_components=settings.variance_components,
        control_folds=settings.control_folds,
        correlation_times=settings.estimate_correlation,
        free_network=settings.inner_constraints if settings.datum == "free_network" else None,
    )


def _adjusted(
    block: Block, observations: Observations, settings: AdjustmentSettings
) -> tuple[Block, AdjustmentResult, SelectedAdjustment | None]:
    """Run the adjustment and report its progress; with additional parameters, choose those that are kept."""
    options = _options(settings)
    _log.info(
        "bundle_adjustment: %d images, %d object points, %d observations, %d unknowns",
        len(block.images),
        len(block.points),
        observations.count,
        block.layout.unknowns,
    )
    announce_compilation()
    try:
        if not columns_of(block.layout, ADDITIONAL_PARAMETERS).any():
            return block, adjust_block(block, observations, options, _report), None
        rules = PRESETS.get(settings.self_calibration.elimination)
        found = adjust_with_selection(block, observations, options, rules, _report, _tell)
        return found.block, found.result, found
    except DatumDefectError as error:
        remedy = f" {_FREE_NETWORK}" if error.of_block and options.free_network is None else ""
        raise NotComputableError(f"{error}{remedy}") from error
    except AdjustmentError as error:
        raise NotComputableError(str(error)) from error


def _tell(elimination: Elimination) -> None:
    """One line when the additional parameters have been chosen."""
    _log.info(
        "bundle_adjustment: %d of %d additional parameters are kept",
        int(elimination.kept.sum()),
        int(elimination.candidates.sum()),
    )


def _report(iteration: Iteration) -> None:
    """One line for each iteration."""
    _log.info(
        "bundle_adjustment: iteration %d, vPv %.6g, largest change below %.2g of its standard deviation%s",
        iteration.number,
        iteration.weighted_squares,
        iteration.largest_move,
        f", damped with {iteration.damping:g}" if iteration.damping > 0 else "",
    )
