"""The observation equations of all groups in full: the slow, independent check of the kernels.

Image points go through :meth:`ImagePoints.linearize` like every other group, nothing is eliminated,
and everything derived from the equations is a plain product or inverse of matrices:

    v = A dx − l (whitened),    N = AᵀA,    Q = N⁻¹,    R = I − A Q Aᵀ

The covariance matrix of errors correlated over time is formed from its definition, element by element,
and whitened by Cholesky's factor of all of it.

An adjustment never comes here. The inverse is dense, so a block may have a few thousand unknowns.
Columns of A: six for each image, then the free system parameters, then three for each object point
that is used. What is held has no column.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy import sparse

from adjust.arrays import Floats, Ints
from adjust.observations.base import Linearization, ObservationGroup, StochasticModel
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.system import System


@dataclass(frozen=True, eq=False)
class DesignMatrix:
    """Whitened observation equations of a block, v = A dx − l.

    Attributes
    ----------
    matrix : (rows, u) A; the row of a component that is not used is zero. With errors correlated over
        time a row belongs to all observations of the group before it.
    misclosure : (rows,) l, observed − computed.
    row_start : (groups + 1,) where the rows of each group begin; observation by observation.
    exposure_columns : (n, 6).
    border_columns : (g,).
    point_columns : (m, 3), −1 for object points that are not used.
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
    n, g = layout.events, layout.border
    exposure_columns = np.arange(6 * n).reshape(n, 6)
    border_columns = 6 * n + np.arange(g)
    point_columns = np.full((layout.points, 3), -1, dtype=np.int64)
    active = int(system.active_point.sum())
    point_columns[system.active_point] = 6 * n + g + np.arange(3 * active).reshape(active, 3)

    columns_of: dict[str, Ints] = {EXTERIOR_ORIENTATION: exposure_columns, OBJECT_POINT: point_columns}
    for family, index in layout.columns.items():
        columns_of[family] = np.where(index >= 0, 6 * n + index, -1)
    matrices, misclosures = list[sparse.csr_array[np.float64]](), list[Floats]()
    starts = [0]
    for group in system.observations.groups:
        equations, whitener = _taking_part(group, group.linearize(state)), whitening_matrix(group.stochastic)
        count = equations.misclosure.size
        row = np.arange(count).reshape(equations.misclosure.shape)
        rows, columns, values = list[Ints](), list[Ints](), list[Floats]()
        for term in equations.terms:
            column = columns_of[term.block][term.index][:, None, :]
            shape = term.jacobian.shape
            kept = np.broadcast_to(column >= 0, shape)
            rows.append(np.broadcast_to(row[:, :, None], shape)[kept])
            columns.append(np.broadcast_to(column, shape)[kept])
            values.append(term.jacobian[kept])
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        # Entries in the same place are added, as when an observation touches an unknown twice.
        matrices.append(whitener @ sparse.csr_array(entries, shape=(count, 6 * n + g + 3 * active)))
        misclosures.append(np.asarray(whitener @ equations.misclosure.ravel()))
        starts.append(starts[-1] + count)
    return DesignMatrix(
        sparse.vstack(matrices, format="csr"),
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
    """Redundancy numbers (Q_vv P)_ii of every group, (n, m) each; NaN for what is not used."""
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
    result = np.full(model.present.shape, np.nan)
    for scalars, whitener in _whitening_blocks(model):
        part = np.flatnonzero(model.present.ravel()[scalars])
        if len(part) == 0:
            continue
        kept = scalars[part]
        remainder = np.eye(len(kept)) - rows[kept] @ cofactor @ rows[kept].T
        own = whitener[np.ix_(part, part)]
        # Q_vv P = W⁻¹ (I − A Q Aᵀ) W, block by block of W.
        result.ravel()[kept] = np.diagonal(np.linalg.solve(own, remainder @ own))
    return result


def _whitening_blocks(model: StochasticModel) -> list[tuple[Ints, Floats]]:
    """The diagonal blocks of W with the scalars (k,) of a group they belong to: one for each observation.

    With errors correlated over time one for all of them.
    """
    n, m = model.present.shape
    if model.over_time is None:
        return [(m * i + np.arange(m), model.whitener[i]) for i in range(n)]
    kept = np.flatnonzero(model.present.ravel())
    whitener = np.zeros((n * m, n * m))
    lower = np.linalg.cholesky(full_covariance(model)[np.ix_(kept, kept)])
    whitener[np.ix_(kept, kept)] = np.linalg.inv(lower)
    return [(np.arange(n * m), whitener)]


def whitening_matrix(model: StochasticModel) -> sparse.csr_array[np.float64]:
    """W (n m, n m) of a whole group with WᵀW = P; rows and columns of what is not used are zero."""
    blocks = [block for _, block in _whitening_blocks(model)]
    return sparse.csr_array(sparse.block_diag(blocks, format="csr"))


def full_covariance(model: StochasticModel) -> Floats:
    """Covariance matrix (n m, n m) of the observations of a group; zero for what is not used.

    Of two observations it is L_i L_jᵀ exp(−|t_i − t_j|/τ), with the covariance L_i L_iᵀ of each by itself.
    """
    n, m = model.present.shape
    correlation = np.eye(n)
    if model.over_time is not None:
        process = model.over_time
        apart = np.abs(process.time[:, None] - process.time[None, :])
        same = process.strip[:, None] == process.strip[None, :]
        correlation = np.where(same, np.exp(-apart / process.correlation_time), 0.0)
    root = np.zeros((n, m, m))
    for i in range(n):
        kept = np.ix_(model.present[i], model.present[i])
        root[i][kept] = np.linalg.inv(model.whitener[i][kept])
    covariance: Floats = np.einsum("ij,iac,jbc->iajb", correlation, root, root).reshape(n * m, n * m)
    return covariance


def _taking_part(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The same equations, not whitened, with zeros for what is not used whatever is there."""
    present = group.stochastic.present
    terms = tuple(
        type(term)(term.block, term.index, np.where(present[:, :, None], term.jacobian, 0.0))
        for term in equations.terms
    )
    return Linearization(np.where(present, equations.misclosure, 0.0), terms)
