"""Cofactor matrices of a free network in the datum of its inner constraints.

The cofactors of the minimal datum in which the normal equations were factorised are brought to it by

    Q' = S Q Sᵀ,    S = I − G (G_selᵀ G)⁻¹ G_selᵀ

(Baarda 1973). With G_selᵀ G_sel = I, Z = Q G_sel, K = G_selᵀ Z and F = Z − ½ G K this is

    Q'_ij = Q_ij − G_i F_jᵀ − F_i G_jᵀ

block by block: d solutions of the normal equations, and nothing dense. S G = 0, so whatever the minimal
datum left in the direction of G vanishes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.quality.cofactor import Cofactor
from adjust.solve.factorization import ReducedCofactor
from adjust.solve.full_vectors import FullVectors, solve_full
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System

# So many blocks at a time bound the memory of what is between.
_AT_ONCE = 65_536


def with_inner_constraints(system: System, solution: Solution, quality: Cofactor) -> Cofactor:
    """The cofactors of a solution in the datum of its inner constraints; as they are if nothing is open.

    The hat matrices of image points do not depend on the datum.
    """
    movements = solution.movements
    if movements is None:
        return quality
    g = movements.vectors
    z = solve_full(system, solution.linearization, solution.factorization, movements.selected)
    f = z.minus(g.times(0.5 * movements.selected.dot(z)))
    first, second = system.joined
    between = _product(g.of_points[first], f.of_points[second])
    return replace(
        quality,
        reduced=_reduced(quality.reduced, g, f),
        of_points=_moved_points(quality.of_points, g, f),
        of_joins=quality.of_joins - between - _product(f.of_points[first], g.of_points[second]),
    )


def _reduced(given: ReducedCofactor, g: FullVectors, f: FullVectors) -> ReducedCofactor:
    """Blocks of exposures and system parameters."""
    row, column = given.pattern.row, given.pattern.column
    blocks = np.empty_like(given.blocks)
    for first in range(0, len(blocks), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        i, j = row[part], column[part]
        change = _product(g.of_exposures[i], f.of_exposures[j])
        blocks[part] = given.blocks[part] - change - _product(f.of_exposures[i], g.of_exposures[j])
    mixed = g.of_exposures @ f.of_border.T + f.of_exposures @ g.of_border.T
    half = g.of_border @ f.of_border.T
    corner = given.corner - half - half.T
    normal = _inverse(corner) if np.any(g.of_border) else given.normal
    return replace(given, blocks=blocks, border=given.border - mixed, corner=corner, normal=normal)


def _inverse(matrix: Floats) -> Floats:
    """Inverse of a positive definite matrix, with unit diagonal on the way."""
    scale = 1.0 / np.sqrt(np.diagonal(matrix))
    return np.asarray(scale[:, None] * np.linalg.inv(scale[:, None] * matrix * scale) * scale)


def _moved_points(given: Floats, g: FullVectors, f: FullVectors) -> Floats:
    """Blocks (m, 3, 3) of object points; NaN stays NaN."""
    moved = np.empty_like(given)
    for first in range(0, len(given), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        change = _product(g.of_points[part], f.of_points[part])
        moved[part] = given[part] - change - np.swapaxes(change, 1, 2)
    return moved


def _product(left: Floats, right: Floats) -> Floats:
    """Products (k, r, s) of rows (k, r, d) and (k, s, d)."""
    return np.asarray(left @ np.swapaxes(right, 1, 2))
