"""The image points' part of the reduced normal equations, lane by lane."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.errors import DatumDefectError, InconsistentBlockError
from adjust.parameters import State
from adjust.solve import reduction_kernel
from adjust.solve.border_columns_kernel import TILE
from adjust.solve.joined_points import Couplings
from adjust.solve.lanes import Lane, in_order, lanes
from adjust.solve.system import System


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over observations that grow in place.

    Attributes
    ----------
    blocks : (blocks, 6, 6) upper block triangle of the exposures.
    border : (n, 6, g) exposures × system parameters.  corner : (g, g).
    rhs_exposure : (n, 6).  rhs_border : (g,).
    diagonal_exposure : (n, 6), diagonal_border : (g,) of the unreduced normal equations.
    """

    blocks: Floats
    border: Floats
    corner: Floats
    rhs_exposure: Floats
    rhs_border: Floats
    diagonal_exposure: Floats
    diagonal_border: Floats

    @classmethod
    def zero(cls, blocks: int, images: int, border: int) -> Sums:
        """Nothing yet, for so many blocks, images and system parameters."""
        return cls(
            np.zeros((blocks, 6, 6)),
            np.zeros((images, 6, border)),
            np.zeros((border, border)),
            np.zeros((images, 6)),
            np.zeros(border),
            np.zeros((images, 6)),
            np.zeros(border),
        )

    def clear(self) -> None:
        """Start again with nothing, in the same memory."""
        for field in fields(self):
            getattr(self, field.name).fill(0.0)

    def grow(self, other: Sums) -> None:
        """Add the sums of other observations with the same columns."""
        for field in fields(self):
            mine = getattr(self, field.name)
            mine += getattr(other, field.name)

    def add(self, other: Sums, columns: Ints) -> None:
        """Add the sums of other observations that know only the system parameters in these columns.

        Of their corner only the upper triangle is used.
        """
        for mine, its in (
            (self.blocks, other.blocks),
            (self.rhs_exposure, other.rhs_exposure),
            (self.diagonal_exposure, other.diagonal_exposure),
        ):
            mine += its
        count = len(columns)
        self.border[:, :, columns] += other.border[:, :, :count]
        upper = np.triu(other.corner[:count, :count])
        self.corner[np.ix_(columns, columns)] += upper + np.triu(upper, 1).T
        self.rhs_border[columns] += other.rhs_border[:count]
        self.diagonal_border[columns] += other.diagonal_border[:count]


def reduce_image_points(
    system: System,
    state: State,
    damping: float,
    sums: Sums,
    point_normal: Floats,
    point_rhs: Floats,
    couplings: Couplings,
) -> tuple[float, float]:
    """Add all image points to the sums and eliminate the object points.

    Parameters
    ----------
    point_normal, point_rhs : (m, 3, 3) and (m, 3), what other groups add to the object points; on return
        the lower Cholesky factors of N_pp and the full right-hand sides.
    couplings : of object points with the unknowns of joins.

    Returns
    -------
    weighted_squares, eliminated : vᵀPv of the image points and Σ b_pᵀ N_pp⁻¹ b_p.

    Raises
    ------
    DatumDefectError : if an object point is not determined by its observations.
    InconsistentBlockError : if an object point lies behind a camera that sees it.
    """
    pattern = system.pattern
    columns = system.ray_columns
    touched = system.touched_columns
    tiles = -(-len(touched) // TILE)
    # The sums of lanes that have been added up serve the next ones: fresh memory would take longer.
    spent: deque[Sums] = deque()

    def work(lane: Lane) -> tuple[Sums, float, float, int, int]:
        try:
            mine = spent.pop()
            mine.clear()
        except IndexError:
            mine = Sums.zero(len(pattern.column), pattern.events, TILE * tiles)
        return mine, *reduction_kernel.reduce_points(
            *system.rays_of_lane(state, lane),
            columns.compact,
            *couplings.columns(len(columns.border)),
            damping,
            pattern.row_start,
            pattern.column,
            mine.blocks.reshape(-1, 6),
            mine.border.reshape(6 * pattern.events, TILE * tiles),
            mine.corner,
            mine.rhs_exposure,
            mine.rhs_border[np.newaxis],
            mine.diagonal_exposure,
            mine.diagonal_border[np.newaxis],
            point_normal,
            point_rhs,
        )

    weighted_squares = eliminated = 0.0
    of_lanes: Sums | None = None
    for of_lane, squares, reduction, behind, undetermined in in_order(
        work, lanes(system.point_start), system.threads
    ):
        _refuse(system.block, behind, undetermined)
        if of_lanes is None:
            of_lanes = of_lane
        else:
            of_lanes.grow(of_lane)
            spent.append(of_lane)
        weighted_squares += squares
        eliminated += reduction
    if of_lanes is not None:
        sums.add(of_lanes, touched)
    return weighted_squares, eliminated


def _refuse(block: Block, behind: int, undetermined: int) -> None:
    if behind >= 0:
        raise InconsistentBlockError(
            f"Object point {block.points[behind]} lies behind a camera that sees it. Check the angle "
            "convention, the mounting and the approximate heights."
        )
    if undetermined >= 0:
        name = block.points[undetermined]
        raise DatumDefectError(
            1, (f"object point {name}",), (f"Object point {name}: its rays do not intersect.",)
        )
