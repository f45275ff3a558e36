"""The normal equations of a block, reduced to exposures and system parameters.

Image points go through the compiled kernel; every other group takes one generic path, which only
knows misclosures, terms and whiteners. ``design_matrix`` builds the same equations in full, as an
independent check.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.observations.base import Linearization, ObservationGroup
from adjust.observations.distance import Distances
from adjust.observations.image_point import IdealRays, ImagePoints
from adjust.parameters import (
    EXTERIOR_ORIENTATION,
    INTERIOR_ORIENTATION,
    OBJECT_POINT,
    InnerConstraints,
    ParameterLayout,
    State,
)
from adjust.solve.covisibility import Covisibility, covisibility, point_starts
from adjust.solve.helmert_blocking import HelmertBlocking
from adjust.solve.joined_points import Couplings, Joins, joined_points
from adjust.solve.lanes import Lane
from adjust.solve.ray_columns import RayColumns, ray_columns
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

    The border is that of the system: the system parameters, then one unknown for each join of object points.

    Attributes
    ----------
    blocking : which exposure blocks are there, and in which order they are eliminated.
    blocks : (blocks, 6, 6) upper block triangle of the exposures.
    border : (n, 6, g) exposures × system parameters.  corner : (g, g).
    rhs_exposure : (n, 6).  rhs_border : (g,).
    diagonal_exposure : (n, 6), diagonal_border : (g,) of the unreduced normal equations.
    point_factor : (m, 3, 3) lower Cholesky factors of N_pp.  point_rhs : (m, 3) right-hand sides b_p.
    couplings : of object points with the unknowns of joins.
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
    couplings: Couplings
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
    joined : the object points (k,) and (k,) that observations join.
    point_start : (m + 1,) where the rays of each point begin.
    threads : how many may work at once; never changes a result.
    inner_constraints : unknowns whose approximate values carry what the observations leave open of the
        datum; None: an open datum is an error.
    """

    block: Block
    layout: ParameterLayout
    observations: Observations
    blocking: HelmertBlocking
    point_start: Ints
    active_point: Bools
    joined: tuple[Ints, Ints]
    threads: int = 1
    inner_constraints: InnerConstraints | None = None

    @classmethod
    def of(
        cls,
        block: Block,
        observations: Observations,
        threads: int = 1,
        inner_constraints: InnerConstraints | None = None,
    ) -> System:
        """Symbolic analysis of a block and its observations.

        Raises
        ------
        InconsistentBlockError : if an observation belongs to an image or object point that is not there.
        """
        _refuse_unknown_indices(block, observations)
        images, points = len(block.images), len(block.points)
        active = determined_points(block, observations)
        pattern = covisibility(observations.image_points, images, points)
        return cls(
            block,
            block.layout,
            _of_active_points(observations, active),
            HelmertBlocking.of(
                pattern.with_pairs(*_correlated_images(observations)), block.projection_centre
            ),
            point_starts(observations.image_points.point, points),
            active,
            joined_points(observations.groups),
            threads,
            inner_constraints,
        )

    def remaining(self, observations: Observations) -> System:
        """The same system after some of its observations have been rejected."""
        active_point = determined_points(self.block, observations)
        # Correlation over time joins what stood on either side of a rejected observation.
        pattern = self.pattern.with_pairs(*_correlated_images(observations))
        return replace(
            self,
            observations=_of_active_points(observations, active_point),
            active_point=active_point,
            blocking=self.blocking
            if pattern is self.pattern
            else HelmertBlocking.of(pattern, self.block.projection_centre),
        )

    @property
    def pattern(self) -> Covisibility:
        """Which exposure blocks there are."""
        return self.blocking.pattern

    @property
    def border(self) -> int:
        """Columns of the border: the system parameters, and behind them the unknown of each join."""
        return self.layout.border + len(self.joined[0])

    @cached_property
    def ray_columns(self) -> RayColumns:
        """Where the system parameters that image points touch stand in the border."""
        return ray_columns(self.layout, self.observations.image_points)

    @property
    def touched_columns(self) -> Ints:
        """Columns of the border that the elimination of object points touches."""
        return np.concatenate([self.ray_columns.border, np.arange(self.layout.border, self.border)])

    def ideal_rays(self, state: State, lane: Lane) -> IdealRays:
        """The image points of the object points of a lane, corrected by the additional parameters."""
        first, last = (int(self.point_start[index]) for index in lane)
        columns = self.ray_columns
        rays = self.observations.image_points
        return rays.ideal(state, columns.components, columns.principal_point_is_free, first, last)

    def rays_of_lane(self, state: State, lane: Lane) -> tuple[Floats | Ints | Bools | int, ...]:
        """What every kernel that goes through the rays of a lane begins its arguments with.

        The object points first … last − 1, where the rays of each begin, image and camera of the rays, the
        values of a state (metres, local frame; interior orientation), the corrected rays with slope and basis
        (those of the lane alone), 1/σ, and which object points take part.
        """
        rays, ideal = self.observations.image_points, self.ideal_rays(state, lane)
        return (
            *lane,
            self.point_start,
            rays.image,
            rays.camera_of_image,
            state.projection_centre,
            state.local_from_camera,
            state.object_point,
            state.system[INTERIOR_ORIENTATION],
            ideal.xy,
            ideal.slope,
            ideal.basis,
            rays.inverse_sigma,
            self.active_point,
        )

    @property
    def unknowns(self) -> int:
        """Number u of unknowns that take part."""
        layout = self.layout
        return 6 * layout.images + 3 * int(self.active_point.sum()) + layout.border

    @property
    def redundancy(self) -> int:
        """N − u; a free network has as many more as its datum has open directions."""
        return self.observations.count - self.unknowns


