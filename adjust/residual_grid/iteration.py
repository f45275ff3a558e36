"""Correction of image coordinates by their mean residuals, iterated: grid ← grid + means(v), adjust again.

One pass corrects little more than half of the systematic errors: what orientations and object points have
absorbed does not show in the residuals, and moves there only in the next adjustment. Every step leaves
the part I − M of the errors, M the way from errors that all images share to mean residuals; as residuals
are a projection of errors, the eigenvalues of M lie between 0 and 1, so plain means converge and never
overshoot. (Means over redundancy numbers, Σv/Σr, would be faster, but diverge where these are below ½ and
nothing is absorbed.)

Repeated without end the grid follows the noise. Three things end the iteration:

* the first means are no larger than their standard deviations explain: there is nothing to model;
* a step that was first tried on halves of the images (``grid_cross_validation``) does not make the means
  of the images smaller that were not used in it; it is not taken;
* the new means are a small part of the noise of the first ones. To stop as soon as they are smaller than
  that noise would be too early: it has been corrected with the rest and is not in the new means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from adjust.arrays import Ints
from adjust.block import Block
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.residual_grid.cross_validation import CrossStep, ImageHalves
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.image_sets import Fields, GridRule, Grids, ImageSets
from adjust.result import AdjustmentResult
from adjust.selection.readjustment import Readjusted

Reason = Literal["nothing_to_model", "cross_validation", "settled", "limit"]
CorrectionMethod = Literal["means", "collocation"]


@dataclass(frozen=True)
class GridStep:
    """State after a number of steps; lengths in metres.

    Attributes
    ----------
    number : of steps taken.
    sigma0 : of the adjustment.
    rms, noise : of the mean residuals that are left, over the cells and both coordinates of all sets: their
        size, and what chance alone would give.
    """

    number: int
    sigma0: float
    rms: float
    noise: float


@dataclass(frozen=True, eq=False)
class GridIteration:
    """Corrections of the image coordinates, and how they were found.

    Attributes
    ----------
    fields : the correction of each set of images.
    state : adjusted values with the corrections.
    steps : before the first step and after each.
    cross_validation : likewise; empty where it was not requested or the halves have too few image points.
    reason : why no further step was taken.
    method : how corrections follow from means.
    """

    fields: Fields
    state: State
    steps: tuple[GridStep, ...]
    cross_validation: tuple[CrossStep, ...]
    reason: Reason
    method: CorrectionMethod = "means"

    @property
    def taken(self) -> int:
        """Number of steps."""
        return self.steps[-1].number

    @property
    def gain(self) -> float:
        """Part of vᵀPv of the image points that corrections from the other half of the images take away.

        Of the best step, even if it was refused: below zero where there is nothing to model. NaN without
        cross-validation.
        """
        if len(self.cross_validation) < 2:
            return float("nan")
        best = min(step.rms for step in self.cross_validation[1:])
        return 1.0 - (best / self.cross_validation[0].rms) ** 2


def iterate_grid(
    block: Block,
    result: AdjustmentResult,
    cells: Sequence[FormatCells | None],
    grid_of_image: Ints,
    rule: GridRule | None = None,
    options: AdjustmentOptions | None = None,
    start: Fields | None = None,
) -> GridIteration:
    """Correct the image coordinates of an adjusted block by its mean residuals.

    Parameters
    ----------
    result : of the block, with the corrections ``start`` if there are any; it says which observations take
        part and how well they are controlled.
    cells : the sub-areas of each of the g sets of images; None for one without image points.
    grid_of_image : (images,) index into them, mostly that of the camera.
    start : corrections the image points have from before.

    Raises
    ------
    DatumDefectError, DivergenceError : as of ``adjust_block``.
    """
    rule, options = rule or GridRule(), options or AdjustmentOptions()
    sets = ImageSets.of(block, result, cells, grid_of_image, rule, options)
    fields = start or tuple(None if own is None else CorrectionField.zero(own) for own in cells)
    now = Readjusted.of(result)
    means = sets.means(now)
    halves = ImageHalves.of(sets, fields, now) if rule.cross_validate else None
    steps = [grid_step(0, now, means)]
    tried = [] if halves is None else [halves.step(0)]
    reason: Reason = "limit"
    for number in range(1, rule.most_iterations + 1):
        if not steps[-1].rms > (1.0 if number == 1 else rule.settled) * steps[0].noise:
            reason = "nothing_to_model" if number == 1 else "settled"
            break
        if halves is not None:
            halves = halves.following()
            tried.append(halves.step(number))
            if not tried[-1].mean_rms < tried[-2].mean_rms:
                reason = "cross_validation"
                break
        fields = sets.added(fields, means)
        now = sets.adjusted(fields, now.state)
        means = sets.means(now)
        steps.append(grid_step(number, now, means))
    return GridIteration(fields, now.state, tuple(steps), tuple(tried), reason)


def grid_step(number: int, now: Readjusted, means: Grids) -> GridStep:
    """Figures over all sets together; zero where no cell has enough image points."""
    there = [grid for grid in means if grid is not None]
    if not any(grid.known.any() for grid in there):
        return GridStep(number, now.sigma0, 0.0, 0.0)
    rms, noise = (
        float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
        for values in (
            [grid.mean[np.isfinite(grid.mean)] for grid in there],
            [grid.sigma[np.isfinite(grid.mean)] for grid in there],
        )
    )
    return GridStep(number, now.sigma0, rms, noise)
