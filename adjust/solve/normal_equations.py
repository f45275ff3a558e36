"""The normal equations of a block, reduced to exposures and system parameters.

Image points go through the compiled kernel; every other group takes one generic path, which only
knows misclosures, terms and whiteners. ``design_matrix`` builds the same equations in full, as an
independent check.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.observations.base import Linearization, ObservationGroup
from adjust.observations.image_point import ImagePoints
from adjust.parameters import (
    EXTERIOR_ORIENTATION,
    OBJECT_POINT,
    ParameterLayout,
    State,
)
from adjust.solve.covisibility import Covisibility, covisibility, point_starts
from adjust.solve.helmert_blocking import HelmertBlocking
from adjust.solve.reduction import Sums, increments_of_points, reduce_image_points


@dataclass(frozen=True, eq=False)
class Observations:
    """All observations of a block: the image points, and every other group."""

    image_points: ImagePoints
    others: tuple[ObservationGroup, ...]

    @property
    def groups(self) -> tuple[ObservationGroup, ...]:
        """All groups, image points first."""
        return (self.image_points, *self.others)

    @property
    def count(self) -> int:
        """Number n of scalar observations that take part."""
        return int(sum(int(group.stochastic.present.sum()) for group in self.groups))


@dataclass(frozen=True, eq=False)
class ReducedNormals:
    """S dq = s after elimination of the object points, and what is needed to go back to them.

    Attributes
    ----------
    blocking : which exposure blocks are there, and in which order they are eliminated.
    blocks : (blocks, 6, 6) upper block triangle of the exposures.
    border : (n, 6, g) exposures × system parameters.  corner : (g, g).
    rhs_exposure : (n, 6).  rhs_border : (g,).
    diagonal_exposure : (n, 6), diagonal_border : (g,) of the unreduced normal equations.
    point_factor : (m, 3, 3) lower Cholesky factors of N_pp.  point_rhs : (m, 3) right-hand sides b_p.
    weighted_squares : vᵀPv at the state of linearisation.
    eliminated : Σ b_pᵀ N_pp⁻¹ b_p.
    """

    blocking: HelmertBlocking
    blocks: Floats
    border: Floats
    corner: Floats
    rhs_exposure: Floats
    rhs_border: Floats
    diagonal_exposure: Floats
    diagonal_border: Floats
    point_factor: Floats
    point_rhs: Floats
    weighted_squares: float
    eliminated: float

    @property
    def pattern(self) -> Covisibility:
        """Which exposure blocks are there."""
        return self.blocking.pattern


@dataclass(frozen=True, eq=False)
class System:
    """What stays the same over the iterations: unknowns, observations, sparsity.

    Attributes
    ----------
    observations : those that take part; what belongs to an object point that is no unknown is taken out.
    active_point : (m,) object points that are unknown; the others have lost too many rays.
    point_start : (m + 1,) where the rays of each point begin.
    threads : how many may work at once; never changes a result.
    """

    block: Block
    layout: ParameterLayout
    observations: Observations
    blocking: HelmertBlocking
    point_start: Ints
    active_point: Bools
    threads: int = 1

    @classmethod
    def of(cls, block: Block, observations: Observations, threads: int = 1) -> System:
        """Symbolic analysis of a block and its observations.

        Raises
        ------
        InconsistentBlockError : if an observation belongs to an image or object point that is not there.
        """
        _refuse_unknown_indices(block, observations)
        images, points = len(block.images), len(block.points)
        active = determined_points(block, observations)
        return cls(
            block,
            block.layout,
            _of_active_points(observations, active),
            HelmertBlocking.of(
                covisibility(observations.image_points, images, points), block.projection_centre
            ),
            point_starts(observations.image_points.point, points),
            active,
            threads,
        )

    def remaining(self, observations: Observations) -> System:
        """The same system after some of its observations have been rejected."""
        active_point = determined_points(self.block, observations)
        return replace(
            self, observations=_of_active_points(observations, active_point), active_point=active_point
        )

    @property
    def pattern(self) -> Covisibility:
        """Which exposure blocks there are."""
        return self.blocking.pattern

    @property
    def unknowns(self) -> int:
        """Number u of unknowns that take part."""
        layout = self.layout
        return 6 * layout.images + 3 * int(self.active_point.sum()) + layout.border

    @property
    def redundancy(self) -> int:
        """N − u."""
        return self.observations.count - self.unknowns


def _refuse_unknown_indices(block: Block, observations: Observations) -> None:
    """The kernels do not look whether an index is in range; they would read foreign memory."""
    images, points = len(block.images), len(block.points)
    for group in observations.groups:
        # Only image points must have both; −1 elsewhere says that there is none.
        least = 0 if group is observations.image_points else -1
        for kind, index, count in (("image", group.image, images), ("object point", group.point, points)):
            if index.size and not (index.min() >= least and index.max() < count):
                raise InconsistentBlockError(
                    f"An observation of {group.name} has an index of its {kind} outside 0 … {count - 1}."
                )
    camera = observations.image_points.camera_of_image
    if camera.shape != (images,) or (
        images and not (camera.min() >= 0 and camera.max() < len(block.cameras))
    ):
        raise InconsistentBlockError("The image points do not know the camera of every image of the block.")


def determined_points(block: Block, observations: Observations) -> Bools:
    """Object points (m,) with enough observations: two rays, or one and a known height, or a full survey."""
    equations = np.bincount(
        observations.image_points.point,
        weights=2.0 * observations.image_points.active,
        minlength=len(block.points),
    )
    for group in observations.others:
        touching = group.point >= 0
        present = group.stochastic.present[touching].sum(axis=1)
        np.add.at(equations, group.point[touching], present)
    return equations >= 3


def _of_active_points(observations: Observations, active: Bools) -> Observations:
    """Without the single rays and partial surveys of object points that they do not determine."""
    kept = np.append(active, True)  # the last one serves what belongs to no object point (−1)
    rays = observations.image_points
    return Observations(
        rays.without(~kept[rays.point]),
        tuple(group.without(~kept[group.point]) for group in observations.others),
    )


def reduced_normals(system: System, state: State, damping: float = 0.0) -> ReducedNormals:
    """Normal equations at a state, object points eliminated; N + damping · diag N.

    Raises
    ------
    DatumDefectError : if an object point is not determined by its observations.
    InconsistentBlockError : if an object point lies behind a camera that sees it.
    """
    layout = system.layout
    m, g = layout.points, layout.border
    sums = Sums.zero(len(system.pattern.column), layout.images, g)
    point_normal, point_rhs = np.zeros((m, 3, 3)), np.zeros((m, 3))
    squares = 0.0
    for group in system.observations.others:
        equations = whiten(group, group.linearize(state))
        squares += float(np.sum(equations.misclosure**2))
        _add_group(sums, equations, system, point_normal, point_rhs)
    sums.diagonal_exposure[:] = np.diagonal(sums.blocks[system.pattern.diagonal], axis1=1, axis2=2)
    sums.diagonal_border[:] = np.diagonal(sums.corner)
    of_images, eliminated = reduce_image_points(system, state, damping, sums, point_normal, point_rhs)
    if damping > 0.0:
        diagonal = np.arange(6)
        sums.blocks[system.pattern.diagonal[:, None], diagonal, diagonal] += damping * sums.diagonal_exposure
        sums.corner[np.arange(g), np.arange(g)] += damping * sums.diagonal_border
    return ReducedNormals(
        system.blocking,
        sums.blocks,
        sums.border,
        sums.corner,
        sums.rhs_exposure,
        sums.rhs_border,
        sums.diagonal_exposure,
        sums.diagonal_border,
        point_normal,
        point_rhs,
        squares + of_images,
        eliminated,
    )


def _add_group(
    sums: Sums, equations: Linearization, system: System, point_normal: Floats, point_rhs: Floats
) -> None:
    """Add one group of whitened observation equations, whatever it is."""
    of_exposure, of_border, of_point = _gathered(equations, system.layout)
    if of_point is not None:
        index, jacobian = of_point
        np.add.at(point_normal, index, np.swapaxes(jacobian, 1, 2) @ jacobian)
        np.add.at(point_rhs, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
    if of_exposure is not None:
        index, jacobian = of_exposure
        transposed = np.swapaxes(jacobian, 1, 2)
        np.add.at(sums.blocks, system.pattern.diagonal[index], transposed @ jacobian)
        np.add.at(sums.rhs_exposure, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
        np.add.at(sums.border, index, transposed @ of_border)
    sums.corner[:] += np.einsum("nij,nik->jk", of_border, of_border)
    sums.rhs_border[:] += np.einsum("nij,ni->j", of_border, equations.misclosure)


def weighted_squares(system: System, state: State) -> float:
    """vᵀPv at a state; NaN if an object point lies behind a camera that sees it."""
    rays = system.observations.image_points
    whitened = rays.misclosure(state) * rays.inverse_sigma
    squares = float(np.sum(np.where(rays.active[:, None], whitened, 0.0) ** 2))
    for group in system.observations.others:
        squares += float(np.sum(whiten(group, group.linearize(state)).misclosure ** 2))
    return squares


def substitute_back(
    system: System, state: State, normals: ReducedNormals, of_exposures: Floats, of_border: Floats
) -> Floats:
    """Increments (m, 3) of the object points that belong to (n, 6) and (g,) of the others."""
    return increments_of_points(
        system, state, normals.point_factor, normals.point_rhs, of_exposures, of_border
    )


def whiten(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The same observation equations with unit weight matrix: every row multiplied by W."""
    whitener = group.stochastic.whitener
    terms = tuple(type(term)(term.block, term.index, whitener @ term.jacobian) for term in equations.terms)
    return Linearization(np.einsum("nij,nj->ni", whitener, equations.misclosure), terms)


