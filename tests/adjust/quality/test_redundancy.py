"""Image points take a short cut through the residuals; it must not be another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.adjustment import adjust_block
from adjust.quality.cofactor import cofactor
from adjust.quality.redundancy import _residuals, group_residuals
from adjust.quality.single_error import SingleErrors
from adjust.solve.gauss_newton import iterate
from adjust.solve.system import System
from tests.adjust.scenes import ALL_FREE, two_strips, with_rejected_rays


def test_image_points_have_the_residuals_of_the_general_path() -> None:
    scene = with_rejected_rays(two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=21, start_seed=22))
    system = System.of(scene.block, scene.observations)
    solution = iterate(system, scene.block.approximate_state(), 20)
    quality = cofactor(system, solution)
    short = group_residuals(system, solution.state, quality)[0]
    rays = system.observations.image_points
    xx, xy, yy = quality.hat_of_rays.T
    hat = np.stack([np.stack([xx, xy]), np.stack([xy, yy])]).T
    residual = -rays.misclosure(solution.state)
    whitened = residual * rays.inverse_sigma
    general = _residuals(
        rays, residual, SingleErrors(whitened, hat, hat, np.ones(len(hat)), np.zeros_like(hat))
    )
    assert not rays.active.all()
    for name in ("residual", "redundancy", "control", "standardized", "detectable"):
        np.testing.assert_allclose(getattr(short, name), getattr(general, name), rtol=1e-10, equal_nan=True)
    np.testing.assert_allclose(short.weighted_squares, general.weighted_squares, rtol=1e-12)


def test_redundancy_numbers_add_up_to_the_redundancy() -> None:
    scene = two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=1, start_seed=2)
    result = adjust_block(scene.block, scene.observations)
    total = sum(group.redundancy_sum for group in result.groups)
    np.testing.assert_allclose(total, result.test.redundancy, rtol=1e-6)


def test_the_order_of_the_rays_of_a_point_changes_nothing() -> None:
    """Also where images come before those with which they are eliminated."""
    scene = two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=21, start_seed=22)
    rays = scene.observations.image_points
    order = np.lexsort((-rays.image, rays.point))
    turned = replace(scene.observations, image_points=rays.only(order))
    expected, found = (adjust_block(scene.block, one) for one in (scene.observations, turned))
    np.testing.assert_allclose(
        found.cofactor.of_points, expected.cofactor.of_points, atol=1e-9 * expected.cofactor.of_points.max()
    )
    np.testing.assert_allclose(found.groups[0].redundancy, expected.groups[0].redundancy[order], atol=1e-9)
