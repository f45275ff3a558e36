"""Intersection of rays with given orientations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.approximate.intersection import IntersectionStatus, intersect, solve_factorized
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.observations.image_point import ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.solve.covisibility import point_starts
from adjust.solve.lanes import lanes
from tests.adjust.scenes import two_strips

C = 0.1


def two_cameras(base: float) -> State:
    centre = np.array([[-0.5 * base, 0.0, 1000.0], [0.5 * base, 0.0, 1000.0]])
    return State(
        centre, np.stack([np.eye(3)] * 2), np.zeros((0, 3)), {INTERIOR_ORIENTATION: np.array([[C, 0.0, 0.0]])}
    )


def rays(xy: list[list[float]], image: list[int], point: list[int]) -> ImagePoints:
    n = len(xy)
    return ImagePoints(
        np.array(image),
        np.array(point),
        np.zeros(2, int),
        np.array(xy),
        np.full((n, 2), 1e-6),
        np.ones(n, bool),
    )


def test_the_normal_case_gives_height_from_the_parallax() -> None:
    # x′ − x″ = b c / (H − Z).
    base, height = 400.0, 150.0
    parallax = base * C / (1000.0 - height)
    found = intersect(
        rays([[0.5 * parallax, 0.002], [-0.5 * parallax, 0.002]], [0, 1], [0, 0]), two_cameras(base), 1
    )
    expected = [0.0, 0.002 / C * (1000.0 - height), height]
    np.testing.assert_allclose(found.object_point, [expected], atol=1e-9)
    angle = 2.0 * np.arctan(0.5 * base / np.hypot(850.0, expected[1]))
    assert found.angle[0] == pytest.approx(angle)
    assert found.usable.all()


def test_the_angle_is_that_of_the_two_rays_that_are_farthest_apart() -> None:
    left, right = two_cameras(400.0), two_cameras(200.0)
    state = replace(
        left,
        projection_centre=np.concatenate([left.projection_centre, right.projection_centre]),
        local_from_camera=np.stack([np.eye(3)] * 4),
    )
    x = -state.projection_centre[:, 0] * C / 1000.0
    four = rays([[place, 0.0] for place in x], [0, 1, 2, 3], [0] * 4)
    found = intersect(replace(four, camera_of_image=np.zeros(4, int)), state, 1)
    assert found.angle[0] == pytest.approx(2.0 * np.arctan(0.2))


def test_points_that_several_threads_share_are_all_where_their_parallaxes_say() -> None:
    base, points = 400.0, 6_000
    height = np.linspace(-100.0, 300.0, points)
    x = 0.5 * base * C / (1000.0 - height)
    xy = np.stack([np.stack([x, -x], axis=1), np.full((points, 2), 0.002)], axis=2)
    many = rays(xy.reshape(-1, 2).tolist(), [0, 1] * points, np.repeat(np.arange(points), 2).tolist())
    assert len(lanes(point_starts(many.point, points))) > 1
    found = intersect(many, two_cameras(base), points)
    assert found.usable.all()
    np.testing.assert_allclose(found.object_point[:, 2], height, atol=1e-8)


def test_exact_rays_of_a_block_meet_at_the_true_points_without_approximate_values() -> None:
    scene = two_strips(cameras=2)
    unknown = replace(scene.truth, object_point=np.full_like(scene.truth.object_point, np.nan))
    found = intersect(scene.observations.image_points, unknown, len(scene.block.points))
    assert found.usable.all()
    np.testing.assert_allclose(found.object_point, scene.truth.object_point, atol=1e-8)


@pytest.mark.parametrize("distorted", [False, True])
def test_the_intersection_is_the_least_squares_solution_with_the_weights_of_the_rays(distorted: bool) -> None:
    scene = two_strips(noise_seed=3, additional=distorted, forward=distorted)
    image_points = scene.observations.image_points
    generator = np.random.default_rng(4)
    image_points = replace(
        image_points, sigma=image_points.sigma * generator.uniform(0.5, 3.0, image_points.sigma.shape)
    )
    found = intersect(image_points, scene.truth, len(scene.block.points))

    def weighted_squares(points: Floats) -> Floats:
        misclosure = image_points.misclosure(replace(scene.truth, object_point=points))
        per_ray = np.sum((misclosure / image_points.sigma) ** 2, axis=1)
        return np.bincount(image_points.point, weights=per_ray)

    least = weighted_squares(found.object_point)
    for axis in range(3):
        for step in (-0.02, 0.02):
            moved = found.object_point + step * np.eye(3)[axis]
            assert np.all(weighted_squares(moved) > least)


def test_a_point_with_one_ray_left_is_said_to_have_too_few() -> None:
    found = intersect(rays([[0.01, 0.0]], [0], [0]), two_cameras(400.0), 2)
    assert found.status.tolist() == [IntersectionStatus.FEWER_THAN_TWO_RAYS] * 2
    assert not found.usable.any()


def test_two_rays_from_one_place_are_parallel() -> None:
    found = intersect(rays([[0.01, 0.0], [0.01, 0.0]], [0, 1], [0, 0]), two_cameras(0.0), 1)
    assert found.status.tolist() == [IntersectionStatus.PARALLEL_RAYS]


def test_rays_that_meet_above_the_cameras_are_behind_them() -> None:
    diverging = rays([[-0.02, 0.0], [0.02, 0.0]], [0, 1], [0, 0])
    found = intersect(diverging, two_cameras(400.0), 1)
    assert found.status.tolist() == [IntersectionStatus.BEHIND_A_CAMERA]


def test_the_principal_point_and_tilts_are_taken_into_account() -> None:
    state = two_cameras(400.0)
    turned = np.stack([rotation.from_omega_phi_kappa(np.array([0.02, -0.03, 1.0])), np.eye(3)])
    state = replace(
        state, local_from_camera=turned, system={INTERIOR_ORIENTATION: np.array([[C, 2e-4, -1e-4]])}
    )
    true = np.array([30.0, -40.0, 20.0])
    xy = []
    for centre, matrix in zip(state.projection_centre, turned, strict=True):
        p = matrix.T @ (true - centre)
        xy.append([2e-4 - C * p[0] / p[2], -1e-4 - C * p[1] / p[2]])
    found = intersect(rays(xy, [0, 1], [0, 0]), state, 1)
    np.testing.assert_allclose(found.object_point[0], true, atol=1e-9)


@pytest.mark.parametrize("forward", [False, True])
def test_no_point_nearby_fits_rays_of_unlike_weight_better(forward: bool) -> None:
    """Aᵀ P v is zero, although the point nearest to all rays, where it begins, is another one."""
    scene = two_strips(cameras=2, flights=2, additional=forward, forward=forward, noise_seed=4)
    given, random = scene.observations.image_points, np.random.default_rng(5)
    sigma = 1e-6 * random.uniform(1.0, 20.0, given.sigma.shape)
    given = replace(given, sigma=sigma, xy=given.xy + 20.0 * random.normal(size=sigma.shape) * sigma)
    found = intersect(given, scene.truth, len(scene.block.points))
    assert found.usable.all()
    equations = given.linearize(replace(scene.truth, object_point=found.object_point))
    jacobian = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
    for point in range(len(scene.block.points)):
        own = given.point == point
        matrix = (jacobian[own] / sigma[own][:, :, None]).reshape(-1, 3)
        misclosure = (equations.misclosure[own] / sigma[own]).ravel()
        assert np.abs(np.linalg.lstsq(matrix, misclosure)[0]).max() < 1e-6


def test_rays_that_meet_under_a_tenth_of_a_degree_make_a_point() -> None:
    base = 1000.0 * np.deg2rad(0.1)
    x = 0.5 * base * C / 1000.0
    found = intersect(rays([[x, 0.0], [-x, 0.0]], [0, 1], [0, 0]), two_cameras(base), 1)
    assert found.status.tolist() == [IntersectionStatus.INTERSECTED]
    np.testing.assert_allclose(found.object_point, [[0.0, 0.0, 0.0]], atol=1e-6)


def test_factors_are_solved_forwards_and_backwards() -> None:
    lower = np.array([[2.0, 0.0, 0.0], [0.5, 1.5, 0.0], [-0.7, 0.4, 1.2]])
    right = np.array([1.0, -2.0, 3.0])
    expected = np.linalg.solve(lower @ lower.T, right)
    solve_factorized(lower, right)
    np.testing.assert_allclose(right, expected, rtol=1e-12)
