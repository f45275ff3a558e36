"""Image errors of a camera that vary within its sub-areas, and how many of these would be enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.within_cells import WithinCells, within_cells
from adjust.result import AdjustmentResult

# In 5 of 700 blocks chance shows as much where image errors differ by several σ from cell to cell.
_BY_CHANCE = 0.001


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
