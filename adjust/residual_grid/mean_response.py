"""How the mean residuals of a set of images answer to errors of its corrections.

Corrections f of the cells are added to the image coordinates through their interpolation E. Their errors
δ = f − f*, with the true corrections f*, move the unknowns by N⁻¹ AᵀP E δ. With the residual maker
R = 1 − A N⁻¹ AᵀP and D, which takes the means of residuals in the cells, the means that are left are

    m = −M δ − η,    M = D R E,    Cov(η) = V = σ0² D R P⁻¹ Dᵀ

so m + M f, the means without corrections, speak for f* (``expected_field``), wherever f came from.

**Convention.** A part of f* that free parameters of the camera, or a rotation of all its images, imitate
exactly is theirs as much as that of the corrections, and nothing that can be seen depends on where it is.
Parameters are those that belong to the corrections: δ has no such part. An interior orientation that is held
is exact, so that image errors are what comes on top of it: δ has no part that another one would imitate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import sparse

from adjust.arrays import Bools, Floats, Ints
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.residual_grid.expected_field import ExpectedField, expected_field
from adjust.residual_grid.field_loads import FieldLoads, Sparse
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.result import AdjustmentResult
from adjust.solve.whitening import standardize

#: Of more sub-areas the matrices would not fit.
MOST_CELLS = 1_300
# Singular values of fields, of the largest, that are not told from each other.
_ALIKE = 1e-6


def known_cells(field: CorrectionField, grid: ResidualGrid) -> Bools:
    """(2, k) the coordinates and cells with a correction and a mean."""
    return np.asarray(np.isfinite(grid.mean) & np.isfinite(field.value)).T


@dataclass(frozen=True, eq=False)
class MeanResponse:
    """The matrices of one set of images; c known coordinates and cells, x of all cells first.

    Attributes
    ----------
    cells : the sub-areas.
    known : (2, k) which coordinates and cells.
    loads : AᵀP E of the fields, then AᵀD' of the means.
    matrix : (c, c) M.
    noise : (c, c) V for σ0 = 1, m².
    imitated : (c, c) EᵀP A N⁻¹ AᵀP E: what no residual shows of a field.
    contained : (c, c) projection of any field onto what δ can contain.
    """

    cells: FormatCells
    known: Bools
    loads: FieldLoads
    matrix: Floats
    noise: Floats
    imitated: Floats
    contained: Floats

    @classmethod
    def of(
        cls,
        result: AdjustmentResult,
        rows: Ints,
        grid: ResidualGrid,
        known: Bools,
        chosen: Bools,
        interpolation: Interpolation,
    ) -> Self:
        """Of the images whose image points are the rows (r,).

        Parameters
        ----------
        grid : means of the residuals that are chosen (n, 2).
        known : (2, k).
        interpolation : of the corrections.
        """
        fields, means = _columns(result, rows, grid.cells, known, interpolation, chosen)
        c = fields.shape[1]
        both = Sparse(sparse.hstack([fields, means]))
        loads = FieldLoads.of(result.system, result.solution, rows, both)
        imitated = loads.imitated()
        return cls(
            grid.cells,
            known,
            loads,
            (means.T @ fields).toarray() - imitated[c:, :c],
            (means.T @ means).toarray() - imitated[c:, c:],
            imitated[:c, :c],
            _without(_imitable(result, rows, loads, means), grid.count.T[known].astype(np.float64)),
        )

    def expected(
        self, field: CorrectionField, left: ResidualGrid, sigma0: float
    ) -> tuple[ExpectedField, Floats]:
        """What has to be expected of the true corrections, and how wrong (c,) these are to all appearance.

        Parameters
        ----------
        field : the corrections.
        left : the mean residuals with them.
        """
        correction, means = field.value.T[self.known], left.mean.T[self.known]
        expected = expected_field(
            self.cells,
            self.known,
            means + self.matrix @ correction,
            self.matrix,
            sigma0**2 * self.noise,
            self.contained,
        )
        return expected, self.contained @ correction - expected.value

    def of_cells(self, values: Floats) -> Floats:
        """Values (c,) of the known coordinates and cells as those (k, 2) of all; NaN elsewhere."""
        every = np.full(self.known.shape, np.nan)
        every[self.known] = values
        return every.T


def _columns(
    result: AdjustmentResult,
    rows: Ints,
    cells: FormatCells,
    known: Bools,
    interpolation: Interpolation,
    chosen: Bools,
) -> tuple[Sparse[np.float64], Sparse[np.float64]]:
    """√P E and (D √P⁻¹)ᵀ (2 r, c) at image points (r,): x and y of each after the other."""
    rays, chosen = result.observations.image_points.only(rows), chosen[rows]
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
