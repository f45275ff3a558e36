"""Sets of images that share a grid of corrections, mostly the images of a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

from adjust.arrays import Bools, Ints
from adjust.block import Block
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField, corrected
from adjust.residual_grid.residual_grid import ResidualGrid, residual_grids
from adjust.residual_grid.smoothing import Smoothing, smoothed
from adjust.result import AdjustmentResult
from adjust.selection.readjustment import Readjusted, Readjustment

Fields = tuple[CorrectionField | None, ...]
Grids = tuple[ResidualGrid | None, ...]


@dataclass(frozen=True)
class GridRule:
    """How the correction by mean residuals is carried out.

    Attributes
    ----------
    most_iterations : steps that are taken at most.
    smoothing : of the means before they are added.
    interpolation : of the correction between the cells.
    cross_validate : whether every step is tried on halves of the images first.
    settled : part of the noise of the means below which new means change nothing any more.
    """

    most_iterations: int = 5
    smoothing: Smoothing = field(default_factory=lambda: Smoothing("counts"))
    interpolation: Interpolation = "bilinear"
    cross_validate: bool = True
    settled: float = 0.1


@dataclass(frozen=True, eq=False)
class ImageSets:
    """g sets of images and the adjustment they belong to.

    Attributes
    ----------
    readjustment : of the block.
    chosen : (n, 2) the residuals of image points that count.
    cells : the sub-areas of each set; None for one without image points.
    grid_of_image : (images,) index of the set of each image.
    rule : how means become corrections.
    """

    readjustment: Readjustment
    chosen: Bools
    cells: tuple[FormatCells | None, ...]
    grid_of_image: Ints
    rule: GridRule

    @classmethod
    def of(
        cls,
        block: Block,
        result: AdjustmentResult,
        cells: Sequence[FormatCells | None],
        grid_of_image: Ints,
        rule: GridRule,
        options: AdjustmentOptions,
    ) -> Self:
        """Of a block; its result says which residuals take part and how well they are controlled."""
        readjustment = Readjustment.of(block, result, options)
        return cls(readjustment, controlled(result.groups[0]), tuple(cells), grid_of_image, rule)

    def means(self, now: Readjusted) -> Grids:
        """Mean residuals of every set."""
        rays = self.readjustment.image_points
        return residual_grids(self.cells, self.grid_of_image, rays.image, rays.xy, now.residual, self.chosen)

    def added(self, fields: Fields, means: Grids) -> Fields:
        """The corrections with the smoothed means of every set added."""
        return tuple(
            None if field is None or grid is None else field.plus(smoothed(grid, self.rule.smoothing))
            for field, grid in zip(fields, means, strict=True)
        )

    def adjusted(self, fields: Fields, start: State) -> Readjusted:
        """The block adjusted with these corrections, from the values of a state."""
        rays = self.readjustment.image_points
        return self.readjustment.adjust(
            corrected(rays, fields, self.grid_of_image, self.rule.interpolation), start
        )
