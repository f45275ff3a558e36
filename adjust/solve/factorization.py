"""Solution and inverse of the reduced normal equations, behind one small interface.

Helmert blocking does the work; here stands what the rest of the adjustment sees of it: the solution,
the marginal cofactor blocks on the pattern of co-visible exposures, and the null space where there is
one. Everything is scaled to unit diagonal first: metres, radians and micrometres in one matrix
would destroy its condition.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.solve.covisibility import Covisibility
from adjust.solve.helmert_blocking import HelmertFactor, factorize_blocks
from adjust.solve.normal_equations import ReducedNormals
from adjust.solve.null_space import null_space

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
    normal : (g, g) inverse of ``corner``: normal matrix of the system parameters with all else eliminated.
        Not found by inversion, so that it keeps its digits where ``corner`` has lost them.
    reduced_diagonal : of the reduced normal matrix of the system parameters, without joins, where only the
        object points are eliminated.
    """

    pattern: Covisibility
    blocks: Floats
    border: Floats
    corner: Floats
    normal: Floats
    reduced_diagonal: Floats

    @property
    def of_exposures(self) -> Floats:
        """(n, 6, 6) of each exposure with itself."""
        return self.blocks[self.pattern.diagonal]

    def between(self, one: Ints, other: Ints) -> Floats:
        """(k, 6, 6) of exposures with others, pairs of the pattern in either order."""
        found = self.blocks[self.pattern.find(one, other)]
        return np.where((one <= other)[:, None, None], found, np.swapaxes(found, 1, 2))


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
class Factorization:
    """The factorised reduced system.

    Attributes
    ----------
    normals : what was factorised.
    factor : of the matrix, scaled to a unit diagonal by the standard deviation each unknown would have
        if all others of the reduced system were known.
    """

    normals: ReducedNormals
    factor: HelmertFactor

    def solve(self) -> tuple[Floats, Floats]:
        """Increments (n, 6) of the exposures and (g,) of the system parameters."""
        return self.factor.solve(self.normals.rhs_exposure, self.normals.rhs_border)

    def cofactor(self, pattern: Covisibility | None = None, keep: bool = False) -> ReducedCofactor:
        """Blocks of the inverse on a pattern; None: that of the matrix. keep as of the factor."""
        return ReducedCofactor(
            pattern or self.normals.pattern,
            *self.factor.inverse(pattern, keep),
            self.factor.border_normal(),
            self.normals.diagonal_of_parameters,
        )


def factorize(normals: ReducedNormals, threads: int = 1) -> Factorization:
    """Factorise the reduced normal equations.

    Raises
    ------
    SingularNormalsError : if they are singular, with the undetermined directions.
    """
    pattern = normals.pattern
    diagonal = np.diagonal(normals.blocks[pattern.diagonal], axis1=1, axis2=2)
    scale_exposure = _scale(diagonal, normals.diagonal_exposure)
    scale_border = _scale(np.diagonal(normals.corner), normals.diagonal_border)
    if (scale_exposure > 0.0).all() and (scale_border > 0.0).all():
        factor = factorize_blocks(
            normals.blocking,
            normals.blocks,
            normals.border,
            normals.corner,
            scale_exposure,
            scale_border,
            threads,
        )
        if factor is not None and factor.smallest_pivot > _SINGULAR:
            return Factorization(normals, factor)
    scale = np.concatenate([scale_exposure.ravel(), scale_border])
    natural = np.where(scale > 0.0, scale, 1.0)
    null = null_space(normals, scale_exposure, scale_border, _SINGULAR * 100.0, threads)
    raise SingularNormalsError(natural[:, None] * null, natural)


def _scale(diagonal: Floats, unreduced: Floats) -> Floats:
    """Inverse roots of a diagonal; 0 where the elimination of the object points has left nothing of it.

    A parameter nothing observes has a zero row; the zero keeps it visible as a defect.
    """
    usable = (diagonal > _SINGULAR * unreduced) & (diagonal > 0.0)
    return np.where(usable, 1.0 / np.sqrt(np.where(usable, diagonal, 1.0)), 0.0)