def _refuse_unknown_indices(block: Block, observations: Observations) -> None:
    """The kernels do not look whether an index is in range; they would read foreign memory."""
    images, points = len(block.images), len(block.points)
    for group in observations.groups:
        # Only image points must have both; −1 elsewhere says that there is none.
        lowest = 0 if group is observations.image_points else -1
        joined = np.concatenate(joined_points((group,)))
        for kind, index, count, least in (
            ("image", group.image, images, lowest),
            ("object point", group.point, points, lowest),
            ("object point", joined, points, 0),
        ):
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
        if isinstance(group, Distances):  # it holds its points together, wherever they are
            continue
        touching = group.point >= 0
        present = group.stochastic.present[touching].sum(axis=1)
        np.add.at(equations, group.point[touching], present)
    return equations >= 3


def _correlated_images(observations: Observations) -> tuple[Ints, Ints]:
    """Pairs (k,) of images that errors correlated over time join.

    Neighbours share rows of the whitened equations, and an error of one observation alone shows in those of
    both its neighbours; what is rejected is tested between the neighbours it would have.
    """
    pairs = []
    for group in observations.others:
        neighbours = group.stochastic.neighbours
        if neighbours is not None:
            before, after = group.image[neighbours.before], group.image[neighbours.after]
            pairs += [(before, group.image), (group.image, after), (before, after)]
    if not pairs:
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing
    return np.concatenate([one for one, _ in pairs]), np.concatenate([other for _, other in pairs])


def _of_active_points(observations: Observations, active: Bools) -> Observations:
    """Without the single rays and partial surveys of object points that they do not determine."""
    kept = np.append(active, True)  # the last one serves what belongs to no object point (−1)
    rays = observations.image_points
    others = [group.without(~kept[group.point]) for group in observations.others]
    return Observations(
        rays.without(~kept[rays.point]),
        tuple(
            group.without(~kept[group.other_point]) if isinstance(group, Distances) else group
            for group in others
        ),
    )


def reduced_normals(system: System, state: State, damping: float = 0.0) -> ReducedNormals:
    """Normal equations at a state, object points eliminated; N + damping · diag N.

    Raises
    ------
    DatumDefectError : if an object point is not determined by its observations.
    InconsistentBlockError : if an object point lies behind a camera that sees it.
    """
    layout = system.layout
    m, g = layout.points, system.border
    sums = Sums.zero(len(system.pattern.column), layout.images, g)
    point_normal, point_rhs = np.zeros((m, 3, 3)), np.zeros((m, 3))
    squares, joins = 0.0, list[Joins]()
    for group in system.observations.others:
        equations = whiten(group, group.linearize(state))
        squares += float(np.sum(equations.misclosure**2))
        joined = Joins.of(equations)
        if joined is None:
            _add_group(sums, equations, system, point_normal, point_rhs)
        else:
            joins.append(joined)
            joined.add_to(point_normal, point_rhs)
    # Each unknown t stands in two halves with the weight 2, whether its observation takes part or not.
    own = np.arange(layout.border, g)
    sums.corner[own, own] = 4.0
    couplings = Couplings.of(joins, m)
    sums.diagonal_exposure[:] = np.diagonal(sums.blocks[system.pattern.diagonal], axis1=1, axis2=2)
    sums.diagonal_border[:] = np.diagonal(sums.corner)
    of_images, eliminated = reduce_image_points(
        system, state, damping, sums, point_normal, point_rhs, couplings
    )
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
        couplings,
        squares + of_images,
        eliminated,
    )


