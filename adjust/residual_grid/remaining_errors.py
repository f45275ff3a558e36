"""What corrections by mean residuals leave of systematic image errors, in everything that is adjusted.

Corrections f of the cells are added to the image coordinates through their interpolation E. Their errors
δ = f − f*, with the true corrections f*, move the unknowns by H δ, H = N⁻¹ AᵀP E. With the residual maker
R = 1 − A N⁻¹ AᵀP and D, which takes the means of residuals in the cells, the means that are left are

    m = −M δ − η,    M = D R E,    Cov(η) = V = σ0² D R P⁻¹ Dᵀ

so m + M f, the means without corrections, speak for f* (``expected_field``), wherever f came from:

    Cov(x) = σ0² N⁻¹ + H [(f − f̂)(f − f̂)ᵀ + Cov(f*)] Hᵀ

η is made of residuals alone, which are independent of what random errors do to the unknowns: both add up.

**Convention.** A part of f* that free parameters of the camera, or a rotation of all its images, imitate
exactly is theirs as much as that of the corrections, and nothing that can be seen depends on where it is.
Parameters are those that belong to the corrections: δ has no such part. An interior orientation that is held
is exact, so that image errors are what comes on top of it: δ has no part that another one would imitate.

Of δ only those combinations are kept that move an unknown by more than a part of its σ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, sparse

from adjust.arrays import Bools, Floats, Ints
from adjust.least_squares import Adjusted
from adjust.observations.control_point import ControlPoints
from adjust.one_thread import one_thread
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.quality.control_checks import k_fold, leave_one_out
from adjust.quality.correction_errors import CorrectionErrors
from adjust.quality.unknown_errors import errors_of_families, in_datum
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.expected_field import expected_field
from adjust.residual_grid.field_loads import FieldLoads, Sparse
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.full_vectors import FullVectors, joined, solve_full
from adjust.solve.whitening import standardize

# Of more sub-areas the matrices would not fit.
MOST_CELLS = 1_300
# What is left out adds less than this part of σ0² N⁻¹ to any variance.
_NEGLECTED = 0.005
# Singular values of fields, of the largest, that are not told from each other.
_ALIKE = 1e-6


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
        if field is None or grid is None or not _known(field, grid).any():
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


def _known(field: CorrectionField, grid: ResidualGrid) -> Bools:
    """(2, k) the coordinates and cells with a correction and a mean."""
    return np.asarray(np.isfinite(grid.mean) & np.isfinite(field.value)).T


def _of_set(
    result: AdjustmentResult,
    rows: Ints,
    field: CorrectionField,
    grid: ResidualGrid,
    interpolation: Interpolation,
) -> _SetErrors:
    """Errors of the corrections of the images whose image points are the rows (r,)."""
    known, variance = _known(field, grid), result.sigma0**2
    fields, means = _columns(result, rows, grid.cells, known, interpolation)
    c = fields.shape[1]
    both = Sparse(sparse.hstack([fields, means]))
    loads = FieldLoads.of(result.system, result.solution, rows, both)
    imitated = loads.imitated()
    response = (means.T @ fields).toarray() - imitated[c:, :c]
    noise = variance * ((means.T @ means).toarray() - imitated[c:, c:])
    correction, left = field.value.T[known], grid.mean.T[known]
    contained = _without(_imitable(result, rows, loads, means), grid.count.T[known].astype(np.float64))
    expected = expected_field(grid.cells, known, left + response @ correction, response, noise, contained)
    wrong = contained @ correction - expected.value
    errors = _strongest(np.column_stack([expected.root, wrong]), imitated[:c, :c], _NEGLECTED * variance)
    of_cells = np.full((2, grid.cells.count, errors.shape[1]), np.nan)
    of_cells[known] = errors
    of_loads = loads.times(np.vstack([errors, np.zeros_like(errors)]))
    return _SetErrors(expected.sigma, grid.cells, np.moveaxis(of_cells, 0, 1), of_loads)


def _columns(
    result: AdjustmentResult, rows: Ints, cells: FormatCells, known: Bools, interpolation: Interpolation
) -> tuple[Sparse[np.float64], Sparse[np.float64]]:
    """√P E and (D √P⁻¹)ᵀ (2 r, c) at image points (r,): x and y of each after the other."""
    rays, chosen = result.observations.image_points.only(rows), controlled(result.groups[0])[rows]
    cell, row = cells.cell_of(rays.xy), np.arange(len(rows))
    fields, means = list[Sparse[np.float64]](), list[Sparse[np.float64]]()
    for k, own in enumerate(known):
        between = cells.interpolation_matrix(own, rays.xy, interpolation)
        weight = Sparse((rays.inverse_sigma[:, k], (2 * row + k, row)), shape=(2 * len(rows), len(rows)))
        fields.append((weight @ between)[:, own])
        number = np.bincount(cell, weights=chosen[:, k], minlength=cells.count)
        share = chosen[:, k] * rays.sigma[:, k] / np.maximum(number, 1.0)[cell]
        means.append(Sparse((share, (2 * row + k, cell)), shape=(2 * len(rows), cells.count))[:, own])
    return Sparse(sparse.hstack(fields)), Sparse(sparse.hstack(means))


def _imitable(result: AdjustmentResult, rows: Ints, loads: FieldLoads, means: Sparse[np.float64]) -> Floats:
    """Fields (c, p) that the parameters of the camera and a rotation of all images make, of length 1.

    Interior orientation, rotation, and what else is free: its derivatives, as means of the cells.

    Parameters
    ----------
    loads : of E, then of Dᵀ, which takes the means of derivatives.
    """
    c, interior = means.shape[1], result.layout.columns[INTERIOR_ORIENTATION]
    rays = result.observations.image_points.only(rows)
    equations = standardize(rays, rays.linearize(result.solution.linearization))
    (own,) = (term.jacobian for term in equations.terms if term.block == INTERIOR_ORIENTATION)
    rotations = loads.of_exposures[:, c:].toarray().reshape(-1, 6, c)[:, 3:].sum(axis=0)
    others = np.delete(loads.of_border[:, c:], interior[interior >= 0], axis=0)
    of_interior = np.asarray(means.T @ own.reshape(2 * len(rows), 3))
    fields = np.column_stack([of_interior, rotations.T, others.T])
    size = np.sqrt(np.sum(fields**2, axis=0))
    return np.asarray(fields[:, size > 0.0] / size[size > 0.0])


def _without(imitable: Floats, weight: Floats) -> Floats:
    """The projection (c, c) that takes off a field (c,) what others (c, p) explain, with weights (c,)."""
    root = np.sqrt(weight)[:, None]
    directions, values, _ = np.linalg.svd(root * imitable, full_matrices=False)
    directions = directions[:, values > _ALIKE * values[0]]
    return np.asarray(np.eye(len(weight)) - (directions / root) @ (directions * root).T)


def _strongest(root: Floats, imitated: Floats, least: float) -> Floats:
    """The combinations (c, e) of fields (c, r) that add more than a bound times N⁻¹ to a variance."""
    strength, combination = linalg.eigh(root.T @ imitated @ root)
    return np.asarray(root @ combination[:, strength > least])
