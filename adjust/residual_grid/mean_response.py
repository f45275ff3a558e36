"""How the mean residuals of sets of images answer to errors of their corrections.

Corrections f of the cells are added to the image coordinates through their interpolation E. Their errors
δ = f − f*, with the true corrections f*, move the unknowns by N⁻¹ AᵀP E δ. With the residual maker
R = 1 − A N⁻¹ AᵀP and D, which takes the means of residuals in the cells, the means that are left are

    m = −M δ − η,    M = D R E,    Cov(η) = V = σ0² D R P⁻¹ Dᵀ

so m + M f, the means without corrections, speak for f* (``expected_field``), wherever f came from.

**Convention.** A part of f* that free parameters of the cameras, or a rotation of all images, imitate exactly
is theirs as much as that of the corrections, and nothing that can be seen depends on where it is. Parameters
are those that belong to the corrections: δ has no such part. What they imitate not quite, the means show,
and it stays in δ: a rotation of all images that is not that of its heads, for example, because they are a few
centimetres from its centre. An interior orientation that is held is exact, so that image errors are what
comes on top of it; not so of the heads of a rig, which show it of each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from scipy import sparse

from adjust.arrays import Bools, Floats, Ints
from adjust.parameters import INTERIOR_ORIENTATION
from adjust.residual_grid.expected_field import ExpectedField, Places, expected_field
from adjust.residual_grid.field_loads import FieldLoads, Sparse
from adjust.residual_grid.format_cells import Interpolation
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.result import AdjustmentResult
from adjust.solve.whitening import standardize

#: Of more sub-areas of a set, and of several sets together, the matrices would not fit.
MOST_CELLS, MOST_TOGETHER = 1_300, 700
# Singular values of fields, of the largest, that are not told from each other.
_ALIKE = 1e-6
# Part of a field that the means show, up to which it counts as imitated exactly. Coarse sub-areas leave up to
# 0.08 (3 × 3) or 0.013 (9 × 9) of interior orientations, rotations and additional parameters; of a
# synchronisation offset that a rotation nearly imitates the means show 0.14 and more.
_HIDDEN = 0.1


def known_cells(field: CorrectionField, grid: ResidualGrid) -> Bools:
    """(2, k) the coordinates and cells with a correction and a mean."""
    return np.asarray(np.isfinite(grid.mean) & np.isfinite(field.value)).T


def together(cells: Sequence[int]) -> list[list[int]]:
    """Which sets, by their numbers, are looked at together: as many as matrices of their sub-areas allow.

    Heads of a rig bend a block together, and the residuals of one show what corrections of another leave.

    Parameters
    ----------
    cells : number of sub-areas of every set; 0 for one that is left out.
    """
    groups, filled = list[list[int]](), 0
    for number, count in enumerate(cells):
        if count == 0:
            continue
        if not groups or filled + count > MOST_TOGETHER:
            groups.append([])
            filled = 0
        groups[-1].append(number)
        filled += count
    return groups


@dataclass(frozen=True, eq=False)
class SetMeans:
    """A set of images with means.

    Attributes
    ----------
    rows : (r,) numbers of its image points.
    grid : means of the residuals that are chosen.
    known : (2, k) which coordinates and cells have a correction and a mean.
    """

    rows: Ints
    grid: ResidualGrid
    known: Bools

    @property
    def places(self) -> Places:
        """Where its field has a value."""
        return Places(self.grid.cells, self.known)


@dataclass(frozen=True, eq=False)
class MeanResponse:
    """The matrices of some sets of images; c known coordinates and cells, set by set, x of all cells first.

    Attributes
    ----------
    sets : the sets.
    loads : AᵀP E of the fields, then AᵀD' of the means.
    matrix : (c, c) M.
    noise : (c, c) V for σ0 = 1, m².
    imitated : (c, c) EᵀP A N⁻¹ AᵀP E: what no residual shows of a field.
    contained : (c, c) projection of any field onto what δ can contain.
    """

    sets: tuple[SetMeans, ...]
    loads: FieldLoads
    matrix: Floats
    noise: Floats
    imitated: Floats
    contained: Floats

    @classmethod
    def of(
        cls,
        result: AdjustmentResult,
        sets: Sequence[SetMeans],
        chosen: Bools,
        interpolation: Interpolation,
    ) -> Self:
        """Of some sets of images.

        Parameters
        ----------
        chosen : (n, 2) the residuals that count.
        interpolation : of the corrections.
        """
        each = [_columns(result, item, interpolation, chosen) for item in sets]
        fields, means = (Sparse(sparse.block_diag(own)) for own in zip(*each, strict=True))
        rows, c = np.concatenate([item.rows for item in sets]), fields.shape[1]
        order = np.argsort(rows)
        coordinates = (2 * order[:, None] + np.arange(2)).ravel()
        both = Sparse(sparse.hstack([fields, means]))[coordinates]
        loads = FieldLoads.of(result.system, result.solution, rows[order], both)
        imitated, all_heads = loads.imitated(), len(rows) == len(chosen)
        matrix = (means.T @ fields).toarray() - imitated[c:, :c]
        weight = np.concatenate([item.grid.count.T[item.known] for item in sets]).astype(np.float64)
        hidden = _hidden(_imitable(result, loads, _parts(sets), all_heads), matrix, weight)
        own = _span(np.hstack([hidden, _interior(result, rows, means)]), weight)
        return cls(
            tuple(sets),
            loads,
            matrix,
            (means.T @ means).toarray() - imitated[c:, c:],
            imitated[:c, :c],
            np.asarray(np.eye(c) - own @ (own * weight[:, None]).T),
        )

    @property
    def parts(self) -> list[slice]:
        """The known coordinates and cells of every set."""
        return _parts(self.sets)

    def expected(
        self, fields: Sequence[CorrectionField], left: Sequence[ResidualGrid], sigma0: float
    ) -> tuple[ExpectedField, Floats]:
        """What has to be expected of the true corrections, and how wrong (c,) these are to all appearance.

        Parameters
        ----------
        fields : the corrections of every set.
        left : the mean residuals with them.
        """
        correction = self.of_known([field.value for field in fields])
        expected = expected_field(
            [item.places for item in self.sets],
            self.of_known([grid.mean for grid in left]) + self.matrix @ correction,
            self.matrix,
            sigma0**2 * self.noise,
            self.contained,
        )
        return expected, self.contained @ correction - expected.value

    def of_known(self, values: Sequence[Floats]) -> Floats:
        """The values (c,) of the known coordinates and cells, of those (k, 2) of all cells of every set."""
        return np.concatenate([own.T[item.known] for own, item in zip(values, self.sets, strict=True)])

    def of_cells(self, values: Floats) -> list[Floats]:
        """Values (c, …) of the known coordinates and cells as those (k, 2, …) of all cells; NaN elsewhere."""
        found = list[Floats]()
        for item, part in zip(self.sets, self.parts, strict=True):
            every = np.full((*item.known.shape, *values.shape[1:]), np.nan)
            every[item.known] = values[part]
            found.append(np.moveaxis(every, 0, 1))
        return found


def _parts(sets: Sequence[SetMeans]) -> list[slice]:
    borders = np.cumsum([0, *(item.places.count for item in sets)])
    return [slice(int(first), int(last)) for first, last in pairwise(borders)]


def _columns(
    result: AdjustmentResult, item: SetMeans, interpolation: Interpolation, chosen: Bools
) -> tuple[Sparse[np.float64], Sparse[np.float64]]:
    """√P E and (D √P⁻¹)ᵀ (2 r, c) at the image points of a set: x and y of each after the other."""
    rays, chosen, cells = result.observations.image_points.only(item.rows), chosen[item.rows], item.grid.cells
    cell, row = cells.cell_of(rays.xy), np.arange(len(item.rows))
    fields, means = list[Sparse[np.float64]](), list[Sparse[np.float64]]()
    for k, own in enumerate(item.known):
        between = cells.interpolation_matrix(own, rays.xy, interpolation)
        weight = Sparse((rays.inverse_sigma[:, k], (2 * row + k, row)), shape=(2 * len(row), len(row)))
        fields.append((weight @ between)[:, own])
        number = np.bincount(cell, weights=chosen[:, k], minlength=cells.count)
        share = chosen[:, k] * rays.sigma[:, k] / np.maximum(number, 1.0)[cell]
        means.append(Sparse((share, (2 * row + k, cell)), shape=(2 * len(row), cells.count))[:, own])
    return Sparse(sparse.hstack(fields)), Sparse(sparse.hstack(means))


def _imitable(result: AdjustmentResult, loads: FieldLoads, parts: Sequence[slice], all_heads: bool) -> Floats:
    """Fields (c, p) of length 1 that free parameters of the cameras and a rotation of all images make.

    Images of one exposure turn together: heads of a rig with all others.

    Parameters
    ----------
    loads : of E, then of Dᵀ, which takes the means of derivatives.
    parts : the places of every set.
    all_heads : whether these are the sets of all image points.
    """
    c = parts[-1].stop
    turned = loads.of_exposures[:, c:].toarray().reshape(-1, 6, c)[:, 3:].sum(axis=0)
    turning = parts if result.block.rig is None else [slice(0, c)][:all_heads]
    rotations = np.zeros((len(turning), *turned.shape))
    for own, part in zip(rotations, turning, strict=True):
        own[:, part] = turned[:, part]
    fields = np.vstack([rotations.reshape(-1, c), loads.of_border[:, c:]]).T
    size = np.sqrt(np.sum(fields**2, axis=0))
    return np.asarray(fields[:, size > 0.0] / size[size > 0.0])


def _interior(result: AdjustmentResult, rows: Ints, means: Sparse[np.float64]) -> Floats:
    """Fields (c, p) of length 1 that interior orientations make, where no other head shows them.

    Parameters
    ----------
    means : Dᵀ (2 r, c) at the image points (r,) of all sets, one after the other.
    """
    columns = list[Floats]()
    camera = result.block.camera_of_image[result.observations.image_points.image[rows]]
    for number in np.unique(camera) if result.block.rig is None else ():
        order = np.flatnonzero(camera == number)
        order = order[np.argsort(rows[order])]
        rays = result.observations.image_points.only(rows[order])
        terms = standardize(rays, rays.linearize(result.solution.linearization)).terms
        (own,) = (term.jacobian for term in terms if term.block == INTERIOR_ORIENTATION)
        every = np.zeros((len(rows), 2, 3))
        every[order] = own
        columns.append(np.asarray(means.T @ every.reshape(-1, 3)))
    fields = np.hstack([np.zeros((means.shape[1], 0)), *columns])
    size = np.sqrt(np.sum(fields**2, axis=0))
    return np.asarray(fields[:, size > 0.0] / size[size > 0.0])


def _hidden(fields: Floats, matrix: Floats, weight: Floats) -> Floats:
    """Those combinations (c, q) of fields (c, p) that means hardly show, with weights (c,)."""
    fields = _span(fields, weight)
    # Between 0 and 1, as those of M: residuals are a projection of errors.
    shown = (fields * weight[:, None]).T @ matrix @ fields
    part, combination = np.linalg.eigh(0.5 * (shown + shown.T))
    return np.asarray(fields @ combination[:, part < _HIDDEN])


def _span(fields: Floats, weight: Floats) -> Floats:
    """Fields (c, q) that span others (c, p), orthogonal and of length 1 with weights (c,)."""
    root = np.sqrt(weight)[:, None]
    directions, values, _ = np.linalg.svd(root * fields, full_matrices=False)
    return np.asarray(directions[:, values > _ALIKE * values.max(initial=0.0)] / root)
