"""Mean residuals of the images of each camera, and their use as corrections of the image coordinates.

The order: corrections from a file, if the project names one, are there from the beginning. The block is
adjusted (and its additional parameters chosen). Then, if requested, mean residuals are added to the image
coordinates until the cross-validation refuses; the last adjustment is a complete one again. Image errors may
vary within the sub-areas, and more of these be enough.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isqrt

import numpy as np
import pandas as pd

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.camera.additional.calibration_axes import calibration_from_image
from adjust.camera.interior import FrameCamera
from adjust.errors import AdjustmentError
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from adjust.residual_grid.autocorrelation import Autocorrelation, autocorrelation
from adjust.residual_grid.collocation import collocate
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Interpolation, Seams
from adjust.residual_grid.image_correction import CorrectionField, corrected
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import GridIteration, iterate_grid
from adjust.residual_grid.mean_response import MOST_TOGETHER
from adjust.residual_grid.remaining_errors import remaining_errors, with_correction_errors
from adjust.residual_grid.residual_grid import ResidualGrid, residual_grids
from adjust.residual_grid.smoothing import Smoothing
from adjust.residual_grid.within_cells import WithinCells, within_cells
from adjust.result import AdjustmentResult
from adjust.selection.parameter_selection import without_priors_of_held
from adjust.solve.gauss_newton import Progress
from adjust.solve.system import Observations
from tasks.block.residual_grid_file import read_corrections
from tasks.errors import InputError, NotComputableError
from tasks.files.json_text import from_json
from tasks.settings.adjustment import ResidualGridSettings

_log = logging.getLogger("aerocal")
_MM = 1e-3
_UM = 1e-6
_MOST_CELLS = 25
_AIM_PER_CELL = 25

Fields = tuple[CorrectionField | None, ...]
# In 5 of 700 blocks chance shows as much where image errors differ by several σ from cell to cell.
_BY_CHANCE = 0.001


@dataclass(frozen=True, eq=False)
class BlockGrids:
    """Mean residuals of the cameras of a block; one entry for each camera, None without images.

    Attributes
    ----------
    result : of the adjustment with all corrections, and with what they leave in its covariances.
    grids : mean residuals that are left.
    fields : corrections of the image coordinates; None where there are none.
    iteration : how the corrections were found; None where they were not iterated.
    within : image errors within the sub-areas; None where nothing was to be corrected.
    """

    result: AdjustmentResult
    grids: tuple[ResidualGrid | None, ...]
    fields: Fields
    iteration: GridIteration | None
    within: tuple[VariationWithin | None, ...]


def with_given_corrections(
    rays: ImagePoints, block: Block, settings: ResidualGridSettings
) -> tuple[ImagePoints, Fields]:
    """The image points corrected by the residual grids the settings name.

    Raises
    ------
    InputError
        If a file does not fit a camera.
    """
    nothing: Fields = (None,) * len(block.cameras)
    if not settings.file:
        return rays, nothing
    fields = read_corrections(settings.file, block.cameras, _image_points(rays, block) > 0)
    return corrected(rays, fields, block.camera_of_image, settings.interpolation), fields


def block_grids(
    block: Block,
    observations: Observations,
    result: AdjustmentResult,
    fields: Fields,
    cameras: pd.DataFrame,
    settings: ResidualGridSettings,
    options: AdjustmentOptions,
    progress: Progress,
) -> BlockGrids:
    """Mean residuals of an adjusted block, after their iteration where that is required.

    Parameters
    ----------
    observations : of the block as stated, the image points with the corrections `fields`.
    result : of their adjustment.
    cameras : cameras.parquet, for the seams of composed images.

    Raises
    ------
    InputError
        If there are fewer sub-areas than CCD images.
    NotComputableError
        If an adjustment with corrections fails.
    """
    rays = observations.image_points
    cells = _cells(rays, block, fields, cameras, settings)
    iteration = None
    if settings.iterations > 0:
        try:
            iteration = _iterated(block, result, cells, fields, settings, options)
            if iteration.taken:
                fields = iteration.fields
                observations = replace(
                    without_priors_of_held(block, observations),
                    image_points=corrected(rays, fields, block.camera_of_image, settings.interpolation),
                )
                result = adjust_block(block, observations, options, progress)
        except AdjustmentError as error:
            raise NotComputableError(f"With corrections by mean residuals: {error}") from error
    residual, chosen = result.groups[0].residual, controlled(result.groups[0])
    grids = residual_grids(cells, block.camera_of_image, rays.image, rays.xy, residual, chosen)
    # Where no correction was taken, what the means indicate is left all the same.
    tried = fields if iteration is None else iteration.fields
    errors = remaining_errors(result, tried, block.camera_of_image, settings.interpolation)
    within = tuple(
        None
        if field is None
        else variation_within(
            number,
            field.cells,
            _finer(camera, _seams(camera, cameras), field.cells, int(count)),
            result,
            settings.interpolation,
        )
        for number, (camera, field, count) in enumerate(
            zip(block.cameras, tried, _image_points(rays, block), strict=True)
        )
    )
    return BlockGrids(with_correction_errors(result, errors), grids, fields, iteration, within)


def _finer(
    camera: FrameCamera, seams: Seams, cells: FormatCells, image_points: int
) -> tuple[FormatCells, ...]:
    """Up to three times as many sub-areas along a side, as far as there are image points for them."""
    number, most = max(cells.columns, cells.rows), _number_of_cells(image_points)
    least = max(number, len(seams.x), len(seams.y))
    tried = {min(most, number * part // 2) for part in (3, 4, 6)}
    return tuple(FormatCells.of(camera.half_format, more, seams) for more in sorted(tried) if more > least)


def _image_points(rays: ImagePoints, block: Block) -> np.ndarray:
    """Number of image points of every camera."""
    return np.bincount(block.camera_of_image[rays.image], minlength=len(block.cameras))


def _cells(
    rays: ImagePoints,
    block: Block,
    fields: Fields,
    cameras: pd.DataFrame,
    settings: ResidualGridSettings,
) -> tuple[FormatCells | None, ...]:
    """The sub-areas of every camera that has image points; those of its corrections where there are some."""
    most = _most_cells(int(np.count_nonzero(_image_points(rays, block))), settings)
    found: list[FormatCells | None] = []
    for camera, count, field in zip(block.cameras, _image_points(rays, block), fields, strict=True):
        if count == 0 or field is not None:
            found.append(None if field is None else field.cells)
        else:
            found.append(_cells_of(camera, _seams(camera, cameras), int(count), settings.cells, most))
    return tuple(found)


def _most_cells(cameras: int, settings: ResidualGridSettings) -> int:
    """Along a side, of each camera: so few that collocation corrects all cameras together."""
    if settings.method != "collocation" or cameras < 2:
        return _MOST_CELLS
    return max(1, min(_MOST_CELLS, isqrt(MOST_TOGETHER // cameras)))


def _cells_of(camera: FrameCamera, seams: Seams, count: int, number: int | None, most: int) -> FormatCells:
    tiles = max(len(seams.x), len(seams.y)) + 1
    if number is None:
        number = max(tiles, min(most, _number_of_cells(count)))
    if number < tiles:
        raise InputError(
            f"{number} × {number} sub-areas are fewer than the CCD images of the camera.",
            f"Set adjustment.residual_grid.cells to {tiles} at least.",
            entity=f"camera {camera.name}",
        )
    return FormatCells.of(camera.half_format, number, seams)


def _number_of_cells(count: int) -> int:
    """As many along a side as image points allow."""
    return int(np.clip(np.sqrt(count / _AIM_PER_CELL), 1, _MOST_CELLS))


def _seams(camera: FrameCamera, cameras: pd.DataFrame) -> Seams:
    """Seams of a camera in the image system, from those in its calibration axes."""
    row = cameras[cameras["camera"] == camera.name]
    tiles, turn_deg = row["tiles"].item(), int(row["calibration_axes_deg"].item())
    if not isinstance(tiles, str):
        return Seams()
    layout, turned = from_json(tiles), calibration_from_image(turn_deg)
    found: list[tuple[float, ...]] = [(), ()]
    for axis, name in enumerate(("seams_x_mm", "seams_y_mm")):
        # A calibration axis is an image axis or its opposite.
        own = int(np.argmax(np.abs(turned[axis])))
        values = turned[axis, own] * np.array(layout[name], dtype=np.float64) * _MM
        found[own] = tuple(float(value) for value in np.sort(values) + camera.principal_point[own])
    return Seams(*found)


def _iterated(
    block: Block,
    result: AdjustmentResult,
    cells: Sequence[FormatCells | None],
    fields: Fields,
    settings: ResidualGridSettings,
    options: AdjustmentOptions,
) -> GridIteration:
    rule = GridRule(
        settings.iterations,
        Smoothing(settings.smoothing, settings.smoothing_width),
        settings.interpolation,
        settings.cross_validation,
    )
    if settings.method == "collocation":
        found = collocate(block, result, cells, block.camera_of_image, rule, options)
    else:
        start = tuple(
            CorrectionField.zero(own) if own is not None and field is None else field
            for own, field in zip(cells, fields, strict=True)
        )
        found = iterate_grid(block, result, cells, block.camera_of_image, rule, options, start)
    for step in found.steps:
        _log.info(
            "bundle_adjustment: corrected %d times by mean residuals: σ0 %.4f, remaining means of %.3f µm",
            step.number,
            step.sigma0,
            step.rms / _UM,
        )
    return found


def autocorrelations(
    block: Block, rays: ImagePoints, result: AdjustmentResult
) -> tuple[Autocorrelation | None, ...]:
    """Correlation of the residuals of each camera by the distance of image points; None without images."""
    residual, chosen = result.groups[0].residual, controlled(result.groups[0])
    camera = block.camera_of_image[rays.image]
    found = []
    for number in range(len(block.cameras)):
        rows = np.flatnonzero(camera == number)
        v = np.where(chosen[rows], residual[rows], np.nan)
        found.append(autocorrelation(rays.image[rows], rays.xy[rows], v) if len(rows) else None)
    return tuple(found)


@dataclass(frozen=True)
class VariationWithin:
    """Image errors within the sub-areas of a camera.

    Attributes
    ----------
    found : what residuals say of them.
    significant : whether it is more than chance.
    enough : number of sub-areas along a side within which residuals show no more than chance; None if these
        are enough, or none of those looked at.
    """

    found: WithinCells
    significant: bool
    enough: int | None


def variation_within(
    camera: int,
    cells: FormatCells,
    finer: Sequence[FormatCells],
    result: AdjustmentResult,
    interpolation: Interpolation,
) -> VariationWithin | None:
    """The variation of image errors within the sub-areas of a camera; None with too few image points.

    Parameters
    ----------
    camera : its number.
    finer : more sub-areas, in the order in which they are tried.
    """
    rays = result.observations.image_points
    rows = np.flatnonzero(result.block.camera_of_image[rays.image] == camera)
    residual, chosen = result.groups[0].residual[rows], controlled(result.groups[0])[rows]

    def within(tried: FormatCells) -> WithinCells | None:
        return within_cells(tried, interpolation, rays.image[rows], rays.xy[rows], residual, chosen)

    found = within(cells)
    if found is None or found.probability >= _BY_CHANCE:
        return None if found is None else VariationWithin(found, False, None)
    for tried in finer:
        left = within(tried)
        if left is not None and left.probability >= _BY_CHANCE:
            return VariationWithin(found, True, tried.columns)
    return VariationWithin(found, True, None)
