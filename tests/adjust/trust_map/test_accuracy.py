"""The accuracy of new points against dense matrices, and what shortcuts would say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    EXTERIOR_ORIENTATION,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    OBJECT_POINT,
    ConsideredParameters,
    ParameterPlace,
    SystemParameters,
    additional_family,
)
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.unknown_errors import CorrectionErrors, errors_of_families
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import design_matrix, full_normals
from adjust.solve.full_vectors import FullVectors
from adjust.solve.system import Observations, System
from adjust.trust_map.accuracy import (
    CellAccuracy,
    JointSolution,
    NewMeasurement,
    cell_accuracy,
    joint_solution,
    new_rays,
)
from adjust.trust_map.cells import GroundCells, Sight, sight_of
from tests.adjust.scenes import Polynomials, Scene, two_strips
from tests.adjust.trust_map.grids import cells_over, turned

MEASURED = NewMeasurement(3e-6, 1.3)
FREE = {
    BORESIGHT: True,
    LEVER_ARM: [[True, True, False]],
    INTERIOR_ORIENTATION: [[True, False, True]],
    ADDITIONAL_PARAMETERS: True,
}


@dataclass(frozen=True, eq=False)
class Mapped:
    """An adjusted block, cells on it, and their accuracy."""

    scene: Scene
    result: AdjustmentResult
    cells: GroundCells
    sight: Sight
    solution: JointSolution
    accuracy: CellAccuracy

    @classmethod
    def of(cls, scene: Scene, corrections: CorrectionErrors | None = None) -> Mapped:
        options = AdjustmentOptions()
        result = adjust_block(scene.block, scene.observations, options)
        cells = turned(cells_over(scene.truth.object_point, 9, 7))
        sight = sight_of(scene.block, result.state, cells.x_in_local)
        solution = joint_solution(result, sight)
        others = result.cofactor.considered, corrections
        accuracy = cell_accuracy(solution, cells, sight, MEASURED, *others)
        return cls(scene, result, cells, sight, solution, accuracy)


@dataclass(frozen=True, eq=False)
class Dense:
    """Covariance of all orientations and system parameters in full, and the derivatives of new rays."""

    mapped: Mapped
    covariance: Floats

    @classmethod
    def of(cls, mapped: Mapped) -> Dense:
        system = System.of(mapped.scene.block, mapped.scene.observations)
        normal, _ = full_normals(design_matrix(system, mapped.result.state))
        size = 6 * len(mapped.scene.block.images) + system.layout.border
        covariance = MEASURED.sigma0**2 * np.linalg.inv(normal)[:size, :size]
        return cls(mapped, covariance)

    def derivatives(self, cell: int, images: Ints) -> tuple[Floats, Floats]:
        """Whitened derivatives (2 k, 3) by the point and (2 k, u) by everything else, of k images."""
        mapped, block = self.mapped, self.mapped.scene.block
        state = replace(mapped.result.state, object_point=mapped.cells.x_in_local[[cell]])
        given = mapped.scene.observations.image_points
        rays = new_rays(given, state, images, np.zeros(len(images), dtype=np.int64), MEASURED.sigma)
        assert np.abs(rays.misclosure(state)).max() < 1e-10
        n, of_rest = len(block.images), np.zeros((len(images), 2, len(self.covariance)))
        of_point = np.zeros((len(images), 2, 3))
        for term in rays.linearize(state).terms:
            if term.block == OBJECT_POINT:
                of_point = term.jacobian / MEASURED.sigma
                continue
            for k, (entity, jacobian) in enumerate(zip(term.index, term.jacobian, strict=True)):
                if term.block == EXTERIOR_ORIENTATION:
                    of_rest[k][:, 6 * entity : 6 * entity + 6] += jacobian / MEASURED.sigma
                    continue
                for component, column in enumerate(block.layout.columns[term.block][entity]):
                    if column >= 0:
                        of_rest[k][:, 6 * n + column] += jacobian[:, component] / MEASURED.sigma
        of_point = of_point @ mapped.cells.local_from_axes[cell]
        return of_point.reshape(-1, 3), of_rest.reshape(-1, len(self.covariance))

    def covariance_of(self, cell: int, images: Ints) -> Floats:
        """C of a point measured in some images."""
        of_point, of_rest = self.derivatives(cell, images)
        inverse = np.linalg.inv(of_point.T @ of_point)
        moved = inverse @ of_point.T @ of_rest
        return np.asarray(inverse + moved @ self.covariance @ moved.T)


@pytest.fixture(scope="module")
def dense() -> Dense:
    return Dense.of(Mapped.of(two_strips(free=FREE, additional=True, forward=True, distances=4)))


def images_of(mapped: Mapped, cell: int) -> Ints:
    return mapped.sight.image[mapped.sight.start[cell] : mapped.sight.start[cell + 1]]


def sigmas(covariance: Floats) -> Floats:
    return np.sqrt(np.diagonal(covariance))


def seen(mapped: Mapped, least: int = 2) -> Ints:
    return np.flatnonzero(mapped.sight.rays >= least)


def test_all_rays_have_the_joint_covariance_of_their_images(dense: Dense) -> None:
    mapped = dense.mapped
    for cell in seen(mapped):
        covariance = dense.covariance_of(cell, images_of(mapped, cell))
        np.testing.assert_allclose(mapped.accuracy.sigma[cell], sigmas(covariance), rtol=1e-6)
        of_point, _ = dense.derivatives(cell, images_of(mapped, cell))
        of_block = sigmas(covariance - np.linalg.inv(of_point.T @ of_point))
        np.testing.assert_allclose(mapped.accuracy.sigma_of_block[cell], of_block, rtol=1e-6)
    assert np.isnan(mapped.accuracy.sigma[mapped.sight.rays < 2]).all()
    assert len(seen(mapped, 3)) > 10


def with_parameters_of_pairs_of_images(scene: Scene) -> Scene:
    """The block with x² and x r² of every other pair of images and of the rest; image points are shifted."""
    names, block = ("test:square", "test:radial"), scene.block
    rays = scene.observations.image_points
    of_image = np.arange(len(block.images)) // 2 % 2
    model = SelfCalibration(names, (Polynomials(names),) * 2, of_image)
    family = additional_family(names, ("µm",) * 2)
    unknown = SystemParameters(family, ("first", "second"), np.zeros((2, 2)), np.ones((2, 2), dtype=bool))
    image_points = replace(rays, self_calibration=model, offset=np.full_like(rays.xy, 1e-6))
    return replace(
        scene,
        block=replace(block, system=(*block.system, unknown)),
        observations=replace(scene.observations, image_points=image_points),
    )


def test_new_image_points_have_the_parameters_of_their_image_and_nothing_of_the_measured_ones() -> None:
    """Of these the basis is kept where Δ is linear in the parameters, and a residual grid shifts each."""
    dense = Dense.of(Mapped.of(with_parameters_of_pairs_of_images(two_strips(cameras=2, noise_seed=3))))
    mapped = dense.mapped
    measured = mapped.solution.system.observations.image_points
    assert measured.known is not None
    # More of them than were measured.
    image = np.tile(measured.image, 2)
    twice = new_rays(measured, mapped.result.state, image, np.repeat(measured.point, 2), MEASURED.sigma)
    assert np.abs(replace(twice, known=None, offset=None).misclosure(mapped.result.state)).max() < 1e-10
    for cell in seen(mapped):
        expected = sigmas(dense.covariance_of(cell, images_of(mapped, cell)))
        np.testing.assert_allclose(mapped.accuracy.sigma[cell], expected, rtol=1e-6)


def test_the_best_pair_has_the_smallest_sigma_in_height(dense: Dense) -> None:
    mapped = dense.mapped
    for cell in seen(mapped, 3)[::3]:
        pairs = [np.array(pair) for pair in combinations(images_of(mapped, cell), 2)]
        every = np.array([sigmas(dense.covariance_of(cell, pair)) for pair in pairs])
        best = every[np.argmin(every[:, 2])]
        np.testing.assert_allclose(mapped.accuracy.sigma_of_pair[cell], best, rtol=1e-6)


def test_of_many_cells_with_the_same_images_each_has_the_best_pair_of_its_own(dense: Dense) -> None:
    """Worked on by the dozen, with the best pair of the dozen before as a guess."""
    mapped = dense.mapped
    middle = mapped.cells.x_in_local[np.argmax(mapped.sight.rays)]
    cells = cells_over(np.array([middle - 25.0, middle + 25.0]), 12, 12)
    sight = sight_of(mapped.scene.block, mapped.result.state, cells.x_in_local)
    assert np.all(sight.rays == sight.rays[0])
    accuracy = cell_accuracy(mapped.solution, cells, sight, MEASURED)
    close = Dense(replace(mapped, cells=cells, sight=sight, accuracy=accuracy), dense.covariance)
    for cell in range(0, 144, 11):
        pairs = combinations(images_of(close.mapped, cell), 2)
        every = np.array([sigmas(close.covariance_of(cell, np.array(pair))) for pair in pairs])
        np.testing.assert_allclose(accuracy.sigma_of_pair[cell], every[np.argmin(every[:, 2])], rtol=1e-6)


def test_where_all_rays_are_parallel_there_is_no_point_and_no_difference_from_it() -> None:
    """The second image is taken on the way of a ray of the first one to the second cell of both rows."""
    mapped = Mapped.of(two_strips(noise_seed=3))
    place = mapped.cells.x_in_local[[30, 31, 32]]
    state = mapped.result.state
    centre, rotations = state.projection_centre.copy(), state.local_from_camera.copy()
    centre[1], rotations[1] = centre[0] + 0.3 * (place[1] - centre[0]), rotations[0]
    solution = replace(
        mapped.solution, state=replace(state, projection_centre=centre, local_from_camera=rotations)
    )
    axes, neighbour = np.broadcast_to(np.eye(3), (6, 3, 3)).copy(), np.array([1, 2, -1, 4, 5, -1])
    cells = GroundCells(place[[0, 1, 2, 2, 1, 0]], axes, neighbour)
    # The third cell of the first row and the first one of the second row are seen by another image.
    sight = Sight(np.array([0, 2, 4, 7, 10, 12, 14]), np.array([0, 1, 0, 1, 0, 1, 2, 0, 1, 2, 0, 1, 0, 1]))
    found = cell_accuracy(solution, cells, sight, MEASURED)
    for values in (found.sigma, found.sigma_of_pair, found.external):
        assert np.isfinite(values).all(axis=1).tolist() == [True, False, True, True, False, True]
        assert np.isnan(values[[1, 4]]).all()
    assert np.isnan(found.sigma_relative).all()
    assert (found.uncontrolled >= 0).tolist() == [True, False, True, True, False, True]
    np.testing.assert_allclose(found.sigma_of_pair[[0, 5]], found.sigma[[0, 5]], rtol=1e-9)


def test_neighbours_are_more_accurate_to_each_other_with_their_common_errors_left_out(dense: Dense) -> None:
    mapped = dense.mapped
    compared = 0
    for cell in seen(mapped):
        other = mapped.cells.neighbour[cell]
        common = np.intersect1d(images_of(mapped, cell), images_of(mapped, other) if other >= 0 else [])
        if len(common) < 2:
            assert np.isnan(mapped.accuracy.sigma_relative[cell]).all()
            continue
        covariance, moved = np.zeros((3, 3)), []
        for place in (cell, other):
            of_point, of_rest = dense.derivatives(place, common)
            inverse = np.linalg.inv(of_point.T @ of_point)
            covariance += inverse
            moved.append(inverse @ of_point.T @ of_rest)
        difference = moved[0] - moved[1]
        covariance += difference @ dense.covariance @ difference.T
        np.testing.assert_allclose(mapped.accuracy.sigma_relative[cell], sigmas(covariance), rtol=1e-6)
        compared += 1
    assert compared > 20


def test_an_undetected_error_of_a_ray_moves_the_point_as_its_own_rays_allow(dense: Dense) -> None:
    mapped = dense.mapped
    for cell in seen(mapped)[::2]:
        of_point, of_rest = dense.derivatives(cell, images_of(mapped, cell))
        gain = np.linalg.inv(of_point.T @ of_point) @ of_point.T
        residual = np.eye(len(of_point)) - of_point @ gain
        covariance = residual @ (np.eye(len(of_point)) + of_rest @ dense.covariance @ of_rest.T) @ residual
        control = np.diagonal(residual)
        kept = control >= UNCONTROLLED
        error = NON_CENTRALITY * sigmas(covariance)[kept] / control[kept]
        expected = np.max(np.abs(gain[:, kept]) * error, axis=1)
        np.testing.assert_allclose(mapped.accuracy.external[cell], expected, rtol=1e-6)
        assert mapped.accuracy.uncontrolled[cell] == np.count_nonzero(~kept)


def test_two_rays_leave_one_coordinate_of_each_uncontrolled(dense: Dense) -> None:
    mapped = dense.mapped
    two = np.flatnonzero(mapped.sight.rays == 2)
    assert (mapped.accuracy.uncontrolled[two] >= 2).all()


def test_pairs_without_a_common_object_point_are_not_taken_as_uncorrelated() -> None:
    scene = two_strips(free={BORESIGHT: True}, noise_seed=3)
    rays = scene.observations.image_points
    # Tie points are measured along the strips only: no pair of the two strips has a common one.
    upper = rays.image >= 5
    more = np.zeros(len(scene.block.points), dtype=bool)
    more[: len(more) // 2] = True
    kept = rays.only(np.flatnonzero(upper == more[rays.point]))
    apart = replace(scene, observations=Observations(kept, scene.observations.others))
    dense = Dense.of(Mapped.of(apart))
    mapped = dense.mapped
    seeing = {pair for cell in seen(mapped) for pair in combinations(images_of(mapped, cell).tolist(), 2)}
    tied = {
        pair for point in np.unique(kept.point) for pair in combinations(kept.image[kept.point == point], 2)
    }
    assert mapped.solution.added_pairs == len(seeing - {tuple(sorted(map(int, pair))) for pair in tied}) > 0
    for cell in seen(mapped, 4):
        expected = sigmas(dense.covariance_of(cell, images_of(mapped, cell)))
        np.testing.assert_allclose(mapped.accuracy.sigma[cell], expected, rtol=1e-6)


def test_without_covariances_between_images_sigmas_would_be_wrong_by_half() -> None:
    dense = Dense.of(Mapped.of(two_strips(strips=3, images_per_strip=7, noise_seed=3, gnss=False, ins=False)))
    mapped, n = dense.mapped, len(dense.mapped.scene.block.images)
    alone = np.kron(np.eye(n), np.ones((6, 6))) * dense.covariance[: 6 * n, : 6 * n]
    shortcut = Dense(mapped, alone)
    cells = seen(mapped, 3)
    ratio = np.array(
        [sigmas(shortcut.covariance_of(c, images_of(mapped, c))) / mapped.accuracy.sigma[c] for c in cells]
    )
    assert ratio.min() < 0.5
    assert ratio.max() > 2.0


def corrections_of(block: Block) -> CorrectionErrors:
    """Errors of the unknowns by three errors of corrections, and of the corrections: anything."""
    random = np.random.default_rng(8)

    def at(image: Ints, xy: Floats) -> Floats:
        along = np.array([1.0, -0.5, 0.3]) * (xy[:, :1] - 2.0 * xy[:, 1:] + 0.01 * (image % 2)[:, None])
        return np.stack([3e-5 * along, 2e-5 * along[:, ::-1]], axis=1)

    sizes = ((len(block.images), 6, 3), (block.layout.border, 3), (len(block.points), 3, 3))
    scales = np.array([0.02, 0.02, 0.02, 4e-5, 4e-5, 4e-5])[:, None], 1.0, 0.02
    errors = FullVectors(
        *(scale * random.normal(size=size) for scale, size in zip(scales, sizes, strict=True))
    )
    families = errors_of_families(block.layout, errors.of_border)
    return CorrectionErrors(errors, families, at, (1e-6,), (1,))


@pytest.mark.parametrize("corrected", [False, True])
def test_considered_parameters_and_corrections_add_their_errors_to_every_figure(*, corrected: bool) -> None:
    scene = two_strips(noise_seed=3)
    corrections = corrections_of(scene.block) if corrected else None
    places = tuple(ParameterPlace(INTERIOR_ORIENTATION, 0, component) for component in (0, 1))
    covariance = np.array([[40.0**2, 300.0], [300.0, 25.0**2]]) * 1e-12
    known = ConsideredParameters(places, covariance)
    mapped = Mapped.of(replace(scene, block=replace(scene.block, considered=known)), corrections)
    dense, errors = Dense.of(mapped), mapped.result.cofactor.considered
    assert errors is not None

    def rays_of(cell: int, images: Ints) -> tuple[Floats, Floats, Floats]:
        """Derivatives by the point, and what orientations and considered parameters do to the rays."""
        of_point, of_rest = dense.derivatives(cell, images)
        state = replace(mapped.result.state, object_point=mapped.cells.x_in_local[[cell]])
        rays = new_rays(
            scene.observations.image_points, state, images, np.zeros(len(images), dtype=np.int64), 1.0
        )
        direct = next(t for t in rays.linearize(state).terms if t.block == INTERIOR_ORIENTATION)
        of_known = of_rest @ errors.of_unknowns.of_exposures.reshape(-1, 2)
        of_known += direct.jacobian[:, :, :2].reshape(-1, 2) / MEASURED.sigma @ known.root
        if corrections is not None:
            moved = of_rest @ corrections.of_unknowns.of_exposures.reshape(-1, 3)
            own = corrections.at(images, rays.xy).reshape(-1, 3) / MEASURED.sigma
            of_known = np.hstack([of_known, moved - own])
        return of_point, of_rest, of_known

    def gain_of(of_point: Floats) -> Floats:
        return np.asarray(np.linalg.solve(of_point.T @ of_point, of_point.T))

    def covariance_of(cell: int, images: Ints) -> Floats:
        of_point, of_rest, of_known = rays_of(cell, images)
        of_rays = np.eye(len(of_point)) + of_rest @ dense.covariance @ of_rest.T + of_known @ of_known.T
        gain = gain_of(of_point)
        return np.asarray(gain @ of_rays @ gain.T)

    for cell in seen(mapped, 3)[::4]:
        images = images_of(mapped, cell)
        np.testing.assert_allclose(
            mapped.accuracy.sigma[cell], sigmas(covariance_of(cell, images)), rtol=1e-6
        )
        pairs = [sigmas(covariance_of(cell, np.array(pair))) for pair in combinations(images, 2)]
        best = pairs[int(np.argmin([pair[2] for pair in pairs]))]
        np.testing.assert_allclose(mapped.accuracy.sigma_of_pair[cell], best, rtol=1e-6)
        of_point, of_rest, of_known = rays_of(cell, images)
        gain = gain_of(of_point)
        residual = np.eye(len(of_point)) - of_point @ gain
        of_rays = np.eye(len(of_point)) + of_rest @ dense.covariance @ of_rest.T + of_known @ of_known.T
        control = np.diagonal(residual)
        kept = control >= UNCONTROLLED
        error = NON_CENTRALITY * sigmas(residual @ of_rays @ residual.T)[kept] / control[kept]
        expected = np.max(np.abs(gain[:, kept]) * error, axis=1)
        np.testing.assert_allclose(mapped.accuracy.external[cell], expected, rtol=1e-6)
    differing = []
    for cell in np.flatnonzero(np.isfinite(mapped.accuracy.sigma_relative[:, 0])):
        other = mapped.cells.neighbour[cell]
        common = np.intersect1d(images_of(mapped, cell), images_of(mapped, other))
        own, next_to = rays_of(cell, common), rays_of(other, common)
        one, two = gain_of(own[0]), gain_of(next_to[0])
        of_rest, of_known = one @ own[1] - two @ next_to[1], one @ own[2] - two @ next_to[2]
        total = one @ one.T + two @ two.T + of_rest @ dense.covariance @ of_rest.T + of_known @ of_known.T
        np.testing.assert_allclose(mapped.accuracy.sigma_relative[cell], sigmas(total), rtol=1e-6)
        differing.append(len(common) < max(len(images_of(mapped, place)) for place in (cell, other)))
    assert {True, False} <= set(differing)


def test_with_other_errors_a_cell_has_the_same_accuracy_alone_as_behind_many_others() -> None:
    """Of the many, the last few are worked on after the others, in the same memory."""
    scene = two_strips(noise_seed=3)
    known = ConsideredParameters((ParameterPlace(INTERIOR_ORIENTATION, 0, 1),), np.array([[4e-10]]))
    corrections = corrections_of(scene.block)
    mapped = Mapped.of(replace(scene, block=replace(scene.block, considered=known)), corrections)
    middle = mapped.cells.x_in_local[np.argmax(mapped.sight.rays)]
    many = turned(cells_over(np.array([middle - 25.0, middle + 25.0]), 6, 6))
    few = GroundCells(many.x_in_local[-6:], many.local_from_axes[-6:], np.append(np.arange(1, 6), -1))
    others = mapped.result.cofactor.considered, corrections
    of_many, alone = (
        cell_accuracy(
            mapped.solution,
            cells,
            sight_of(scene.block, mapped.result.state, cells.x_in_local),
            MEASURED,
            *others,
        )
        for cells in (many, few)
    )
    for name in ("sigma", "sigma_of_pair", "sigma_relative", "external", "uncontrolled"):
        found, expected = getattr(of_many, name)[-6:], getattr(alone, name)
        np.testing.assert_allclose(found, expected, rtol=1e-9, err_msg=name)
    assert np.isfinite(alone.sigma_relative[:-1]).all()