def _add_group(
    sums: Sums, equations: Linearization, system: System, point_normal: Floats, point_rhs: Floats
) -> None:
    """Add one group of whitened observation equations, whatever it is."""
    of_exposures, of_border, of_point = _gathered(equations, system.layout, system.border)
    if of_point is not None:
        index, jacobian = of_point
        np.add.at(point_normal, index, np.swapaxes(jacobian, 1, 2) @ jacobian)
        np.add.at(point_rhs, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
    for number, (index, jacobian) in enumerate(of_exposures):
        transposed = np.swapaxes(jacobian, 1, 2)
        np.add.at(sums.blocks, system.pattern.diagonal[index], transposed @ jacobian)
        np.add.at(sums.rhs_exposure, index, np.einsum("nij,ni->nj", jacobian, equations.misclosure))
        np.add.at(sums.border, index, transposed @ of_border)
        for other, of_other in of_exposures[:number]:
            _add_pairs(sums, system.pattern, (index, other), transposed @ of_other)
    sums.corner[:] += np.einsum("nij,nik->jk", of_border, of_border)
    sums.rhs_border[:] += np.einsum("nij,ni->j", of_border, equations.misclosure)


def _add_pairs(sums: Sums, pattern: Covisibility, images: tuple[Ints, Ints], products: Floats) -> None:
    """Add J_aᵀ J_b (n, 6, 6) of rows that touch two exposures to the upper block triangle."""
    one, other = images
    turned = np.swapaxes(products, 1, 2)
    here = np.where((one < other)[:, None, None], products, turned)
    # An observation without neighbours touches its own exposure twice, the second time with zeros.
    here = np.where((one == other)[:, None, None], products + turned, here)
    position = pattern.find(one, other)
    if np.any(position < 0):
        raise InconsistentBlockError("An observation touches two images whose block is not in the pattern.")
    np.add.at(sums.blocks, position, here)


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
    return increments_of_points(system, state, normals, of_exposures, of_border)


def whiten(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The same observation equations with unit weight matrix.

    Where errors are correlated over time, every row also has the terms of the observation before.
    """
    alone, neighbours = standardize(group, equations), group.stochastic.neighbours
    return alone if neighbours is None else alone.combined(neighbours, neighbours.whitening)


def standardize(group: ObservationGroup, equations: Linearization) -> Linearization:
    """The same observation equations with every row multiplied by the W of its observation by itself."""
    whitener = group.stochastic.whitener
    terms = tuple(type(term)(term.block, term.index, whitener @ term.jacobian) for term in equations.terms)
    return Linearization(group.stochastic.standardized(equations.misclosure), terms)


def _gathered(
    equations: Linearization, layout: ParameterLayout, border: int
) -> tuple[list[tuple[Ints, Floats]], Floats, tuple[Ints, Floats] | None]:
    """Jacobians by kind: (index, (n, m, 6)) of exposures, (n, m, g) of the border, (index, (n, m, 3))."""
    n, m = equations.misclosure.shape
    of_border = np.zeros((n, m, border))
    of_exposures, of_points = list[tuple[Ints, Floats]](), list[tuple[Ints, Floats]]()
    for term in equations.terms:
        if term.block == EXTERIOR_ORIENTATION:
            of_exposures.append((term.index, term.jacobian))
        elif term.block == OBJECT_POINT:
            of_points.append((term.index, term.jacobian))
        else:
            add_border_columns(of_border, layout.columns[term.block][term.index], term.jacobian)
    if len(of_points) > 1 or (of_points and (of_exposures or np.any(of_border))):
        raise InconsistentBlockError(
            "Only image points may connect object points with other unknowns; the object points are "
            "eliminated first."
        )
    return of_exposures, of_border, of_points[0] if of_points else None


def add_border_columns(of_border: Floats, columns: Ints, jacobian: Floats) -> None:
    """Scatter the Jacobian (n, m, d) of a family into (n, m, g); columns (n, d), −1 where held."""
    for component in range(columns.shape[1]):
        rows = np.flatnonzero(columns[:, component] >= 0)
        of_border[rows, :, columns[rows, component]] += jacobian[rows, :, component]
