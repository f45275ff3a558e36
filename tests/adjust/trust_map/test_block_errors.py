"""Effects of undetected errors in the block against adjustments with these errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats, Ints
from adjust.observations.base import ObservationGroup
from adjust.observations.control_point import ControlPoints
from adjust.observations.distance import Distances
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.parameters import GNSS_SHIFT, INTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.covisibility import Covisibility
from adjust.solve.system import Observations
from adjust.trust_map.accuracy import joint_solution, new_rays
from adjust.trust_map.block_errors import block_errors
from adjust.trust_map.cells import GroundCells, Sight, sight_of
from adjust.trust_map.ray_errors import BlockRays, images_around
from tests.adjust.scenes import Scene, two_strips
from tests.adjust.trust_map.grids import cells_over, turned


def with_error(group: ObservationGroup, error: Floats) -> ObservationGroup:
    """The group with errors (n, 3) added along the axes of its components."""
    if isinstance(group, GnssPositions):
        added = np.einsum("nij,nj->ni", group.local_from_enu, error)
        return replace(group, observed=group.observed + added)
    assert isinstance(group, ControlPoints)
    level = error * np.array([1.0, 1.0, 0.0])
    added = np.einsum("nij,nj->ni", group.frame.local_from_enu(group.given), level)
    return replace(group, given=group.given + added, given_height=group.given_height + error[:, 2])


def point_of(rays: ImagePoints, measured: State, used: State, place: Floats, image: Ints) -> Floats:
    """A point (3,) from image points exact in one state, intersected with the orientations of another."""
    none = np.zeros(len(image), dtype=np.int64)
    exact = new_rays(rays, replace(measured, object_point=place[None]), image, none, 1.0)
    found = place
    for _ in range(3):
        state = replace(used, object_point=found[None])
        equations = exact.linearize(state)
        jacobian = next(t.jacobian for t in equations.terms if t.block == OBJECT_POINT).reshape(-1, 3)
        found = found + np.linalg.lstsq(jacobian, equations.misclosure.ravel())[0]
    return found


def effects_of(
    wrong: Observations,
    scene: Scene,
    result: AdjustmentResult,
    cells: GroundCells,
    sight: Sight,
    chosen: Ints,
) -> Floats:
    """Effects (k, 3) on points in some cells of an adjustment with wrong observations."""
    state = estimate_block(scene.block, wrong).state
    effect = np.zeros((len(chosen), 3))
    for k, cell in enumerate(chosen):
        place, image = cells.x_in_local[cell], sight.image[sight.start[cell] : sight.start[cell + 1]]
        moved = point_of(scene.observations.image_points, result.state, state, place, image) - place
        effect[k] = moved @ cells.local_from_axes[cell]
    return effect


@pytest.mark.parametrize("correlated", [None, 30.0])
def test_the_largest_effect_is_that_of_an_adjustment_with_the_smallest_error_that_is_found(
    correlated: float | None,
) -> None:
    scene = two_strips(
        free={INTERIOR_ORIENTATION: [[True, False, False]], GNSS_SHIFT: [[True, True, False]]},
        control=("full", "covariance", "full"),
        ins=False,
        gnss_correlation_s=correlated,
    )
    result = adjust_block(scene.block, scene.observations)
    cells = turned(cells_over(scene.truth.object_point, 5, 5))
    sight = sight_of(scene.block, result.state, cells.x_in_local)
    solution = joint_solution(result, sight)
    chosen = np.flatnonzero(sight.rays >= 3)[::3]
    found = block_errors(solution, result, cells, sight, chosen)

    expected = np.zeros_like(found.of_orientation)
    for number, (group, tested) in enumerate(zip(scene.observations.others, result.groups[1:], strict=True)):
        for i, component in np.argwhere(tested.status == ObservationStatus.USED):
            error = np.zeros(group.stochastic.sigma.shape)
            error[i, component] = tested.detectable[i, component]
            wrong = list(scene.observations.others)
            wrong[number] = with_error(group, error)
            observations = Observations(scene.observations.image_points, tuple(wrong))
            effect = effects_of(observations, scene, result, cells, sight, chosen)
            expected = np.maximum(expected, np.abs(effect))
    np.testing.assert_allclose(found.of_orientation, expected, rtol=0.02, atol=2e-5)
    assert len(chosen) >= 3
    assert found.of_orientation.min() > 0.0


def test_distances_are_not_counted() -> None:
    """Nor is an error in one of them, however large it would have to be."""
    scene = two_strips(free={INTERIOR_ORIENTATION: [[True, False, False]]}, distances=4)
    result = adjust_block(scene.block, scene.observations)
    cells = turned(cells_over(scene.truth.object_point, 5, 5))
    sight = sight_of(scene.block, result.state, cells.x_in_local)
    solution = joint_solution(result, sight)
    chosen = np.flatnonzero(sight.rays >= 3)[::3]
    of_distances = [isinstance(group, Distances) for group in (None, *result.system.observations.others)]
    assert sum(of_distances) == 1
    groups = tuple(
        replace(group, detectable=np.full_like(group.detectable, 1e3)) if is_distance else group
        for group, is_distance in zip(result.groups, of_distances, strict=True)
    )
    found, same = (
        block_errors(solution, one, cells, sight, chosen) for one in (result, replace(result, groups=groups))
    )
    np.testing.assert_array_equal(same.of_orientation, found.of_orientation)
    assert 0.0 < found.of_orientation.max() < 1.0


def test_the_largest_effect_of_an_image_point_is_that_of_an_adjustment_with_the_error() -> None:
    scene = two_strips(
        images_per_strip=4,
        points_along=8,
        points_across=5,
        free={INTERIOR_ORIENTATION: [[True, False, False]]},
        control=("full", "full", "full"),
        ins=False,
        distances=4,
    )
    result = adjust_block(scene.block, scene.observations)
    cells = turned(cells_over(scene.truth.object_point, 5, 5))
    sight = sight_of(scene.block, result.state, cells.x_in_local)
    solution = joint_solution(result, sight)
    chosen = np.flatnonzero(sight.rays == sight.rays.max())[:3]
    found = block_errors(solution, result, cells, sight, chosen)

    rays, tested = scene.observations.image_points, result.groups[0]
    # The image points of all images that have an object point in common with one that sees the cell.
    of_cell = []
    for cell in chosen:
        seeing = np.isin(rays.image, sight.image[sight.start[cell] : sight.start[cell + 1]])
        beside = rays.image[np.isin(rays.point, rays.point[seeing])]
        of_cell.append(np.isin(rays.image, beside))
    expected = np.zeros_like(found.of_rays)
    counted = (tested.status == ObservationStatus.USED) & np.any(of_cell, axis=0)[:, None]
    for i, component in np.argwhere(counted):
        xy = rays.xy.copy()
        xy[i, component] += tested.detectable[i, component]
        observations = replace(scene.observations, image_points=replace(rays, xy=xy))
        effect = np.abs(effects_of(observations, scene, result, cells, sight, chosen))
        for k, there in enumerate(of_cell):
            if there[i]:
                expected[k] = np.maximum(expected[k], effect[k])
    np.testing.assert_allclose(found.of_rays, expected, rtol=0.02, atol=2e-5)
    assert found.of_rays.min() > 0.0


def test_cells_that_are_solved_for_a_few_at_a_time_have_the_same_effects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = two_strips(noise_seed=3)
    result = adjust_block(scene.block, scene.observations)
    cells = turned(cells_over(scene.truth.object_point, 6, 5))
    sight = sight_of(scene.block, result.state, cells.x_in_local)
    chosen = np.flatnonzero(sight.rays >= 2)[::-1]
    assert len(chosen) > 16
    solution = joint_solution(result, sight)
    together = block_errors(solution, result, cells, sight, chosen)
    monkeypatch.setattr(f"{block_errors.__module__}._NUMBERS_AT_ONCE", 1)
    apart = block_errors(solution, result, cells, sight, chosen)
    np.testing.assert_allclose(apart.of_orientation, together.of_orientation, rtol=1e-9)
    np.testing.assert_allclose(apart.of_rays, together.of_rays, rtol=1e-9)
    # Each of them has its own effects, whatever the order in which they are worked on.
    backwards = block_errors(solution, result, cells, sight, chosen[::-1])
    np.testing.assert_allclose(backwards.of_orientation[::-1], together.of_orientation, rtol=1e-9)
    np.testing.assert_allclose(backwards.of_rays[::-1], together.of_rays, rtol=1e-9)
    assert np.ptp(together.of_rays[:, 2]) > 0.0


def test_rejected_image_points_and_points_that_are_given_up_have_no_effect() -> None:
    """One of them surveyed; the same without the image points."""
    scene = two_strips(noise_seed=3)
    rays, (control, *others) = scene.observations.image_points, scene.observations.others
    point = np.setdiff1d(np.flatnonzero(np.bincount(rays.point) >= 4), control.point)[0]
    gone = np.isin(rays.point, [point, control.point[2]])
    gone[np.flatnonzero(rays.point == control.point[0])[0]] = True
    survey = control.without(np.arange(len(control.point)) == 2)
    cells = turned(cells_over(scene.truth.object_point, 6, 5))
    sight = sight_of(scene.block, scene.truth, cells.x_in_local)
    found = []
    for left in (rays.without(gone), rays.only(np.flatnonzero(~gone))):
        result = adjust_block(scene.block, Observations(left, (survey, *others)))
        solution = joint_solution(result, sight)
        found.append(block_errors(solution, result, cells, sight, np.flatnonzero(sight.rays >= 2)))
    np.testing.assert_allclose(found[0].of_orientation, found[1].of_orientation, rtol=1e-6)
    np.testing.assert_allclose(found[0].of_rays, found[1].of_rays, rtol=1e-6)
    assert np.isfinite(found[0].of_rays).all()


def test_of_an_object_point_only_the_rays_in_the_images_of_a_cell_are_counted() -> None:
    scene = two_strips(noise_seed=3, free={INTERIOR_ORIENTATION: [[True, False, False]]}, distances=4)
    result = adjust_block(scene.block, scene.observations)
    sight = sight_of(scene.block, result.state, scene.truth.object_point)
    images, random = np.arange(len(scene.block.images)), np.random.default_rng(3)
    solution = joint_solution(result, sight)
    rays = BlockRays.seen_from(images, solution, result.groups[0])
    x = random.normal(size=(len(images), 6, 3))
    border = random.normal(size=(solution.system.border, 3))
    for image in images:
        alone = Sight(np.array([0, 1]), np.array([image]))
        assert np.all(rays.largest_effects(alone, x, border) > 0.0)
        its = (rays.image == image)[:, None]
        others = replace(rays, detectable=np.where(its, 0.0, rays.detectable))
        assert np.all(others.largest_effects(alone, x, border) == 0.0)


def test_images_around_a_cell_have_a_point_in_common_with_one_that_sees_it() -> None:
    """Four images in a row, each of which has points in common with the next one."""
    row = Covisibility(np.array([0, 2, 4, 6, 7]), np.array([0, 1, 1, 2, 2, 3, 3]))
    around = images_around(Sight(np.array([0, 1, 3, 3]), np.array([2, 0, 1])), row)
    assert np.split(around.image, around.start[1:-1])[0].tolist() == [1, 2, 3]
    assert np.split(around.image, around.start[1:-1])[1].tolist() == [0, 1, 2]
    assert around.rays.tolist() == [3, 3, 0]
