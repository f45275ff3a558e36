"""Adjusting again with other corrections: the values of the complete adjustment, in less time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from adjust.residual_grid.image_correction import CorrectionField, corrected
from adjust.selection.readjustment import Readjustment
from adjust.solve.system import Observations
from tests.adjust.calibration.camera_errors import MICROMETRE, cells
from tests.adjust.scenes import ALL_FREE, Scene, two_strips

OPTIONS = AdjustmentOptions()


def _offset(rays: ImagePoints) -> ImagePoints:
    random = np.random.default_rng(3)
    return replace(rays, offset=random.normal(0.0, 1.0 * MICROMETRE, rays.xy.shape))


def _with_gross_errors(scene: Scene) -> Observations:
    rays = scene.observations.image_points
    many = np.flatnonzero(np.bincount(rays.point)[rays.point] >= 4)[::23]
    xy = rays.xy.copy()
    xy[many, 1] += 60.0 * MICROMETRE
    return Observations(replace(rays, xy=xy), scene.observations.others)


def test_without_corrections_the_values_stay() -> None:
    scene = two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=5)
    result = adjust_block(scene.block, scene.observations)
    again = Readjustment.of(scene.block, result, OPTIONS)
    found = again.adjust(again.image_points, result.state)
    assert found.sigma0 == pytest.approx(result.test.sigma0, rel=1e-9)
    np.testing.assert_allclose(found.residual, result.groups[0].residual, atol=1e-12)


def test_the_values_are_those_of_an_adjustment_of_the_corrected_observations() -> None:
    scene = two_strips(cameras=2, flights=2, free=ALL_FREE, noise_seed=5)
    given = scene.observations
    again = Readjustment.of(scene.block, adjust_block(scene.block, given), OPTIONS)
    shifted = _offset(given.image_points)
    found = again.adjust(_offset(again.image_points), scene.block.approximate_state())
    expected = adjust_block(scene.block, Observations(shifted, given.others))
    assert found.sigma0 == pytest.approx(expected.test.sigma0, rel=1e-6)
    np.testing.assert_allclose(found.residual, expected.groups[0].residual, atol=1e-10)
    np.testing.assert_allclose(found.state.object_point, expected.state.object_point, atol=1e-5)


def test_what_was_rejected_stays_rejected_and_estimated_weights_stay() -> None:
    scene = two_strips(noise_seed=5, images_per_strip=7, points_along=20, points_across=9)
    options = AdjustmentOptions(critical_value=4.13, variance_components=True)
    result = adjust_block(scene.block, _with_gross_errors(scene), options)
    assert result.groups[0].rejected > 5
    assert len(result.variance_components)
    again = Readjustment.of(scene.block, result, options)
    assert again.system.observations.count == result.test.redundancy + again.system.unknowns
    found = again.adjust(again.image_points, result.state)
    assert found.sigma0 == pytest.approx(result.test.sigma0, rel=1e-6)


def test_corrections_are_added_to_the_measurements_of_their_own_images() -> None:
    scene = two_strips(cameras=2, noise_seed=5)
    rays = scene.observations.image_points
    division = cells(4)
    fields = (CorrectionField(division, np.tile([2e-6, -1e-6], (16, 1))), None)
    found = corrected(_offset(rays), fields, scene.block.camera_of_image, "bilinear")
    first = scene.block.camera_of_image[rays.image] == 0
    assert found.offset is not None
    # In the place of the corrections they had.
    np.testing.assert_allclose(found.offset[first], np.tile([2e-6, -1e-6], (first.sum(), 1)), rtol=1e-12)
    np.testing.assert_array_equal(found.offset[~first], 0.0)
    np.testing.assert_array_equal(found.xy, rays.xy)
    moved = found.misclosure(scene.truth) - rays.misclosure(scene.truth)
    np.testing.assert_allclose(moved, found.offset, atol=1e-16)


def test_fields_add_up_where_something_is_known() -> None:
    nan = np.nan
    field = CorrectionField(cells(2), np.array([[1.0, 2.0], [nan, nan], [3.0, 4.0], [nan, nan]]))
    more = field.plus(np.array([[0.5, 0.5], [7.0, 8.0], [nan, nan], [nan, nan]]))
    np.testing.assert_array_equal(more.value, [[1.5, 2.5], [7.0, 8.0], [3.0, 4.0], [nan, nan]])
    np.testing.assert_allclose(more.rms, np.sqrt(np.mean(more.value[:3] ** 2, axis=0)))
    assert np.isnan(CorrectionField.zero(cells(2)).rms).all()
