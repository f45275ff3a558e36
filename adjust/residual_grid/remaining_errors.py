"""What corrections by mean residuals leave of systematic image errors, in everything that is adjusted.

Errors δ of the corrections f move the unknowns by H δ, H = N⁻¹ AᵀP E (``mean_response``). With the most
probable true corrections f̂ and their covariance (``expected_field``), wherever f came from,

    Cov(x) = σ0² N⁻¹ + H [(f − f̂)(f − f̂)ᵀ + Cov(f*)] Hᵀ

The noise of the means is made of residuals alone, which are independent of what random errors do to the
unknowns: both add up.

Of δ only those combinations are kept that move an unknown by more than a part of its σ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from adjust.arrays import Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.control_point import ControlPoints
from adjust.one_thread import one_thread
from adjust.quality.control_checks import k_fold, leave_one_out
from adjust.quality.correction_errors import CorrectionErrors
from adjust.quality.unknown_errors import errors_of_families, in_datum
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.mean_response import MOST_CELLS, MeanResponse, known_cells
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.full_vectors import FullVectors, joined, solve_full

# What is left out adds less than this part of σ0² N⁻¹ to any variance.
_NEGLECTED = 0.005


@dataclass(frozen=True, eq=False)
class _SetErrors:
    """Errors (k, 2, e) of the corrections of a set, and the loads AᵀP E δ by them."""

    sigma: float
    cells: FormatCells
    of_cells: Floats
    loads: FullVectors


def remaining_errors(
    result: AdjustmentResult,
    fields: Sequence[CorrectionField | None],
    grids: Sequence[ResidualGrid | None],
    grid_of_image: Ints,
    interpolation: Interpolation,
) -> CorrectionErrors | None:
    """Errors of everything that is adjusted with corrections; None without any, or with too many cells.

    Sets of images are looked at one by one: what corrections of one hide in the residuals of another is
    left out.

    Parameters
    ----------
    result : of the adjustment with the corrections.
    fields : the corrections of each set of images.
    grids : the mean residuals that are left.
    grid_of_image : (images,) number of the set of each image.
    interpolation : of the corrections.
    """
    image, found = result.observations.image_points.image, list[_SetErrors | None]()
    for number, (field, grid) in enumerate(zip(fields, grids, strict=True)):
        if field is None or grid is None or not known_cells(field, grid).any():
            found.append(None)
        elif field.cells.count > MOST_CELLS:
            return None
        else:
            rows = np.flatnonzero(grid_of_image[image] == number)
            with one_thread():
                found.append(_of_set(result, rows, field, grid, interpolation))
    there = [item for item in found if item is not None]
    if not there:
        return None
    solution, loads = result.solution, joined([item.loads for item in there])
    solved = solve_full(result.system, solution.linearization, solution.factorization, loads)
    of_unknowns = in_datum(solution, result.layout, solved)
    return CorrectionErrors(
        of_unknowns,
        errors_of_families(result.layout, of_unknowns.of_border),
        _Fields(tuple(found), grid_of_image, interpolation),
        tuple(None if item is None else item.sigma for item in found),
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
    """Errors of the corrections of all sets."""

    sets: tuple[_SetErrors | None, ...]
    grid_of_image: Ints
    interpolation: Interpolation

    def __call__(self, image: Ints, xy: Floats) -> Floats:
        """Errors (r, 2, k) at image points; those of other sets of images are zero."""
        total = sum(item.of_cells.shape[2] for item in self.sets if item is not None)
        errors, first = np.zeros((len(image), 2, total)), 0
        for number, item in enumerate(self.sets):
            if item is None:
                continue
            rows, own = np.flatnonzero(self.grid_of_image[image] == number), item.of_cells
            for coordinate in (0, 1):
                known = np.asarray(np.isfinite(own[:, coordinate]).all(axis=1))
                matrix = item.cells.interpolation_matrix(known, xy[rows], self.interpolation)
                part = slice(first, first + own.shape[2])
                errors[rows, coordinate, part] = matrix @ np.nan_to_num(own[:, coordinate])
            first += own.shape[2]
        return errors


def _of_set(
    result: AdjustmentResult,
    rows: Ints,
    field: CorrectionField,
    grid: ResidualGrid,
    interpolation: Interpolation,
) -> _SetErrors:
    """Errors of the corrections of the images whose image points are the rows (r,)."""
    known, chosen = known_cells(field, grid), controlled(result.groups[0])
    response = MeanResponse.of(result, rows, grid, known, chosen, interpolation)
    expected, wrong = response.expected(field, grid, result.sigma0)
    errors = _strongest(
        np.column_stack([expected.root, wrong]), response.imitated, _NEGLECTED * result.sigma0**2
    )
    of_cells = np.full((2, grid.cells.count, errors.shape[1]), np.nan)
    of_cells[response.known] = errors
    of_loads = response.loads.times(np.vstack([errors, np.zeros_like(errors)]))
    return _SetErrors(expected.sigma, grid.cells, np.moveaxis(of_cells, 0, 1), of_loads)


def _strongest(root: Floats, imitated: Floats, least: float) -> Floats:
    """The combinations (c, e) of fields (c, r) that add more than a bound times N⁻¹ to a variance."""
    strength, combination = linalg.eigh(root.T @ imitated @ root)
    return np.asarray(root @ combination[:, strength > least])