def _gathered(
    equations: Linearization, layout: ParameterLayout
) -> tuple[tuple[Ints, Floats] | None, Floats, tuple[Ints, Floats] | None]:
    """Jacobians by kind: (index, (n, m, 6)) of exposures, (n, m, g) of the border, (index, (n, m, 3))."""
    n, m = equations.misclosure.shape
    of_border = np.zeros((n, m, layout.border))
    of_exposure = of_point = None
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            of_exposure = (term.index, term.jacobian)
        elif term.block == OBJECT_POINT:
            of_point = (term.index, term.jacobian)
        else:
            add_border_columns(of_border, layout.columns[term.block][term.index], term.jacobian)
    if of_point is not None and (of_exposure is not None or np.any(of_border)):
        raise InconsistentBlockError(
            "Only image points may connect object points with other unknowns; the object points are "
            "eliminated first."
        )
    return of_exposure, of_border, of_point


def add_border_columns(of_border: Floats, columns: Ints, jacobian: Floats) -> None:
    """Scatter the Jacobian (n, m, d) of a family into (n, m, g); columns (n, d), −1 where held."""
    for component in range(columns.shape[1]):
        rows = np.flatnonzero(columns[:, component] >= 0)
        of_border[rows, :, columns[rows, component]] += jacobian[rows, :, component]
