"""Solution and inverse of the reduced normal equations, behind one small interface.

Whatever factorises them (here dense Cholesky) offers the same three things: the solution, the
marginal covariance blocks on the pattern of co-visible exposures, and the null space where there is
one. Everything is scaled to unit diagonal first: metres, radians and micrometres in one matrix
would destroy its condition.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.linalg

from adjust.arrays import Floats
from adjust.solve.covisibility import Covisibility
from adjust.solve.normal_equations import ReducedNormals

# Squared pivot of the scaled matrix: 1 − R² of an unknown with all before it. Below this its standard
# deviation is 10⁵ times what it would be alone: rounding, not information.
_SINGULAR = 1e-11


@dataclass(frozen=True, eq=False)
class ReducedCofactor:
    """Marginal cofactor matrices of exposures and system parameters.

    Attributes
    ----------
    pattern : which exposure blocks are there.
    blocks : (blocks, 6, 6) upper block triangle.
    border : (n, 6, g).  corner : (g, g).
    """

    pattern: Covisibility
    blocks: Floats
    border: Floats
    corner: Floats

    @property
    def of_exposures(self) -> Floats:
        """(n, 6, 6) of each exposure with itself."""
        return self.blocks[self.pattern.diagonal]


class Factorization(Protocol):
    """A factorised reduced system."""

    def solve(self) -> tuple[Floats, Floats]:
        """Increments (n, 6) of the exposures and (g,) of the system parameters."""
        ...

    def cofactor(self) -> ReducedCofactor:
        """Blocks of the inverse on the pattern of the matrix."""
        ...


class SingularNormalsError(Exception):
    """The reduced normal equations are singular; ``null_space`` holds the undetermined directions.

    Attributes
    ----------
    null_space : (6 n + g, defect) in natural units, columns orthonormal when divided by ``scale``.
    scale : (6 n + g,) standard deviation of each unknown if all others were known; 1 where no
        observation depends on it.
    """

    def __init__(self, null_space: Floats, scale: Floats) -> None:
        super().__init__(f"rank defect {null_space.shape[1]}")
        self.null_space = null_space
        self.scale = scale


@dataclass(frozen=True, eq=False)
class DenseCholesky:
    """Cholesky factor of the whole reduced matrix, scaled to unit diagonal."""

    normals: ReducedNormals
    scale: Floats
    factor: Floats

    def solve(self) -> tuple[Floats, Floats]:
        """Increments (n, 6) of the exposures and (g,) of the system parameters."""
        rhs = np.concatenate([self.normals.rhs_exposure.ravel(), self.normals.rhs_border])
        solution = self.scale * scipy.linalg.cho_solve((self.factor, True), self.scale * rhs)
        split = self.normals.rhs_exposure.size
        return solution[:split].reshape(-1, 6), solution[split:]

    def cofactor(self) -> ReducedCofactor:
        """Blocks of the inverse on the pattern of the matrix."""
        inverse, info = scipy.linalg.lapack.dpotri(self.factor, lower=1)
        if info != 0:
            raise np.linalg.LinAlgError("the inverse of the reduced normal equations failed")
        inverse *= self.scale[:, None]
        inverse *= self.scale[None, :]
        pattern, n = self.normals.pattern, self.normals.pattern.images
        # dpotri fills the lower triangle: block (i, j), i ≤ j, is the transpose of (j, i).
        rows = 6 * pattern.column[:, None] + np.arange(6)
        columns = 6 * pattern.row[:, None] + np.arange(6)
        blocks = np.swapaxes(inverse[rows[:, :, None], columns[:, None, :]], 1, 2).copy()
        diagonal = blocks[pattern.diagonal]
        lower = np.tril(np.ones((6, 6), dtype=bool))
        symmetric = np.where(lower.T, diagonal, np.swapaxes(diagonal, 1, 2))
        blocks[pattern.diagonal] = symmetric
        corner = inverse[6 * n :, 6 * n :]
        corner = np.tril(corner) + np.tril(corner, -1).T
        border = inverse[6 * n :, : 6 * n].T.reshape(n, 6, -1)
        return ReducedCofactor(pattern, blocks, border.copy(), corner)


def dense_matrix(normals: ReducedNormals) -> Floats:
    """The reduced normal matrix S in full, (6 n + g, 6 n + g), symmetric."""
    n, g = normals.pattern.images, len(normals.rhs_border)
    matrix = np.zeros((6 * n + g, 6 * n + g))
    rows = 6 * normals.pattern.row[:, None, None] + np.arange(6)[:, None]
    columns = 6 * normals.pattern.column[:, None, None] + np.arange(6)
    matrix[rows, columns] = normals.blocks
    matrix[: 6 * n, 6 * n :] = normals.border.reshape(6 * n, g)
    matrix[6 * n :, 6 * n :] = normals.corner
    upper = np.triu(matrix)
    return upper + np.triu(upper, 1).T


def factorize(normals: ReducedNormals) -> Factorization:
    """Factorise the reduced normal equations.

    Raises
    ------
    SingularNormalsError : if they are singular, with the undetermined directions.
    """
    matrix = dense_matrix(normals)
    diagonal = np.diagonal(matrix)
    # A parameter nothing observes has a zero row; scaling it with one keeps it visible as a defect.
    unreduced = np.concatenate([normals.diagonal_exposure.ravel(), normals.diagonal_border])
    usable = (diagonal > _SINGULAR * unreduced) & (diagonal > 0.0)
    scale = np.where(usable, 1.0 / np.sqrt(np.where(usable, diagonal, 1.0)), 0.0)
    scaled = matrix * scale[:, None] * scale[None, :]
    if usable.all():
        factor, info = scipy.linalg.lapack.dpotrf(scaled, lower=1, clean=1)
        if info == 0 and np.min(np.diagonal(factor)) ** 2 > _SINGULAR:
            return DenseCholesky(normals, scale, factor)
    natural = np.where(scale > 0.0, scale, 1.0)
    raise SingularNormalsError(natural[:, None] * _null_space(scaled), natural)


def _null_space(scaled: Floats) -> Floats:
    """Orthonormal basis of the undetermined directions; a zero row and column is one of them."""
    values, vectors = np.linalg.eigh(scaled)
    null: Floats = vectors[:, values < _SINGULAR * 100.0]
    return null if null.shape[1] > 0 else vectors[:, :1]
