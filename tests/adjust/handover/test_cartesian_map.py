"""A program that takes the map as Cartesian: closed forms, derivatives, fits that find what was put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.handover.cartesian_map import CartesianMap, Pose, derivatives, on_ground, projected
from adjust.handover.refit import Freed, refit

C, RADIUS = 0.08, 6.371e6
WORLDS = [CartesianMap(), CartesianMap(RADIUS)]


def poses(n: int = 3, seed: int = 1) -> Pose:
    random = np.random.default_rng(seed)
    angles = np.deg2rad(random.normal(0.0, [3.0, 3.0, 90.0], (n, 3)))
    centre = np.column_stack([random.uniform(0.0, 500.0, (n, 2)), random.uniform(900.0, 1100.0, n)])
    return Pose(centre, rotation.from_omega_phi_kappa(angles), np.full(n, C), np.full(n, -2e-4))


def seen(n: int = 3, k: int = 40, seed: int = 2) -> tuple[Floats, Floats]:
    random = np.random.default_rng(seed)
    ideal = random.uniform(-0.05, 0.05, (n, k, 2))
    return ideal, random.uniform(0.0, 100.0, (n, k))


def test_a_level_image_sees_curved_ground_nearer_by_the_cube_of_the_distance() -> None:
    """dr = −c/H · s³/(2RH): 7.8e-5 of t² at one kilometre."""
    pose = Pose(np.array([[0.0, 0.0, 1000.0]]), np.eye(3)[None], np.array([C]), np.zeros(1))
    ground = np.array([[[300.0, -400.0, 0.0]]])
    flat = projected(CartesianMap(), pose, ground)[0, 0]
    np.testing.assert_allclose(flat, C * np.array([0.3, -0.4]), rtol=1e-12)
    curved = projected(CartesianMap(RADIUS), pose, ground)[0, 0]
    assert np.linalg.norm(flat - curved) == pytest.approx(C * 0.5**3 * 1000.0 / (2.0 * RADIUS), rel=1e-9)


@pytest.mark.parametrize("world", WORLDS)
def test_the_ground_of_an_image_point_is_projected_to_it(world: CartesianMap) -> None:
    pose, (ideal, height) = poses(), seen()
    np.testing.assert_allclose(
        projected(world, pose, on_ground(world, pose, ideal, height)), ideal, atol=1e-15
    )


@pytest.mark.parametrize("world", WORLDS)
def test_derivatives_are_those_of_the_projection(world: CartesianMap) -> None:
    pose, (ideal, height) = poses(), seen()
    ground = on_ground(world, pose, ideal, height)
    by_orientation, by_camera = derivatives(world, pose, ground)
    for column in range(8):
        step = 1e-2 if column < 3 else 1e-6
        ahead, behind = (_moved(pose, column, way * step) for way in (1.0, -1.0))
        numeric = (projected(world, ahead, ground) - projected(world, behind, ground)) / (2.0 * step)
        found = by_orientation[..., column] if column < 6 else by_camera[..., column - 6]
        np.testing.assert_allclose(found, numeric, rtol=1e-6, atol=1e-9)


def _moved(pose: Pose, column: int, step: float) -> Pose:
    if column == 6:
        return replace(pose, focal_length=pose.focal_length + step)
    if column == 7:
        return replace(pose, radial=pose.radial + step)
    way = np.zeros((1, 6))
    way[0, column] = step
    return replace(
        pose,
        centre=pose.centre + way[:, :3],
        map_from_camera=pose.map_from_camera @ rotation.exp(way[:, 3:]),
    )


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("freed", [Freed(), Freed(focal_length=True), Freed(focal_length=True, radial=True)])
def test_a_fit_finds_the_orientations_and_the_camera_the_points_were_made_with(
    world: CartesianMap, freed: Freed
) -> None:
    true, (ideal, height) = poses(), seen()
    camera = np.array([0, 1, 0])
    c = C + (np.array([2e-5, -3e-5])[camera] if freed.focal_length else 0.0)
    k1 = np.array([1e-4, 3e-4])[camera] if freed.radial else true.radial
    true = replace(true, focal_length=np.broadcast_to(c, 3).copy(), radial=k1)
    ground = on_ground(world, true, ideal, height)
    start = replace(
        true,
        centre=true.centre + 2.0,
        map_from_camera=true.map_from_camera @ rotation.exp(np.full((3, 3), 1e-3)),
        focal_length=np.full(3, C),
        radial=np.full(3, 0.0) if freed.radial else true.radial,
    )
    found = refit(world, start, camera, ideal, ground, freed)
    assert found.largest.max() < 1e-13
    np.testing.assert_allclose(found.pose.centre, true.centre, atol=1e-6)
    np.testing.assert_allclose(found.pose.map_from_camera, true.map_from_camera, atol=1e-9)
    np.testing.assert_allclose(found.pose.focal_length, true.focal_length, atol=1e-10)


def test_many_images_are_fitted_like_few() -> None:
    """More than fit into memory at once, of two cameras whose focal length is common to all of them."""
    world, n = CartesianMap(), 1203
    true, (ideal, height) = poses(n), seen(n, 12)
    camera = (np.arange(n) % 2).astype(np.int64)
    true = replace(true, focal_length=C + np.array([1e-5, -2e-5])[camera])
    ground = on_ground(world, true, ideal, height)
    start = replace(true, centre=true.centre + 1.0, focal_length=np.full(n, C))
    found = refit(world, start, camera, ideal, ground, Freed(focal_length=True))
    np.testing.assert_allclose(found.pose.focal_length, true.focal_length, atol=1e-10)
