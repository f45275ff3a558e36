"""Mean residuals in figures for summary.json, in sentences, and their correlation as a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.residual_grid.autocorrelation import Autocorrelation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.iteration import GridIteration
from adjust.residual_grid.residual_grid import ResidualGrid
from tasks.block.residual_grid import BlockGrids
from tasks.files.json_text import JSON
from tasks.results.figures import (
    CameraGridFigure,
    CrossStepFigure,
    GridIterationFigure,
    GridStepFigure,
    ResidualGridFigure,
)
from tasks.tables import schemas
from tasks.tables.parquet import write_table

_MM = 1e-3
_UM = 1e-6
# Chance makes the share of significant sub-areas scatter; beyond so many of its σ it is not chance.
_NOT_BY_CHANCE = 4.0
# Correlations of neighbours up to this distance are what the model should have taken out.
_NEIGHBOURS_M = 4e-3
# Weaker ones are of no consequence.
_LEAST_CORRELATION = 0.05
_REASONS = {
    "nothing_to_model": "chance alone explains the mean residuals",
    "cross_validation": "another correction would have increased the mean residuals of the images left out",
    "settled": "another correction would have changed nothing",
    "limit": "the maximum number of corrections was reached",
}


def write_residual_autocorrelation(folder: Path, cameras: tuple[FrameCamera, ...], grids: BlockGrids) -> None:
    """residual_autocorrelation.parquet: of the residuals of an image, by the distance of its points."""
    parts = [
        _rows(camera.name, component, name, own)
        for camera, own in zip(cameras, grids.autocorrelations, strict=True)
        if own is not None
        for component, name in enumerate("xy")
    ]
    table = pd.concat(parts, ignore_index=True)
    write_table(
        folder / "residual_autocorrelation.parquet",
        schemas.RESIDUAL_AUTOCORRELATION,
        {name: table[name].to_numpy() for name in table.columns},
    )


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
    """What the mean residuals of each camera amount to, and how corrections were found."""
    rows = tuple(
        _camera_figure(camera.name, grid, field, confidence)
        for camera, grid, field in zip(cameras, grids.grids, grids.fields, strict=True)
        if grid is not None
    )
    return ResidualGridFigure(cameras=rows, iteration=_iteration_figure(grids.iteration)).to_json()


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
        taken=iteration.taken,
        reason=iteration.reason,
        stopped_because=_REASONS[iteration.reason],
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


def residual_grid_sentences(
    cameras: tuple[FrameCamera, ...], grids: BlockGrids, confidence: float
) -> list[str]:
    """What the user should know: what was corrected, what is left, and correlated neighbours."""
    sentences = _corrected(grids.iteration)
    for camera, grid, own in zip(cameras, grids.grids, grids.autocorrelations, strict=True):
        if grid is not None:
            sentences += _systematic(camera.name, grid, confidence)
        if own is not None:
            sentences += _correlated(camera.name, own)
    return sentences


def _corrected(iteration: GridIteration | None) -> list[str]:
    if iteration is None:
        return []
    reason = _REASONS[iteration.reason]
    if iteration.taken == 0:
        return [f"The image coordinates were not corrected by their mean residuals: {reason}."]
    first, last = iteration.steps[0], iteration.steps[-1]
    times = "once" if iteration.taken == 1 else f"{iteration.taken} times"
    return [
        f"The image coordinates were corrected {times} by their mean residuals, which changed σ0 from "
        f"{first.sigma0:.3f} to {last.sigma0:.3f}; {reason}."
    ]


def _systematic(camera: str, grid: ResidualGrid, confidence: float) -> list[str]:
    known, found = int(grid.known.sum()), int(grid.significant(confidence).sum())
    expected = grid.expected_by_chance(confidence)
    if found <= expected + _NOT_BY_CHANCE * np.sqrt(expected * confidence) or known == 0:
        return []
    return [
        f"Systematic image residuals of camera {camera}: up to {grid.largest / _UM:.1f} µm in sub-areas of "
        f"the image, significant in {100 * found / known:.0f} % of {known} (by chance: "
        f"{100 * (1 - confidence):.0f} %)."
    ]


def _correlated(camera: str, own: Autocorrelation) -> list[str]:
    near = own.upper <= _NEIGHBOURS_M
    found = np.where(own.flagged & near[:, None], np.nan_to_num(own.correlation), 0.0)
    strongest = float(found.max())
    if strongest < _LEAST_CORRELATION:
        return []
    reach = own.upper[np.argmax(found.max(axis=1))] / _MM
    return [
        f"Residuals of neighbouring image points of camera {camera} are correlated (up to {strongest:.2f} "
        f"below {reach:g} mm). Their common errors are not modelled, and the standard deviations are too "
        "small."
    ]
