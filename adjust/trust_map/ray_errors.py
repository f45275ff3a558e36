"""What undetected gross errors in the image points of a block do to new points.

The same solutions y = Q Fᵀ as in `block_errors` give the effect of an error ∇ of an image coordinate,

    ∇X = yᵀ Aᵀ P e_i ∇,    y_p = −N_p⁻¹ Cᵀ y  for its object point.

These effects are local. Counted are the image points in the images that see a cell, and in all those that
have an object point in common with one of them. In five kinds of simulated blocks this was the largest
effect of all image points of the block; without GNSS positions it was smaller for a tenth of the cells, by
a half at most.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import EXTERIOR_ORIENTATION, OBJECT_POINT
from adjust.result import GroupResult, ObservationStatus
from adjust.simulate import visibility_kernel
from adjust.solve.covisibility import Covisibility
from adjust.solve.whitening import add_border_columns
from adjust.trust_map import ray_errors_kernel
from adjust.trust_map.accuracy import JointSolution
from adjust.trust_map.cells import Sight


@dataclass(frozen=True, eq=False)
class BlockRays:
    """The rays of all object points that images of some cells have, with unit weights, point after point.

    Attributes
    ----------
    start : (k + 1,) where the rays of each of the k points begin.
    point, image : (r,) place of the point, index of the image (of a rig: of its event).
    image_start, ray_of_image : rays of each image (event) of the block, image after image.
    of_exposure, of_point, of_border : (r, 2, 6), (r, 2, 3), (r, 2, g).
    detectable : (r, 2) smallest errors that are found, divided by σ; zero where nothing is counted.
    cofactor : (k, 3, 3) N_p⁻¹.
    join_start, join_column, join_vector : what distances add to C, point after point.
    """

    start: Ints
    point: Ints
    image: Ints
    image_start: Ints
    ray_of_image: Ints
    of_exposure: Floats
    of_point: Floats
    of_border: Floats
    detectable: Floats
    cofactor: Floats
    join_start: Ints
    join_column: Ints
    join_vector: Floats

    @classmethod
    def seen_from(cls, images: Ints, solution: JointSolution, tested: GroupResult) -> BlockRays:
        """Of the object points in some images (events); ``tested`` are all image points of the block."""
        system = solution.system
        rays, normals = system.observations.image_points, solution.factorization.normals
        wanted = np.zeros(system.layout.events, dtype=bool)
        wanted[images] = True
        there = np.zeros(system.layout.points, dtype=bool)
        there[rays.point[wanted[rays.event] & rays.active]] = True
        points, start, rows = _by_first_image(rays, np.flatnonzero(there[rays.point] & rays.active))
        part = rays.only(rows, np.repeat(np.arange(len(points)), np.diff(start)))
        state = replace(solution.state, object_point=solution.state.object_point[points])
        of_exposure, of_point = np.zeros((len(rows), 2, 6)), np.zeros((len(rows), 2, 3))
        of_border = np.zeros((len(rows), 2, system.border))
        for term in part.linearize(state).terms:
            local = term.block in (EXTERIOR_ORIENTATION, OBJECT_POINT)
            if not local and (system.layout.columns[term.block] < 0).all():
                continue
            term.jacobian[:] *= part.inverse_sigma[:, :, None]
            if term.block == EXTERIOR_ORIENTATION:
                of_exposure = term.jacobian
            elif term.block == OBJECT_POINT:
                of_point = term.jacobian
            else:
                add_border_columns(of_border, system.layout.columns[term.block][term.index], term.jacobian)
        counted = tested.status[rows] == ObservationStatus.USED
        detectable = np.where(counted, np.nan_to_num(tested.detectable[rows]), 0.0) / part.sigma
        join_start, column, vector = normals.couplings.columns(system.layout.border)
        cofactor = np.empty((len(points), 3, 3))
        ray_errors_kernel.cofactors_of_points(normals.point_factor, points, cofactor)
        image_start, ray_of_image = visibility_kernel.sorted_by(part.event, system.layout.events)
        return cls(
            start,
            part.point,
            part.event,
            image_start,
            ray_of_image,
            np.ascontiguousarray(of_exposure),
            np.ascontiguousarray(of_point),
            of_border,
            detectable,
            cofactor,
            *_joins(points, join_start, column, vector),
        )

    def largest_effects(self, sight: Sight, x: Floats, border: Floats) -> Floats:
        """Largest effects (c, 3) on points in c cells, from (n, 6, 3 c) and (g, 3 c) of Q Fᵀ, metres."""
        found = np.zeros((len(sight.start) - 1, 3))
        ray_errors_kernel.largest_effects(
            sight.start,
            sight.image,
            self.image_start,
            self.ray_of_image,
            self.start,
            self.point,
            self.image,
            self.of_exposure,
            self.of_point,
            self.of_border,
            self.detectable,
            self.cofactor,
            self.join_start,
            self.join_column,
            self.join_vector,
            np.ascontiguousarray(x),
            np.ascontiguousarray(border),
            found,
        )
        return found


def _by_first_image(rays: ImagePoints, rows: Ints) -> tuple[Ints, Ints, Ints]:
    """The object points (k,) of some image points, where those of each begin (k + 1,), and their rows.

    Points come in the order of the images (events) of their first rays: what is known of the points of an
    image is then close together in memory.
    """
    begun = np.flatnonzero(np.diff(rays.point[rows], prepend=-1))
    order = np.argsort(rays.event[rows[begun]], kind="stable")
    count = np.diff(begun, append=len(rows))[order]
    start = np.append(0, np.cumsum(count))
    rows = rows[np.repeat(begun[order] - start[:-1], count) + np.arange(len(rows))]
    return rays.point[rows[start[:-1]]], start, rows


def images_around(sight: Sight, pattern: Covisibility) -> Sight:
    """The images that see each cell, and those that have an object point in common with one of them."""
    n = pattern.events
    upper = csr_array((np.ones(len(pattern.column)), pattern.column, pattern.row_start), shape=(n, n))
    seen = csr_array((np.ones(len(sight.image)), sight.image, sight.start), shape=(len(sight.rays), n))
    around = seen @ (upper + upper.T)
    around.sort_indices()
    return Sight(around.indptr.astype(np.int64), around.indices.astype(np.int64))


def _joins(points: Ints, start: Ints, column: Ints, vector: Floats) -> tuple[Ints, Ints, Floats]:
    """The joins of some points alone."""
    count = np.diff(start)[points]
    own = np.append(0, np.cumsum(count))
    rows = np.repeat(start[points] - own[:-1], count) + np.arange(own[-1])
    return own, column[rows], np.ascontiguousarray(vector[rows])
