"""Vectors over all unknowns, and solutions N x = b and products bᵀ N⁻¹ b of the full normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.parameters import State
from adjust.solve import elimination_kernel
from adjust.solve.factorization import Factorization
from adjust.solve.lanes import Lane, in_order, lanes
from adjust.solve.normal_equations import ReducedNormals, substitute_back
from adjust.solve.system import System


@dataclass(frozen=True, eq=False)
class FullVectors:
    """Some vectors (u, d) over the unknowns, in the three parts the normal equations have.

    Attributes
    ----------
    of_exposures : (n, 6, d).  of_border : (g, d), with the unknowns of joins behind the system parameters.
    of_points : (m, 3, d); zero for object points that are not used.
    """

    of_exposures: Floats
    of_border: Floats
    of_points: Floats

    @property
    def count(self) -> int:
        """Number d of vectors."""
        return int(self.of_border.shape[1])

    def times(self, matrix: Floats) -> FullVectors:
        """Their combinations with a matrix (d, k)."""
        return FullVectors(
            self.of_exposures @ matrix, self.of_border @ matrix, np.asarray(self.of_points @ matrix)
        )

    def minus(self, other: FullVectors) -> FullVectors:
        """Their differences from as many other vectors."""
        return FullVectors(
            self.of_exposures - other.of_exposures,
            self.of_border - other.of_border,
            self.of_points - other.of_points,
        )

    def dot(self, other: FullVectors) -> Floats:
        """Scalar products (d, k) with k other vectors."""
        products: Floats = (
            self.of_exposures.reshape(-1, self.count).T @ other.of_exposures.reshape(-1, other.count)
            + self.of_border.T @ other.of_border
            + self.of_points.reshape(-1, self.count).T @ other.of_points.reshape(-1, other.count)
        )
        return products


def joined(parts: Sequence[FullVectors]) -> FullVectors:
    """Vectors next to each other."""
    return FullVectors(
        np.concatenate([part.of_exposures for part in parts], axis=2),
        np.concatenate([part.of_border for part in parts], axis=1),
        np.concatenate([part.of_points for part in parts], axis=2),
    )


@dataclass(frozen=True, eq=False)
class SparseVectors:
    """Vectors (u, d) over the unknowns, most of which are zero at all object points.

    Attributes
    ----------
    of_exposures : (n, 6, d).  of_border : (g, d).
    numbers : (k,) numbers of the vectors that are not zero at all object points.
    of_points : (m, 3, k) those at the object points.
    """

    of_exposures: Floats
    of_border: Floats
    numbers: Ints
    of_points: Floats

    @classmethod
    def zeros(cls, system: System, count: int) -> SparseVectors:
        """Vectors of zeros over the unknowns of a system."""
        layout, nothing = system.layout, np.zeros(0, dtype=np.int64)
        at_points = np.zeros((layout.points, 3, 0))
        return cls(np.zeros((layout.events, 6, count)), np.zeros((system.border, count)), nothing, at_points)

    def with_points_of(self, numbers: Ints) -> SparseVectors:
        """The same with zeros at the object points, to be written into, for vectors without a part there."""
        more = np.setdiff1d(numbers, self.numbers)
        if len(more) == 0:
            return self
        points, known = len(self.of_points), len(self.numbers)
        at_points = np.zeros((points, 3, known + len(more)))
        at_points[:, :, :known] = self.of_points
        return replace(self, numbers=np.concatenate([self.numbers, more]), of_points=at_points)

    def places_of(self, numbers: Ints) -> Ints:
        """Where vectors with these numbers are in ``of_points``."""
        order = np.argsort(self.numbers)
        return order[np.searchsorted(self.numbers, numbers, sorter=order)]

    def products_with(self, others: FullVectors) -> Floats:
        """Scalar products (d, k) of d other vectors with these."""
        d = others.count
        products: Floats = (
            others.of_exposures.reshape(-1, d).T @ self.of_exposures.reshape(-1, self.of_border.shape[1])
            + others.of_border.T @ self.of_border
        )
        products[:, self.numbers] += others.of_points.reshape(-1, d).T @ self.of_points.reshape(
            -1, len(self.numbers)
        )
        return products

    def full(self, active: Bools) -> FullVectors:
        """The same vectors with all their zeros; those at object points (m,) that are not used are zero."""
        at_points = np.zeros((*self.of_points.shape[:2], self.of_border.shape[1]))
        at_points[:, :, self.numbers] = np.where(active[:, None, None], self.of_points, 0.0)
        return FullVectors(self.of_exposures, self.of_border, at_points)


def inverse_products(
    system: System, state: State, factorization: Factorization, vectors: SparseVectors
) -> tuple[Floats, Floats]:
    """Products bᵀ N⁻¹ b (d, d) of vectors, and the border (g, d) of their solutions N⁻¹ b.

    With the object points eliminated, bᵀ N⁻¹ b = rᵀ R⁻¹ r + yᵀ y with the reduced vectors r, the reduced
    matrix R and y = L⁻¹ b_p of the factors N_pp = L Lᵀ, and the first product likewise: of the solutions
    the system parameters alone are needed.

    Parameters
    ----------
    state : that of linearisation.
    vectors : ``of_exposures`` and ``of_points`` are used up.
    """
    normals = factorization.normals
    of_exposures, of_border = vectors.of_exposures, vectors.of_border.copy()
    numbers, at_points = vectors.numbers, vectors.of_points
    of_eliminated = np.zeros((len(numbers), len(numbers)))
    if len(numbers):
        at_points[~system.active_point] = 0.0
        load = FullVectors(of_exposures[:, :, numbers], of_border[:, numbers], at_points)
        of_exposures[:, :, numbers], of_border[:, numbers] = reduced_loads(system, state, normals, load)
        elimination_kernel.substitute_forward(normals.point_factor, system.active_point, at_points)
        y = at_points.reshape(-1, len(numbers))
        of_eliminated = y.T @ y
    products, border = factorization.factor.products(of_exposures, of_border)
    products[np.ix_(numbers, numbers)] += of_eliminated
    return products, border


def solve_full(
    system: System, state: State, factorization: Factorization, right_hand_sides: FullVectors
) -> FullVectors:
    """Solutions N x = b of the factorised normal equations for several b.

    Parameters
    ----------
    state : that of linearisation.
    """
    normals = factorization.normals
    rhs_exposure, rhs_border = reduced_loads(system, state, normals, right_hand_sides)
    parts = (rhs_exposure, rhs_border, right_hand_sides.of_points)
    found = FullVectors(*(np.empty_like(part) for part in parts))
    found.of_exposures[:], found.of_border[:] = factorization.factor.solve(rhs_exposure, rhs_border)
    for t in range(right_hand_sides.count):
        exposures, border = (
            np.ascontiguousarray(part[..., t]) for part in (found.of_exposures, found.of_border)
        )
        with_load = replace(normals, point_rhs=np.ascontiguousarray(right_hand_sides.of_points[:, :, t]))
        found.of_points[:, :, t] = substitute_back(system, state, with_load, exposures, border)
    return found


def reduced_loads(
    system: System, state: State, normals: ReducedNormals, given: FullVectors
) -> tuple[Floats, Floats]:
    """Right-hand sides (n, 6, d) and (g, d) after elimination of the object points."""
    columns, touched = system.ray_columns, system.touched_columns

    def work(lane: Lane) -> tuple[Floats, Floats]:
        # Not in the order of `given`, for each of which the kernel would be compiled.
        of_exposures = np.zeros(given.of_exposures.shape)
        of_border = np.zeros((len(touched), given.count))
        elimination_kernel.subtract_eliminated(
            *system.rays_of_lane(state, lane),
            columns.compact,
            *normals.couplings.columns(len(columns.border)),
            normals.point_factor,
            given.of_points,
            of_exposures,
            of_border,
        )
        return of_exposures, of_border

    exposures, border = given.of_exposures.copy(), given.of_border.copy()
    for of_exposures, of_border in in_order(work, lanes(system.point_start), system.threads):
        exposures += of_exposures
        border[touched] += of_border
    return exposures, border
