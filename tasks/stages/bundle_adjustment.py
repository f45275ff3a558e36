"""What the stage of the bundle adjustment does."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.camera.additional.selection import NOTHING
from adjust.errors import AdjustmentError, DatumDefectError
from adjust.model_tests import examined_model
from adjust.options import AdjustmentOptions
from adjust.result import AdjustmentResult
from adjust.selection.elimination import PRESETS, Elimination
from adjust.selection.parameter_selection import SelectedAdjustment, adjust_with_selection
from adjust.solve.gauss_newton import Iteration
from adjust.solve.system import Observations
from tasks.block.assembled_block import AssembledBlock, DeliveredTables, assembled_block
from tasks.block.exposure_events import joined_to_events
from tasks.block.residual_grid import BlockGrids, block_grids
from tasks.block.residual_grid_file import write_residual_grid
from tasks.block.shared_readings import shared_readings
from tasks.coordinates.crs import MapFrame
from tasks.errors import NotComputableError
from tasks.evaluation.adjustment_figures import adjustment_figures, late_head_figures, with_estimated_sigmas
from tasks.evaluation.calibration_contradiction import contradiction_figures, contradictions_of
from tasks.evaluation.check_point_test import check_point_test, tested_points
from tasks.evaluation.distance_residuals import distance_figures, write_distance_residuals
from tasks.evaluation.influence_table import write_parameter_influences
from tasks.evaluation.model_alternatives import model_alternatives
from tasks.evaluation.model_test_tables import ExaminedModel, write_model_alternatives
from tasks.evaluation.neighbour_table import write_neighbouring_images
from tasks.evaluation.parameter_tables import write_parameters
from tasks.evaluation.residual_grid_figures import residual_grid_figures, write_residual_autocorrelation
from tasks.evaluation.residual_table import write_residuals
from tasks.evaluation.result_tables import (
    AdjustedBlock,
    write_exterior_orientations,
    write_object_points,
)
from tasks.evaluation.self_calibration_tables import (
    eliminated_parameters,
    self_calibration_figures,
    write_self_calibration,
)
from tasks.evaluation.single_errors import single_errors
from tasks.evaluation.strip_error_table import write_strip_errors
from tasks.evaluation.surveyed_differences import write_control_residuals
from tasks.files.json_text import JSON
from tasks.first_run import announce_compilation
from tasks.plausibility.lever_arm import lever_arm_suspicions, suspicions_without_rejection
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.project import ProjectSettings
from tasks.settings.trust_map import TrustMapSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.tables.parquet import read_table

_log = logging.getLogger("aerocal")

_FREE_NETWORK = (
    'For that set adjustment.datum = "free_network"; then only what does not depend on the position, '
    "attitude and scale of the whole block may be used."
)


def write_adjusted_bundle(
    folder: Path,
    tables: Mapping[str, Artifact],
    project: ProjectSettings,
    adjustment: AdjustmentSettings,
    calibrated: tuple[Artifact, Artifact] | None,
    trust_map: TrustMapSettings | None,
) -> None:
    """Adjust the block and write its tables; see `tasks.stages.bundle_adjustment_stage`."""
    delivered = DeliveredTables.of(tables)
    prepared = assembled_block(delivered, MapFrame.of(project.crs, project.heights), adjustment)
    estimated = _estimated(prepared, adjustment, trust_map is not None)
    notes = _written(folder, prepared, estimated, adjustment, delivered.exposures)
    if trust_map is not None:
        notes = _with_trust_map(folder, notes, estimated.adjusted, trust_map)
    write_notes(folder, notes)
    if calibrated is not None:
        parameters, correlations = (read_table(table) for table in calibrated)
        write_strip_errors(folder, estimated.adjusted, prepared.given, parameters, correlations)


@dataclass(frozen=True, eq=False)
class _Estimated:
    """The adjusted block; with additional parameters, how they were chosen."""

    adjusted: AdjustedBlock
    selection: SelectedAdjustment | None
    grids: BlockGrids


def _estimated(prepared: AssembledBlock, settings: AdjustmentSettings, new_points: bool) -> _Estimated:
    options = replace(
        _options(settings),
        joint_points=tested_points(prepared.block, prepared.surveyed),
        new_points=new_points,
        divisions=prepared.divisions,
    )
    try:
        block, result, selection = _adjusted(prepared.block, prepared.observations, settings, options)
    except NotComputableError as error:
        slips = suspicions_without_rejection(
            *prepared.lever_arms, prepared.block, prepared.observations, options
        )
        raise NotComputableError(" ".join((*slips, str(error)))) from error
    grids = block_grids(
        block,
        prepared.observations,
        result,
        prepared.fields,
        prepared.cameras,
        settings.residual_grid,
        options,
        _report,
    )
    result = grids.result
    sigma0 = result.test.sigma0 if settings.sigma0 == "a_posteriori" and result.test.redundancy > 0 else 1.0
    surveyed = with_estimated_sigmas(prepared.surveyed, result)
    adjusted = AdjustedBlock(block, result, *prepared.frames, sigma0, surveyed, prepared.never_used)
    # What the corrections by mean residuals have changed belongs to the selection, too.
    selection = None if selection is None else replace(selection, result=result)
    return _Estimated(adjusted, selection, grids)


def _written(
    folder: Path,
    prepared: AssembledBlock,
    estimated: _Estimated,
    settings: AdjustmentSettings,
    exposures: pd.DataFrame,
) -> Notes:
    """Write the tables; returns the figures, and what looks wrong with the lever arms."""
    adjusted, rays = estimated.adjusted, prepared.observations.image_points
    # The large tables are written next to the tests of the model, which leave a processor half of the time.
    with ThreadPoolExecutor(1) as beside:
        large = [
            beside.submit(write_residuals, folder, adjusted),
            beside.submit(write_residual_autocorrelation, folder, adjusted.block, rays, adjusted.result),
            beside.submit(write_object_points, folder, adjusted),
            beside.submit(write_exterior_orientations, folder, adjusted),
            beside.submit(write_neighbouring_images, folder, adjusted, exposures),
        ]
        notes = _written_small(folder, prepared, estimated, settings)
        for table in large:
            table.result()
    return notes


def _written_small(
    folder: Path, prepared: AssembledBlock, estimated: _Estimated, settings: AdjustmentSettings
) -> Notes:
    """Test the model, and write all but the large tables; returns as above."""
    adjusted, selection, grids = estimated.adjusted, estimated.selection, estimated.grids
    cameras = adjusted.block.cameras
    examined = _examined_model(prepared, adjusted, settings)
    write_control_residuals(folder, adjusted)
    distances = write_distance_residuals(folder, adjusted)
    eliminated: frozenset[tuple[str, str]] = frozenset()
    own_figures: JSON = None
    if prepared.calibration is not None and selection is not None:
        offered = write_self_calibration(folder, selection, prepared.calibration, adjusted.sigma0)
        eliminated = eliminated_parameters(offered)
        own_figures = self_calibration_figures(selection, offered, settings).to_json()
    parameters = write_parameters(folder, adjusted, settings.confidence, eliminated)
    write_parameter_influences(folder, adjusted, _options(settings))
    write_model_alternatives(folder, examined)
    write_residual_grid(folder, cameras, grids.grids, grids.fields, settings.confidence)
    slips = lever_arm_suspicions(*prepared.lever_arms, adjusted.block, adjusted.result)
    contradictions = contradictions_of(adjusted, prepared.known)
    checked = check_point_test(adjusted, settings.confidence)
    of_distances = distance_figures(distances, settings.confidence)
    tests = [item for item in (checked, of_distances) if item is not None]
    figures = adjustment_figures(adjusted, settings, parameters) | {
        "check_point_test": None if checked is None else checked.model_dump(mode="json"),
        "distances": None if of_distances is None else of_distances.model_dump(mode="json"),
        "check_over_limit": max((item.over_limit for item in tests if item.over_limit), default=None),
        "self_calibration": own_figures,
        "shared_moments": _shared_moments(prepared),
        "late_heads": [item.to_json() for item in late_head_figures(adjusted.result)],
        **examined.figures(),
        **contradiction_figures(contradictions),
        "residual_grid": residual_grid_figures(cameras, grids, settings.confidence),
    }
    return Notes(slips, figures, slips)


def _with_trust_map(
    folder: Path,
    notes: Notes,
    adjusted: AdjustedBlock,
    trust_map: TrustMapSettings,
) -> Notes:
    """Write the cells of the trust map; returns the notes with its grid."""
    # Loads the simulator's visibility and what that needs.
    from tasks.evaluation.trust_map import write_trust_map

    grid = write_trust_map(folder, adjusted, trust_map)
    return replace(
        notes, figures={**notes.figures, "trust_map_grid": None if grid is None else grid.to_json()}
    )


def _shared_moments(prepared: AssembledBlock) -> JSON:
    """How images of one moment were taken: as events of a rig, or as readings that several cameras share."""
    rig = prepared.block.rig
    shared = shared_readings(prepared.given) if rig is None else joined_to_events(rig)
    return None if shared is None else shared.to_json()


def _examined_model(
    prepared: AssembledBlock, adjusted: AdjustedBlock, settings: AdjustmentSettings
) -> ExaminedModel:
    """The alternatives of the model, tested at the adjusted values."""
    block = adjusted.block
    at_adjusted = replace(block, object_point=adjusted.result.state.object_point)
    alternatives = (
        *model_alternatives(at_adjusted, prepared.given, prepared.observations, prepared.cameras),
        *single_errors(adjusted),
    )
    models = [item.model for item in alternatives]
    found = examined_model(block, adjusted.result, models, _options(settings))
    return ExaminedModel.of(adjusted, alternatives, found)


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
    block: Block, observations: Observations, settings: AdjustmentSettings, options: AdjustmentOptions
) -> tuple[Block, AdjustmentResult, SelectedAdjustment | None]:
    """Run the adjustment and report its progress; with additional parameters, choose those that are kept."""
    _log.info(
        "bundle_adjustment: %d images, %d object points, %d observations, %d unknowns",
        len(block.images),
        len(block.points),
        observations.count,
        block.layout.unknowns,
    )
    announce_compilation()
    try:
        if settings.self_calibration.parameters == NOTHING:
            return block, adjust_block(block, observations, options, _report), None
        rules = PRESETS.get(settings.self_calibration.elimination)
        known = 1.0 if settings.sigma0 == "a_priori" else None
        found = adjust_with_selection(block, observations, options, rules, _report, _tell, known)
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
