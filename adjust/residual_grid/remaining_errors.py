"""What corrections by mean residuals leave of systematic image errors, in everything that is adjusted.

Errors δ of the corrections f move the unknowns by H δ, H = N⁻¹ AᵀP E (``mean_response``). With the most
probable true corrections f̂ and their covariance (``expected_field``), wherever f came from,

    Cov(x) = σ0² N⁻¹ + H [(f − f̂)(f − f̂)ᵀ + Cov(f*)] Hᵀ

The noise of the means is made of residuals alone, which are independent of what random errors do to the
unknowns: both add up.

Cells that are too coarse for the errors of the camera leave what varies within them, so f* is looked for in
finer cells, where residuals and time allow. Their number along the side of a cell is odd: f has a value at
the middle of each, and is the same between them except next to finer cells without residuals.

Of δ only those combinations are kept that move an unknown by more than a part of its σ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isqrt

import numpy as np
from scipy import linalg

from adjust.arrays import Bools, Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.control_point import ControlPoints
from adjust.one_thread import one_thread
from adjust.quality.control_checks import k_fold, leave_one_out
from adjust.quality.unknown_errors import CorrectionErrors, errors_of_families, in_datum
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.mean_response import (
    MOST_CELLS,
    MOST_TOGETHER,
    MeanResponse,
    SetMeans,
    known_cells,
    together,
)
from adjust.residual_grid.residual_grid import LEAST_IN_CELL, ResidualGrid
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.full_vectors import FullVectors, joined, solve_full

# Of finer cells there are no more, so that they take some seconds only.
_MOST_FINER = 1_300
# What is left out adds less than this part of σ0² N⁻¹ to any variance.
_NEGLECTED = 0.005


@dataclass(frozen=True, eq=False)
class _SetErrors:
    """Errors (k, 2, e) of the corrections of a set in its finer cells."""

    sigma: float
    parts: int
    cells: FormatCells
    of_cells: Floats


def remaining_errors(
    result: AdjustmentResult,
    fields: Sequence[CorrectionField | None],
    grid_of_image: Ints,
    interpolation: Interpolation,
) -> CorrectionErrors | None:
    """Errors of everything that is adjusted with corrections; None without any, or with too many cells.

    Where the sub-areas of all sets are too many to be looked at together (``together``), what corrections of
    one hide in the residuals of another is left out.

    Parameters
    ----------
    result : of the adjustment with the corrections.
    fields : the corrections of each set of images.
    grid_of_image : (images,) number of the set of each image.
    interpolation : of the corrections.
    """
    cells = [0 if field is None else field.cells.count for field in fields]
    if max(cells, default=0) > MOST_CELLS:
        return None
    of_ray, loads = grid_of_image[result.observations.image_points.image], list[FullVectors]()
    found: dict[int, tuple[int, _SetErrors]] = {}
    for numbers in together(cells):
        own = {k: (np.flatnonzero(of_ray == k), field) for k in numbers if (field := fields[k]) is not None}
        with one_thread():
            errors = _of_sets(result, own, interpolation)
        if errors is not None:
            first = sum(item.count for item in loads)
            found |= {k: (first, item) for k, item in errors[0].items()}
            loads.append(errors[1])
    if not loads:
        return None
    solution, every = result.solution, joined(loads)
    solved = solve_full(result.system, solution.linearization, solution.factorization, every)
    of_unknowns = in_datum(solution, result.layout, solved)
    sets = [found[k][1] if k in found else None for k in range(len(fields))]
    return CorrectionErrors(
        of_unknowns,
        errors_of_families(result.layout, of_unknowns.of_border),
        _Fields(found, every.count, grid_of_image, interpolation),
        tuple(None if item is None else item.sigma for item in sets),
        tuple(None if item is None else item.parts for item in sets),
    )


def with_correction_errors(result: AdjustmentResult, errors: CorrectionErrors | None) -> AdjustmentResult:
    """The result with errors of its corrections in all covariances, also of predicted control points."""
    if errors is None:
        return result
    found = replace(result, cofactor=replace(result.cofactor, corrections=errors))
    adjusted = Adjusted(result.system, result.solution, (), known_quality=found.cofactor)
    for item in result.groups[1:]:
        if isinstance(item.group, ControlPoints):
            rejected = (item.status == ObservationStatus.REJECTED).any(axis=1)
            singly, by_fold = leave_one_out(adjusted, item.group, rejected), result.left_out_by_fold
            if by_fold is not None:
                by_fold = k_fold(adjusted, item.group, rejected, int(by_fold.fold.max()) + 1)
            return replace(found, left_out_singly=singly, left_out_by_fold=by_fold)
    return found


@dataclass(frozen=True, eq=False)
class _Fields:
    """Errors of the corrections of all sets: by their numbers the first column of each, of so many."""

    sets: Mapping[int, tuple[int, _SetErrors]]
    count: int
    grid_of_image: Ints
    interpolation: Interpolation

    def __call__(self, image: Ints, xy: Floats) -> Floats:
        """Errors (r, 2, k) at image points; those of other sets of images are zero."""
        errors = np.zeros((len(image), 2, self.count))
        for number, (first, item) in self.sets.items():
            rows, own = np.flatnonzero(self.grid_of_image[image] == number), item.of_cells
            for coordinate in (0, 1):
                known = np.asarray(np.isfinite(own[:, coordinate]).all(axis=1))
                matrix = item.cells.interpolation_matrix(known, xy[rows], self.interpolation)
                part = slice(first, first + own.shape[2])
                errors[rows, coordinate, part] = matrix @ np.nan_to_num(own[:, coordinate])
        return errors


def _of_sets(
    result: AdjustmentResult,
    coarse: Mapping[int, tuple[Ints, CorrectionField]],
    interpolation: Interpolation,
) -> tuple[dict[int, _SetErrors], FullVectors] | None:
    """Errors of the corrections of some sets, and the loads AᵀP E δ by them; None if no mean shows errors.

    Parameters
    ----------
    coarse : image points (r,) and corrections of each set.
    """
    chosen, parts, fields, sets = controlled(result.groups[0]), list[int](), dict[int, CorrectionField](), []
    most = _MOST_FINER if len(coarse) == 1 else MOST_TOGETHER // len(coarse)
    for number, (rows, corrections) in coarse.items():
        divided = _parts(corrections, chosen[rows], most)
        field, grid = _finer(result, rows, corrections, divided, interpolation)
        if (known := known_cells(field, grid)).any():
            fields[number] = field
            parts.append(divided)
            sets.append(SetMeans(rows, grid, known))
    if not sets:
        return None
    response = MeanResponse.of(result, sets, chosen, interpolation)
    expected, wrong = response.expected(list(fields.values()), [item.grid for item in sets], result.sigma0)
    errors = _strongest(
        np.column_stack([expected.root, wrong]), response.imitated, _NEGLECTED * result.sigma0**2
    )
    each = zip(fields, response.parts, parts, sets, response.of_cells(errors), strict=True)
    found = {
        number: _SetErrors(expected.sigma_of(part), divided, item.grid.cells, own)
        for number, part, divided, item, own in each
    }
    return found, response.loads.times(np.vstack([errors, np.zeros_like(errors)]))


def _parts(field: CorrectionField, chosen: Bools, most: int) -> int:
    """Into how many parts the sides of the cells are divided: residuals (r, 2) and time allow so many."""
    most = min(most, int(chosen.sum(axis=0).max()) // LEAST_IN_CELL)
    parts = isqrt(most // field.cells.count)
    return max(1, parts - 1 + parts % 2)


def _finer(
    result: AdjustmentResult, rows: Ints, coarse: CorrectionField, parts: int, interpolation: Interpolation
) -> tuple[CorrectionField, ResidualGrid]:
    """The same corrections in finer cells, zero where there are none, and means of any residuals there."""
    cells, xy = coarse.cells.finer(parts), result.observations.image_points.xy[rows]
    residual, chosen = result.groups[0].residual[rows], controlled(result.groups[0])[rows]
    cell = cells.cell_of(xy)
    count, total = (
        np.stack([np.bincount(cell, own, cells.count) for own in (chosen * of).T], axis=1)
        for of in (np.ones_like(residual), residual)
    )
    mean = np.where(count > 0, total, np.nan) / np.maximum(count, 1)
    unknown = np.full_like(mean, np.nan)
    value = coarse.cells.interpolate(coarse.value, cells.middles, interpolation)
    return (
        CorrectionField(cells, value),
        ResidualGrid(cells, count.astype(np.int64), mean, unknown, unknown[:, 0]),
    )


def _strongest(root: Floats, imitated: Floats, least: float) -> Floats:
    """The combinations (c, e) of fields (c, r) that add more than a bound times N⁻¹ to a variance.

    The strongest stays in any case.
    """
    strength, combination = linalg.eigh(root.T @ imitated @ root)
    kept = min(int(np.searchsorted(strength, least)), len(strength) - 1)
    return np.asarray(root @ combination[:, kept:])
