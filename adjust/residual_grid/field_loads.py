"""Fields over the format as columns of image points, and what the unknowns imitate of them.

A column C holds the whitened image coordinates that a field adds; few of them are not zero. With the design
matrix A and the normal matrix N, AᵀC is the load of the normal equations by it, and CᵀA N⁻¹ AᵀC the part of
CᵀC that no residual shows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy import sparse

from adjust.arrays import Floats, Ints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.full_vectors import FullVectors, reduced_loads
from adjust.solve.gauss_newton import Solution
from adjust.solve.system import System
from adjust.solve.whitening import add_border_columns, standardize

Sparse = sparse.csr_array


# So many image points, and so many columns, at a time bound the memory of what is between.
_AT_ONCE, _TOGETHER = 65_536, 96


@dataclass(frozen=True, eq=False)
class FieldLoads:
    """Loads AᵀC of d columns.

    Attributes
    ----------
    system, solution : of the adjustment.
    of_exposures : (6 n, d).  of_border : (g, d).  of_points : (3 m, d).
    """

    system: System
    solution: Solution
    of_exposures: sparse.csc_array[np.float64]
    of_border: Floats
    of_points: sparse.csc_array[np.float64]

    @classmethod
    def of(cls, system: System, solution: Solution, rows: Ints, columns: Sparse[np.float64]) -> Self:
        """Loads of columns (2 r, d) at image points with the numbers (r,)."""
        n, m, d = system.layout.events, system.layout.points, columns.shape[1]
        exposures, points = sparse.csr_array((6 * n, d)), sparse.csr_array((3 * m, d))
        border = np.zeros((system.border, d))
        for first in range(0, len(rows), _AT_ONCE):
            own = columns[2 * first : 2 * (first + _AT_ONCE)]
            of_unknowns = _design(system, solution.linearization, rows[first : first + _AT_ONCE])
            exposures = exposures + of_unknowns[0].T @ own
            border += np.asarray(own.T @ of_unknowns[1]).T
            points = points + of_unknowns[2].T @ own
        return cls(system, solution, sparse.csc_array(exposures), border, sparse.csc_array(points))

    @property
    def count(self) -> int:
        """Number d of columns."""
        return int(self.of_border.shape[1])

    def times(self, matrix: Floats) -> FullVectors:
        """Combinations of the loads with a matrix (d, k)."""
        layout = self.system.layout
        return FullVectors(
            np.asarray(self.of_exposures @ matrix).reshape(layout.events, 6, -1),
            self.of_border @ matrix,
            np.asarray(self.of_points @ matrix).reshape(layout.points, 3, -1),
        )

    def imitated(self) -> Floats:
        """CᵀA N⁻¹ AᵀC (d, d)."""
        system, d = self.system, self.count
        factorization = self.solution.factorization
        exposures, border = np.empty((system.layout.events, 6, d)), np.empty((system.border, d))
        for first in range(0, d, _TOGETHER):
            part = slice(first, first + _TOGETHER)
            exposures[:, :, part], border[:, part] = reduced_loads(
                system, self.solution.linearization, factorization.normals, self._full(part)
            )
        products, _ = factorization.factor.products(exposures, border)
        active = system.active_point[:, None, None]
        inverse = np.linalg.inv(np.where(active, factorization.normals.point_factor, np.eye(3)))
        m = len(inverse)
        blocks = sparse.bsr_array((inverse, np.arange(m), np.arange(m + 1)), shape=(3 * m, 3 * m))
        halves = sparse.csr_array(blocks) @ sparse.csr_array(self.of_points)
        found: Floats = products + (halves.T @ halves).toarray()
        return found

    def _full(self, part: slice) -> FullVectors:
        """Some of the loads with all their zeros."""
        layout = self.system.layout
        return FullVectors(
            self.of_exposures[:, part].toarray().reshape(layout.events, 6, -1),
            self.of_border[:, part],
            self.of_points[:, part].toarray().reshape(layout.points, 3, -1),
        )


def _design(
    system: System, state: State, rows: Ints
) -> tuple[Sparse[np.float64], Floats, Sparse[np.float64]]:
    """Whitened derivatives of image points: by exposures (2 r, 6 n), border (2 r, g), points (2 r, 3 m)."""
    layout = system.layout
    rays = system.observations.image_points.only(rows)
    border = np.zeros((len(rows), 2, system.border))
    exposures, points = Sparse((2 * len(rows), 6 * layout.events)), Sparse((2 * len(rows), 3 * layout.points))
    for term in standardize(rays, rays.linearize(state)).terms:
        if term.block == EXTERIOR_ORIENTATION:
            exposures = _sparse(term.index, term.jacobian, layout.events)
        elif term.block == OBJECT_POINT:
            points = _sparse(term.index, term.jacobian, layout.points)
        else:
            add_border_columns(border, layout.columns[term.block][term.index], term.jacobian)
    return exposures, border.reshape(2 * len(rows), -1), points


def _sparse(index: Ints, jacobian: Floats, entities: int) -> Sparse[np.float64]:
    """Derivatives (r, 2, c) by c components of the entities (r,) as a matrix (2 r, c · entities)."""
    r, _, c = jacobian.shape
    column = np.repeat(c * index[:, None] + np.arange(c), 2, axis=0)
    start = c * np.arange(2 * r + 1)
    return Sparse((jacobian.ravel(), column.ravel(), start), shape=(2 * r, c * entities))
