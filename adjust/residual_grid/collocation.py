"""Correction of image coordinates by least-squares collocation of their mean residuals, and adjusted again.

The most probable corrections f̂ are found through the normal equations (``mean_response``,
``expected_field``): also what orientations and object points imitate of them, and nothing where chance
explains the means. Plain means that are added again and again (``iteration``) get no further than they show.

The first step is nearly the solution; the second has the noise of the block with corrections. Several sets
are corrected together. With too many sub-areas for this, the means of each say what is wrong with its own
corrections while those of the others stay as they are: they take turns until nothing changes that shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Ints
from adjust.block import Block
from adjust.one_thread import one_thread
from adjust.options import AdjustmentOptions
from adjust.residual_grid.cross_validation import CrossStep, ImageHalves
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.image_sets import Fields, GridRule, Grids, ImageSets
from adjust.residual_grid.iteration import GridIteration, Reason, grid_step
from adjust.residual_grid.mean_response import MeanResponse, SetMeans, known_cells, together
from adjust.residual_grid.residual_grid import root_mean_square
from adjust.result import AdjustmentResult
from adjust.selection.readjustment import Readjusted

# Evidence for a field that chance hardly gives: in 80 simulated blocks of noise it was below 9.
_EVIDENCE = 12.0

# The numbers of the sets that are corrected together, and their matrices.
Responses = Sequence[tuple[list[int], MeanResponse]]


def collocate(
    block: Block,
    result: AdjustmentResult,
    cells: Sequence[FormatCells | None],
    grid_of_image: Ints,
    rule: GridRule | None = None,
    options: AdjustmentOptions | None = None,
) -> GridIteration:
    """Correct the image coordinates of an adjusted block by the fields that its mean residuals indicate.

    With cross-validation, corrections from each half of the images are tried on the other first; they are
    refused if they do not make its mean residuals smaller.

    Parameters
    ----------
    result : of the block, without corrections.
    cells : as of ``iterate_grid``; at most ``mean_response.MOST_CELLS`` of each set.
    rule : its smoothing is not used.

    Raises
    ------
    DatumDefectError, DivergenceError : as of ``adjust_block``.
    """
    rule, options = rule or GridRule(), options or AdjustmentOptions()
    sets, start = ImageSets.of(block, result, cells, grid_of_image, rule, options), Readjusted.of(result)
    before = sets.means(start)
    tried = _tried_on_halves(result, sets, start) if rule.cross_validate else ()
    now, steps = _Corrected(_nothing(before), start, before), [grid_step(0, start, before)]
    without = GridIteration(now.fields, start.state, tuple(steps), tried, "cross_validation", "collocation")
    if tried and tried[1].mean_rms > tried[0].mean_rms:
        return without
    responses = _responses(result, sets, now)
    reason: Reason = "limit"
    for number in range(1, rule.most_iterations + 1):
        after, change = now.following(sets, responses)
        if number == 1 and after is now:
            return replace(without, reason="nothing_to_model")
        now = after
        steps.append(grid_step(number, now.adjusted, now.means))
        if change <= rule.settled:
            reason = "settled"
            break
    return replace(
        without,
        fields=now.fields,
        state=now.adjusted.state,
        steps=tuple(steps),
        reason=reason,
    )


@dataclass(frozen=True, eq=False)
class _Corrected:
    """Corrections of all sets, the adjustment with them, and the mean residuals that are left."""

    fields: Fields
    adjusted: Readjusted
    means: Grids

    def following(self, sets: ImageSets, responses: Responses) -> tuple[_Corrected, float]:
        """After one more correction of all sets; the largest change over the noise."""
        now, largest = self, 0.0
        for numbers, response in responses:
            fields = [field for k in numbers if (field := now.fields[k]) is not None]
            grids = [grid for k in numbers if (grid := now.means[k]) is not None]
            with one_thread():
                expected, wrong = response.expected(fields, grids, now.adjusted.sigma0)
            if expected.evidence < _EVIDENCE:
                continue
            noise = root_mean_square(response.of_known([grid.sigma for grid in grids]))
            largest = max(largest, float(root_mean_square(wrong) / noise))
            corrected = list(now.fields)
            for k, field, more in zip(numbers, fields, response.of_cells(-wrong), strict=True):
                corrected[k] = field.plus(more)
            adjusted = sets.adjusted(tuple(corrected), now.adjusted.state)
            now = _Corrected(tuple(corrected), adjusted, sets.means(adjusted))
        return now, largest


def _nothing(means: Grids) -> Fields:
    """Corrections of zero where there is a mean."""
    return tuple(
        None if grid is None else CorrectionField(grid.cells, np.where(np.isfinite(grid.mean), 0.0, np.nan))
        for grid in means
    )


def _responses(result: AdjustmentResult, sets: ImageSets, now: _Corrected) -> Responses:
    """Those of the sets that have means."""
    of_ray, own = sets.grid_of_image[result.observations.image_points.image], dict[int, SetMeans]()
    for k, (field, grid) in enumerate(zip(now.fields, now.means, strict=True)):
        if field is not None and grid is not None and (known := known_cells(field, grid)).any():
            own[k] = SetMeans(np.flatnonzero(of_ray == k), grid, known)
    groups = together([own[k].grid.cells.count if k in own else 0 for k in range(len(now.fields))])
    with one_thread():
        return [
            (group, MeanResponse.of(result, [own[k] for k in group], sets.chosen, sets.rule.interpolation))
            for group in groups
        ]


def _tried_on_halves(result: AdjustmentResult, sets: ImageSets, start: Readjusted) -> tuple[CrossStep, ...]:
    """Before and after the first correction, which the other half of the images indicates; else nothing."""
    nothing = _nothing(sets.means(start))
    halves = ImageHalves.of(sets, nothing, start)
    if halves is None:
        return ()
    of_ray = halves.sets.grid_of_image[sets.readjustment.image_points.image] % 2
    found = []
    for half in (0, 1):
        own = replace(sets, chosen=sets.chosen & (of_ray == half)[:, None])
        means = own.means(start)
        now = _Corrected(_nothing(means), start, means)
        found.append(now.following(own, _responses(result, own, now))[0])
    first, second = found
    after = replace(halves, now=(first.adjusted, second.adjusted))
    return halves.step(0), after.step(1)
