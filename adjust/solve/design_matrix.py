"""The observation equations of all groups in full: the slow, independent check of the kernels.

Image points go through :meth:`ImagePoints.linearize` like every other group, nothing is eliminated,
and everything derived from the equations is a plain product or inverse of matrices:

    v = A dx − l (whitened),    N = AᵀA,    Q = N⁻¹,    R = I − A Q Aᵀ

An adjustment never comes here. The inverse is dense, so a block may have a few thousand unknowns.
Columns of A: six for each image, then the free system parameters, then three for each object point
that takes part. What is held has no column.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy import sparse

from adjust.arrays import Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup, StochasticModel
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.normal_equations import System


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Whitened observation equations of a block, v = A dx − l.

    Attributes
    ----------
    matrix : (rows, u) A; the row of a component that takes no part is zero.
    misclosure : (rows,) l, observed − computed.
    row_start : (groups + 1,) where the rows of each group begin; observation by observation.
    exposure_columns : (n, 6).
    border_columns : (g,).
    point_columns : (m, 3), −1 for object points that take no part.
    """

    matrix: sparse.csr_array[np.float64]
    misclosure: Floats
    row_start: Ints
    exposure_columns: Ints
    border_columns: Ints
    point_columns: Ints

    @property
    def unknowns(self) -> int:
        """Number u of columns."""
        return int(self.matrix.shape[1])

    @property
    def weighted_squares(self) -> float:
        """Sum of squares vᵀPv at the state of linearisation."""
        return float(self.misclosure @ self.misclosure)


def design_matrix(system: System, state: State) -> DesignMatrix:
    """Observation equations of all groups at a state."""
    layout = system.layout
    n, g = layout.images, layout.border
    exposure_columns = np.arange(6 * n).reshape(n, 6)
    border_columns = 6 * n + np.arange(g)
    point_columns = np.full((layout.points, 3), -1, dtype=np.int64)
    active = int(system.active_point.sum())
    point_columns[system.active_point] = 6 * n + g + np.arange(3 * active).reshape(active, 3)

    columns_of: dict[str, Ints] = {EXTERIOR_ORIENTATION: exposure_columns, OBJECT_POINT: point_columns}
    for family, index in layout.columns.items():
        columns_of[family] = np.where(index >= 0, 6 * n + index, -1)
    rows, columns, values, misclosures = [], [], [], []
    starts = [0]
    for group in system.observations.groups:
        equations = _whitened(group, group.linearize(state))
        first, count = starts[-1], equations.misclosure.size
        row = first + np.arange(count).reshape(equations.misclosure.shape)
        for term in equations.terms:
            column = columns_of[term.block][term.index][:, None, :]
            shape = term.jacobian.shape
            kept = np.broadcast_to(column >= 0, shape)
            rows.append(np.broadcast_to(row[:, :, None], shape)[kept])
            columns.append(np.broadcast_to(column, shape)[kept])
            values.append(term.jacobian[kept])
        misclosures.append(equations.misclosure.ravel())
        starts.append(first + count)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    # Entries in the same place are added, as when an observation touches an unknown twice.
    matrix = sparse.csr_array(entries, shape=(starts[-1], 6 * n + g + 3 * active))
    return DesignMatrix(
        matrix,
        np.concatenate(misclosures),
        np.array(starts, dtype=np.int64),
        exposure_columns,
        border_columns,
        point_columns,
    )


def full_normals(design: DesignMatrix) -> tuple[Floats, Floats]:
    """Unreduced normal equations N dx = b: N = AᵀA (u, u), b = Aᵀl (u,)."""
    transposed = design.matrix.T
    normal: Floats = (transposed @ design.matrix).toarray()
    rhs: Floats = np.asarray(transposed @ design.misclosure)
    return normal, rhs


def schur_complement(design: DesignMatrix) -> tuple[Floats, Floats]:
    """Normal equations (6 n + g, 6 n + g) and (6 n + g,) with the object points eliminated."""
    normal, rhs = full_normals(design)
    kept = len(design.exposure_columns) * 6 + len(design.border_columns)
    if kept == len(rhs):
        return normal, rhs
    gain = np.linalg.solve(normal[kept:, kept:], normal[kept:, :kept]).T
    return normal[:kept, :kept] - gain @ normal[kept:, :kept], rhs[:kept] - gain @ rhs[kept:]


def full_cofactor(design: DesignMatrix) -> Floats:
    """Cofactor matrix Q = N⁻¹ (u, u) of all unknowns, inverted with unit diagonal.

    Raises
    ------
    numpy.linalg.LinAlgError : if N is singular.
    """
    normal, _ = full_normals(design)
    scale = 1.0 / np.sqrt(np.diagonal(normal))
    factor = scipy.linalg.cholesky(normal * scale[:, None] * scale[None, :], lower=True)
    inverse = scipy.linalg.cho_solve((factor, True), np.eye(len(normal)))
    cofactor: Floats = 0.5 * (inverse + inverse.T) * scale[:, None] * scale[None, :]
    return cofactor


def full_solution(design: DesignMatrix, cofactor: Floats) -> Floats:
    """Increments dx = Q Aᵀl (u,) of all unknowns."""
    _, rhs = full_normals(design)
    increments: Floats = cofactor @ rhs
    return increments


def redundancy_numbers(system: System, design: DesignMatrix, cofactor: Floats) -> tuple[Floats, ...]:
    """Redundancy numbers (Q_vv P)_ii of every group, (n, m) each; NaN for what takes no part."""
    return tuple(
        _group_redundancy(
            group.stochastic,
            design.matrix[design.row_start[k] : design.row_start[k + 1]].toarray(),
            cofactor,
        )
        for k, group in enumerate(system.observations.groups)
    )


def _group_redundancy(model: StochasticModel, rows: Floats, cofactor: Floats) -> Floats:
    """Redundancy numbers (n, m) of one group from its dense whitened rows (n m, u)."""
    n, m = model.present.shape
    result = np.full((n, m), np.nan)
    for i in range(n):
        kept = np.flatnonzero(model.present[i])
        if len(kept) == 0:
            continue
        whitened = rows[m * i : m * (i + 1)][kept]
        remainder = np.eye(len(kept)) - whitened @ cofactor @ whitened.T
        whitener = model.whitener[i][np.ix_(kept, kept)]
        # Q_vv P = W⁻¹ (I − A Q Aᵀ) W, observation by observation: W is block diagonal.
        result[i, kept] = np.diagonal(np.linalg.solve(whitener, remainder @ whitener))
    return result


def _whitened(group: ObservationGroup, equations: Linearization) -> Linearization:
    """Every row multiplied by W; what takes no part becomes zero whatever stands there."""
    model = group.stochastic
    misclosure = np.where(model.present, equations.misclosure, 0.0)
    terms = tuple(
        type(term)(
            term.block,
            term.index,
            model.whitener @ np.where(model.present[:, :, None], term.jacobian, 0.0),
        )
        for term in equations.terms
    )
    return Linearization((model.whitener @ misclosure[:, :, None])[:, :, 0], terms)
