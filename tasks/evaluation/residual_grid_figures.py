"""Mean residuals in figures for summary.json, and their correlation as a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.interior import FrameCamera
from adjust.observations.image_point import ImagePoints
from adjust.quality.considered import with_considered
from adjust.residual_grid.autocorrelation import Autocorrelation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.iteration import GridIteration
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.result import AdjustmentResult
from tasks.block.residual_grid import BlockGrids, autocorrelations
from tasks.files.json_text import JSON
from tasks.results.figures import (
    CameraGridFigure,
    CorrectionErrorsFigure,
    CrossStepFigure,
    GridIterationFigure,
    GridStepFigure,
    ResidualGridFigure,
    WithinCellsFigure,
)
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.residual_grid import RESIDUAL_AUTOCORRELATION

_MM = 1e-3
_UM = 1e-6


def write_residual_autocorrelation(
    folder: Path, block: Block, rays: ImagePoints, result: AdjustmentResult
) -> None:
    """residual_autocorrelation.parquet: of the residuals of an image, by the distance of its points."""
    parts = [
        _rows(camera.name, component, name, own)
        for camera, own in zip(block.cameras, autocorrelations(block, rays, result), strict=True)
        if own is not None
        for component, name in enumerate("xy")
    ]
    table = pd.concat(parts, ignore_index=True)
    write_stage_table(folder, RESIDUAL_AUTOCORRELATION, table)


def _rows(camera: str, component: int, name: str, own: Autocorrelation) -> pd.DataFrame:
    upper = own.upper / _MM
    return pd.DataFrame(
        {
            "camera": camera,
            "component": name,
            "distance_to_mm": upper,
            "distance_from_mm": np.append(0.0, upper[:-1]),
            "pairs": own.pairs[:, component],
            "correlation": own.correlation[:, component],
            "limit": np.where(own.pairs > 0, own.limit, np.nan)[:, component],
            "correlated": own.flagged[:, component],
            "sigma_relative_um": own.relative_sigma[:, component] / _UM,
        }
    )


def residual_grid_figures(cameras: tuple[FrameCamera, ...], grids: BlockGrids, confidence: float) -> JSON:
    """The size of the mean residuals of each camera, and how corrections were found."""
    errors = grids.result.cofactor.corrections
    rows = tuple(
        _camera_figure(cameras[number].name, grid, grids.fields[number], confidence).model_copy(
            update=_left_figures(grids, number)
        )
        for number, grid in enumerate(grids.grids)
        if grid is not None
    )
    remaining = None if errors is None else _remaining_figure(grids.result)
    iteration = _iteration_figure(grids.iteration)
    return ResidualGridFigure(cameras=rows, iteration=iteration, remaining=remaining).to_json()


def _remaining_figure(result: AdjustmentResult) -> CorrectionErrorsFigure:
    """Standard deviations with the errors of corrections over those without."""
    having, without = (
        with_considered(item, result.sigma0)
        for item in (result.cofactor, replace(result.cofactor, corrections=None))
    )
    heights = [np.nanmean(quality.of_points[:, 2, 2]) for quality in (having, without)]
    figure = CorrectionErrorsFigure(heights=float(np.sqrt(heights[0] / heights[1])))
    variances = [np.diagonal(quality.reduced.corner) for quality in (having, without)]
    if not len(variances[0]):
        return figure
    factors = np.sqrt(variances[0] / variances[1])
    quantity = result.layout.border_quantities[int(np.argmax(factors))]
    largest = {"factor": float(factors.max()), "parameter": quantity.name, "entity": quantity.entity}
    return figure.model_copy(update=largest)


def _left_figures(grids: BlockGrids, camera: int) -> dict[str, object]:
    """What corrections leave of the image errors of a camera."""
    errors, variation = grids.result.cofactor.corrections, grids.within[camera]
    sigma = None if errors is None else errors.sigma[camera]
    within = None
    if variation is not None:
        within = WithinCellsFigure(
            rms_um=variation.found.rms / _UM,
            probability=variation.found.probability,
            significant=variation.significant,
            enough=variation.enough,
        )
    return {
        "image_error_um": None if sigma is None else sigma / _UM,
        "parts": None if errors is None else errors.parts[camera],
        "within": within,
    }


def _camera_figure(
    camera: str, grid: ResidualGrid, field: CorrectionField | None, confidence: float
) -> CameraGridFigure:
    return CameraGridFigure(
        camera=camera,
        columns=grid.cells.columns,
        rows=grid.cells.rows,
        residuals=tuple(int(count) for count in grid.count.sum(axis=0)),
        known=int(grid.known.sum()),
        significant=int(grid.significant(confidence).sum()),
        confidence=confidence,
        expected_by_chance=grid.expected_by_chance(confidence),
        significant_jointly=int(grid.jointly_significant(confidence).sum()),
        largest_um=grid.largest / _UM,
        rms_um=_pair(grid.rms),
        noise_um=_pair(grid.noise),
        signal_um=_pair(grid.signal),
        correction_rms_um=None if field is None else _pair(field.rms),
    )


def _pair(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) / _UM for value in values)


def _iteration_figure(iteration: GridIteration | None) -> GridIterationFigure | None:
    if iteration is None:
        return None
    return GridIterationFigure(
        method=iteration.method,
        taken=iteration.taken,
        reason=iteration.reason,
        gain=iteration.gain,
        steps=tuple(
            GridStepFigure(
                number=step.number, sigma0=step.sigma0, rms_um=step.rms / _UM, noise_um=step.noise / _UM
            )
            for step in iteration.steps
        ),
        cross_validation=tuple(
            CrossStepFigure(number=step.number, mean_rms_um=step.mean_rms / _UM, residual_rms=step.rms)
            for step in iteration.cross_validation
        ),
    )
