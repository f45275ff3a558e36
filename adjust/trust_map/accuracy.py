"""Accuracy of newly measured ground points, from the joint covariance of all images that see them.

    M = Σ A_XᵀA_X,    F = −M⁻¹ Σ A_XᵀA_z,    C_X = M⁻¹ + σ0² F Q_zz Fᵀ

with the whitened rays of the new point and z, the orientations of its images and the system parameters. Q_zz
needs the block of every pair of images that see a cell, also of those without a common object point: the
factorised normal equations of the adjustment give all of them, and nothing is taken as zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.one_thread import one_thread
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    INTERIOR_ORIENTATION,
    OBJECT_POINT,
    State,
)
from adjust.quality.considered_errors import ConsideredErrors
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.picture_cofactor import reduced_to_pictures
from adjust.quality.unknown_errors import CorrectionErrors
from adjust.result import AdjustmentResult
from adjust.solve.covisibility import Covisibility
from adjust.solve.factorization import Factorization, ReducedCofactor
from adjust.solve.lanes import in_any_order
from adjust.solve.system import System
from adjust.trust_map import accuracy_kernel, differences_kernel, groups_kernel, pairs_kernel
from adjust.trust_map.cells import GroundCells, Sight
from adjust.trust_map.groups import CellGroups

# Rays of the cells that are worked on together: enough that many cells have the same images. Fewer, where
# each ray has derivatives of its own by additional parameters.
_RAYS_AT_ONCE, _RAYS_WITH_PARAMETERS = 1_000_000, 300_000
# With more errors of other kinds than this, fewer.
_ERRORS = 16
# The distortion of an image point is found in so many steps; each leaves a thousandth of it at most.
_STEPS = 3


@dataclass(frozen=True, eq=False)
class NewMeasurement:
    """How a new ground point is measured.

    Attributes
    ----------
    sigma : of an image coordinate, metres.
    sigma0 : factor of the σ that come from the adjustment.
    """

    sigma: float
    sigma0: float


@dataclass(frozen=True, eq=False)
class CellAccuracy:
    """Accuracy of a point in each of m cells, along the axes of the cells, metres; NaN where there is none.

    Attributes
    ----------
    rays : (m,) number of images that see the cell.
    sigma : (m, 3) measured in all of them.
    sigma_of_block : (m, 3) the part of it that comes from the block, without that of the new measurement.
    sigma_of_pair : (m, 3) measured in the two of them that give the smallest σ of the height.
    sigma_relative : (m, 3) of the difference from the next cell of the row, measured in their common images.
    external : (m, 3) largest effect of an undetected gross error in one of the rays.
    uncontrolled : (m,) number of image coordinates whose gross errors show in no residual; −1 where there
        is no point.
    """

    rays: Ints
    sigma: Floats
    sigma_of_block: Floats
    sigma_of_pair: Floats
    sigma_relative: Floats
    external: Floats
    uncontrolled: Ints


@dataclass(frozen=True, eq=False)
class JointSolution:
    """The factorised normal equations of an adjusted block, and all pairs of images that see a common cell.

    Attributes
    ----------
    system : with the observations that were used.
    state : adjusted values.
    factorization : of the reduced normal equations.
    pattern : the pairs of events with a common object point, and those that see a common cell.
    pictures : with a rig, the pairs of images that see a common cell; None: every image is an event.
    """

    system: System
    state: State
    factorization: Factorization
    pattern: Covisibility
    pictures: Covisibility | None = None

    @property
    def added_pairs(self) -> int:
        """Number of pairs of images (of a rig: events) that see a cell without a common object point."""
        return len(self.pattern.column) - len(self.system.pattern.column)

    def cofactor(self) -> ReducedCofactor:
        """Cofactors of all pairs of images, with the columns of system parameters alone."""
        found, g = self.factorization.cofactor(self.pattern), self.system.layout.border
        found = replace(
            found,
            border=np.ascontiguousarray(found.border[:, :, :g]),
            corner=np.ascontiguousarray(found.corner[:g, :g]),
        )
        if self.pictures is None:
            return found
        return reduced_to_pictures(self.state, self.system.layout, found, self.pictures)


def joint_solution(result: AdjustmentResult, sight: Sight) -> JointSolution:
    """The normal equations of an adjusted block, with every pair of images that see a common cell."""
    system, rig, n = result.system, result.block.rig, len(result.block.images)
    pattern = system.pattern
    if rig is not None:
        pictures = _seen_together(sight, n)
        pairs = rig.event_of_image[pictures.row], rig.event_of_image[pictures.column]
        return JointSolution(
            system, result.state, result.solution.factorization, pattern.with_pairs(*pairs), pictures
        )
    keys = np.unique(
        pairs_kernel.missing_pairs(sight.start, sight.image, pattern.row_start, pattern.column, n)
    )
    return JointSolution(
        system, result.state, result.solution.factorization, pattern.with_pairs(*np.divmod(keys, n))
    )


def _seen_together(sight: Sight, images: int) -> Covisibility:
    """The pairs of images that see a common cell."""
    pattern = Covisibility(np.arange(images + 1), np.arange(images))
    ends = np.arange(_RAYS_AT_ONCE, len(sight.image), _RAYS_AT_ONCE)
    bounds = np.unique([0, *np.searchsorted(sight.start, ends), len(sight.start) - 1])
    for first, last in pairwise(bounds):
        start = sight.start[first : last + 1]
        keys = pairs_kernel.missing_pairs(start, sight.image, pattern.row_start, pattern.column, images)
        pattern = pattern.with_pairs(*np.divmod(np.unique(keys), images))
    return pattern


def cell_accuracy(
    solution: JointSolution,
    cells: GroundCells,
    sight: Sight,
    measurement: NewMeasurement,
    considered: ConsideredErrors | None = None,
    corrections: CorrectionErrors | None = None,
) -> CellAccuracy:
    """Accuracy of every cell, in blocks of whole rows of the grid.

    Parameters
    ----------
    considered, corrections : what errors of considered parameters, and of corrections that new measurements
        get like those of the block, add; None without any.
    """
    m = len(cells.x_in_local)
    sigma, of_block, of_pair, relative, external = (np.full((m, 3), np.nan) for _ in range(5))
    found = CellAccuracy(sight.rays, sigma, of_block, of_pair, relative, external, np.full(m, -1))
    with one_thread():
        cofactor = solution.cofactor()

        def work(part: tuple[int, int]) -> None:
            _fill(found, part, solution, cofactor, cells, sight, measurement, others)

        others = _OtherErrors(considered, corrections)
        plain = not others.count and solution.system.observations.image_points.self_calibration is None
        together = _RAYS_AT_ONCE if plain else _RAYS_WITH_PARAMETERS * _ERRORS // max(others.count, _ERRORS)
        in_any_order(work, _parts(cells, sight, together), solution.system.threads)
    return found


@dataclass(frozen=True, eq=False)
class _OtherErrors:
    """Errors that are neither of the observations nor of new measurements; None without any."""

    considered: ConsideredErrors | None
    corrections: CorrectionErrors | None

    @property
    def count(self) -> int:
        """Number k of independent errors."""
        parts = self.considered, self.corrections
        return sum(part.of_unknowns.count for part in parts if part is not None)

    def of_rays(self, rays: ImagePoints, state: State) -> Floats:
        """Errors (r, 2, k) of computed − measured image coordinates, but for those of the object points."""
        equations = rays.linearize(state)
        of_rest = replace(equations, terms=tuple(t for t in equations.terms if t.block != OBJECT_POINT))
        errors = list[Floats]()
        if self.considered is not None:
            errors.append(self.considered.of_computed(of_rest))
        if self.corrections is not None:
            errors.append(self.corrections.of_rays(rays, of_rest))
        return np.concatenate(errors, axis=2)


def _parts(cells: GroundCells, sight: Sight, together: int) -> list[tuple[int, int]]:
    """Ranges of cells that end where a row of neighbours ends, with about so many rays each."""
    ends = np.flatnonzero(cells.neighbour < 0) + 1
    parts, first = list[tuple[int, int]](), 0
    while first < len(cells.neighbour):
        wanted = np.searchsorted(sight.start, sight.start[first] + together)
        last = int(ends[min(int(np.searchsorted(ends, max(wanted, first + 1))), len(ends) - 1)])
        parts.append((first, last))
        first = last
    return parts


def _fill(
    found: CellAccuracy,
    part: tuple[int, int],
    solution: JointSolution,
    cofactor: ReducedCofactor,
    cells: GroundCells,
    sight: Sight,
    measurement: NewMeasurement,
    others: _OtherErrors,
) -> None:
    """Fill in the cells of one part."""
    first, last = part
    start = sight.start[first : last + 1] - sight.start[first]
    image = sight.image[sight.start[first] : sight.start[last]]
    measured = solution.system.observations.image_points
    state = replace(solution.state, object_point=cells.x_in_local[first:last])
    slope, basis, of_known = np.zeros((1, 2, 5)), np.zeros((1, 2, 0)), np.zeros((0, 2, 0))
    if measured.self_calibration is not None or others.count:
        cell = np.repeat(np.arange(last - first), np.diff(start))
        exact = others.corrections is not None
        rays = new_rays(measured, state, image, cell, measurement.sigma, exact=exact)
        names = () if measured.self_calibration is None else measured.self_calibration.names
        ideal = rays.ideal(state, np.arange(len(names)), with_slope=True)
        slope, basis = ideal.slope, ideal.basis
        if others.count:
            of_known = others.of_rays(rays, state)
    neighbour = np.where(cells.neighbour[first:last] >= 0, cells.neighbour[first:last] - first, -1)
    chosen = slice(first, last)
    pattern, own_cofactor = cofactor.pattern, (cofactor.blocks, cofactor.border, cofactor.corner)
    of_images = (
        np.ascontiguousarray(state.object_point),
        cells.local_from_axes[first:last],
        (
            measured.camera_of_image,
            solution.state.pictures.projection_centre,
            solution.state.pictures.local_from_camera,
            state.system[INTERIOR_ORIENTATION],
            slope,
            basis,
        ),
        of_known,
        _columns(solution.system),
        (pattern.row_start, pattern.column, *own_cofactor),
        measurement.sigma0**2,
        measurement.sigma**2,
    )
    left = accuracy_kernel.cell_accuracies(
        start,
        image,
        CellGroups.of(start, image),
        neighbour,
        *of_images,
        NON_CENTRALITY,
        UNCONTROLLED,
        found.sigma[chosen],
        found.sigma_of_block[chosen],
        found.sigma_of_pair[chosen],
        found.sigma_relative[chosen],
        found.external[chosen],
        found.uncontrolled[chosen],
    )
    beside = neighbour[left]
    groups = CellGroups.of(*groups_kernel.common_images(start, image, left, beside))
    differences_kernel.differences_in_common_images(
        start, image, groups, left, beside, *of_images, found.sigma_relative[chosen]
    )


def new_rays(
    measured: ImagePoints, state: State, image: Ints, point: Ints, sigma: float, *, exact: bool = True
) -> ImagePoints:
    """Image points (r,) at which the object points of a state appear, as if they had been measured.

    Where they need not be exact, only the derivatives are wanted: without additional parameters these depend
    on orientations and object points alone, and the image coordinates stay zero.
    """
    r = len(image)
    rays = replace(
        measured,
        image=image,
        point=point,
        xy=np.zeros((r, 2)),
        sigma=np.full((r, 2), sigma),
        active=np.ones(r, dtype=bool),
        offset=None,
        known=None,
    )
    for _ in range(int(exact) if measured.self_calibration is None else _STEPS):
        rays = replace(rays, xy=rays.xy - rays.misclosure(state))
    return rays


def _columns(system: System) -> Ints:
    """Column of the border of c, x0, y0 and all additional parameters of each image, (n, w); −1: held."""
    columns, rays = system.layout.columns, system.observations.image_points
    of_image = columns[INTERIOR_ORIENTATION][rays.camera_of_image]
    if rays.self_calibration is None:
        return of_image
    return np.concatenate(
        [of_image, columns[ADDITIONAL_PARAMETERS][rays.self_calibration.entity_of_image]], 1
    )
