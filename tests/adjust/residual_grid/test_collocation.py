"""Corrections by collocation of mean residuals: full matrices, simulated cameras, and nothing to correct."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats, Ints
from adjust.observations.image_point import ImagePoints
from adjust.parameters import BORESIGHT
from adjust.residual_grid import mean_response
from adjust.residual_grid.collocation import collocate
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.expected_field import ExpectedField
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.image_correction import CorrectionField, corrected
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import GridIteration, iterate_grid
from adjust.residual_grid.mean_response import MeanResponse
from adjust.residual_grid.remaining_errors import remaining_errors, with_correction_errors
from adjust.residual_grid.residual_grid import residual_grid
from adjust.result import AdjustmentResult
from adjust.result_columns import sigma_of_points
from adjust.rig import RELATIVE_ROTATION
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.solve.system import Observations
from tests.adjust.calibration.camera_errors import (
    NOTHING,
    RADIAL_AND_TILES,
    CameraTest,
    cells,
    high_block,
    with_true_correction,
)
from tests.adjust.residual_grid.test_remaining_errors import FREE, Corrected, Dense
from tests.adjust.scenes import two_strips

#: Radial, at 50 mm from the centre.
_OUTWARDS = 3e-6


def outwards(xy: Floats, size: float) -> Floats:
    """Radial errors (n, 2) of so much at 50 mm, growing with the cube of the distance."""
    return np.asarray(size * xy * np.sum(xy**2, axis=1, keepdims=True) / 0.05**3)


def erroneous(test: CameraTest, sign_of_image: Floats) -> tuple[Observations, AdjustmentResult]:
    """Image points of a block with radial errors of a sign for each image, and their adjustment."""
    rays = test.observations.image_points
    errors = sign_of_image[rays.image][:, None] * outwards(rays.xy, _OUTWARDS)
    observations = replace(test.observations, image_points=replace(rays, xy=rays.xy + errors))
    return observations, adjust_block(test.block, observations)


def height_rms(test: CameraTest, found: GridIteration | AdjustmentResult) -> float:
    return float(test.check_rms(found.state)[2])


def not_imitated(xy: Floats, values: Floats) -> Floats:
    """What no interior orientation and no rotation of the image makes of a field (n, 2) at places (n, 2)."""
    (x, y), one, zero = xy.T, np.ones(len(xy)), np.zeros(len(xy))
    pairs = ((one, zero), (zero, one), (x, y), (-y, x), (x * x, x * y), (x * y, y * y))
    basis = np.array([np.column_stack(pair).ravel() for pair in pairs]).T
    flat = values.ravel()
    return np.asarray(flat - basis @ np.linalg.lstsq(basis, flat)[0])


def every_image(test: CameraTest) -> Ints:
    return np.zeros_like(test.block.camera_of_image)


@pytest.mark.parametrize("interpolation", ["bilinear", "cell"])
def test_the_first_correction_is_that_of_full_matrices(interpolation: Interpolation) -> None:
    scene = two_strips(noise_seed=3, free=FREE, distances=2, points_along=20, points_across=10)
    block, rays = scene.block, scene.observations.image_points
    shifted = replace(rays, xy=rays.xy + outwards(rays.xy, 4e-5))
    result = adjust_block(block, replace(scene.observations, image_points=shifted))
    division = FormatCells.of(block.cameras[0].half_format, 3)
    rule = GridRule(most_iterations=1, interpolation=interpolation, cross_validate=False)
    found = collocate(block, result, (division,), block.camera_of_image, rule)
    zero = CorrectionField(division, np.zeros((division.count, 2)))
    dense = Dense(replace(Corrected.of_one_set(result, zero), interpolation=interpolation), (None,))
    (field,) = found.fields
    assert field is not None
    known = np.isfinite(field.value)
    assert found.reason == "limit"
    np.testing.assert_allclose(
        field.value.T[known.T], dense.expected.value, atol=1e-5 * np.abs(dense.expected.value).max()
    )
    assert np.abs(dense.expected.value).max() > 1e-6


@pytest.mark.parametrize("gnss", [False, True])
def test_heights_of_a_block_that_bends_after_the_camera_are_found(gnss: bool) -> None:
    test = high_block(RADIAL_AND_TILES, gnss=gnss)
    grids = (cells(15),)
    found = collocate(test.block, test.result, grids, every_image(test))
    means = iterate_grid(test.block, test.result, grids, every_image(test), GridRule(cross_validate=False))
    without, exact = height_rms(test, test.result), height_rms(test, with_true_correction(test))
    assert found.reason == "settled"
    assert without > 5.0 * exact
    # Of the errors of 0.32 m plain means leave 0.25 m without GNSS, and 0.05 m with it.
    assert height_rms(test, means) > 1.2 * exact
    assert height_rms(test, found) < 1.1 * exact
    assert found.gain > 0.3
    assert found.steps[-1].sigma0 == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_of_noise_nothing_is_modelled(seed: int) -> None:
    test = high_block(NOTHING, seed=seed)
    found = collocate(test.block, test.result, (cells(9),), every_image(test))
    assert found.taken == 0
    assert found.reason in ("nothing_to_model", "cross_validation")
    np.testing.assert_array_equal(found.state.object_point, test.result.state.object_point)
    assert found.fields[0] is not None
    assert not np.nan_to_num(found.fields[0].value).any()


def test_what_half_of_the_images_contradicts_is_refused() -> None:
    test = high_block(NOTHING)
    odd = np.where(np.arange(len(test.block.images)) % 2 == 0, 1.0, -1.0)
    _, result = erroneous(test, odd)
    found = collocate(test.block, result, (cells(9),), every_image(test))
    assert (found.taken, found.reason) == (0, "cross_validation")
    assert found.gain < 0.0


def test_sets_of_images_are_corrected_until_nothing_changes() -> None:
    test = high_block(NOTHING, gnss=True)
    second = np.arange(len(test.block.images)) >= 20
    _, result = erroneous(test, np.where(second, -1.0, 1.0))
    found = collocate(
        test.block, result, (cells(9), cells(9)), second.astype(np.int64), GridRule(8, cross_validate=False)
    )
    assert found.reason == "settled"
    assert height_rms(test, result) > 2.0 * height_rms(test, test.result)
    assert height_rms(test, found) < 1.1 * height_rms(test, test.result)
    for sign, field in zip((1.0, -1.0), found.fields, strict=True):
        assert field is not None
        true = -sign * outwards(field.cells.middles, _OUTWARDS)
        left, there = (not_imitated(field.cells.middles, values) for values in (field.value, true))
        assert np.corrcoef(left.ravel(), there.ravel())[0, 1] > 0.9


def test_sets_that_take_turns_do_so_until_none_of_them_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    # The errors of the second set are a third of those of the first: its changes alone would end too early.
    test = high_block(NOTHING, gnss=True)
    second = (np.arange(len(test.block.images)) >= 20).astype(np.int64)
    _, result = erroneous(test, np.where(second, 1.0 / 3.0, 1.0))
    monkeypatch.setattr(mean_response, "MOST_TOGETHER", 81)
    rule = GridRule(8, cross_validate=False, settled=3.0)
    found = collocate(test.block, result, (cells(9), cells(9)), second, rule)
    assert (found.taken, found.reason) == (2, "settled")


@pytest.mark.parametrize(("size", "is_evident"), [(0.05, False), (0.08, True)])
def test_errors_are_corrected_from_where_they_are_evident(size: float, is_evident: bool) -> None:
    # Twice the logarithm of the ratio of the probabilities is 8 and 19.
    test = high_block(NOTHING, gnss=True)
    _, result = erroneous(test, np.full(len(test.block.images), size))
    found = collocate(test.block, result, (cells(9),), every_image(test), GridRule(1, cross_validate=False))
    assert (found.taken, found.reason) == ((1, "limit") if is_evident else (0, "nothing_to_model"))


def test_corrections_stay_where_means_are_no_evidence_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    test, expected = high_block(NOTHING, gnss=True), MeanResponse.expected
    _, result = erroneous(test, np.ones(len(test.block.images)))
    steps = iter((True, False))

    def fading(response: MeanResponse, *given: Any) -> tuple[ExpectedField, Floats]:
        field, wrong = expected(response, *given)
        return replace(field, evidence=field.evidence * next(steps)), wrong

    monkeypatch.setattr(MeanResponse, "expected", fading)
    rule = GridRule(8, cross_validate=False, settled=0.0)
    found = collocate(test.block, result, (cells(9),), every_image(test), rule)
    assert (found.taken, found.reason) == (2, "settled")
    assert found.fields[0] is not None
    assert np.nanmax(np.abs(found.fields[0].value)) > 1e-6


@pytest.mark.slow
def test_heads_of_a_rig_are_corrected_together_within_their_sigma() -> None:
    scene = two_strips(
        heads=3, strips=4, images_per_strip=8, points_along=40, points_across=30, noise_seed=4,
        free={BORESIGHT: True, RELATIVE_ROTATION: True}, headings_deg=(90.0, 270.0, 0.0, 180.0),
    )  # fmt: skip
    block, rays = scene.block, scene.observations.image_points
    # In part another focal length, which is held.
    errors = outwards(rays.xy, 6e-6) - 6e-6 * 0.8 * rays.xy / 0.05
    measured = replace(rays, xy=rays.xy + errors)
    grids = [FormatCells.of(camera.half_format, 11) for camera in block.cameras]

    def adjusted(points: ImagePoints) -> AdjustmentResult:
        return adjust_block(block, replace(scene.observations, image_points=points))

    without = adjusted(measured)
    found = collocate(block, without, grids, block.camera_of_image, GridRule(cross_validate=False))
    assert (found.reason, found.taken) == ("settled", 2)
    result = adjusted(corrected(measured, found.fields, block.camera_of_image, "bilinear"))
    errors_left = remaining_errors(result, found.fields, block.camera_of_image, "bilinear")
    result = with_correction_errors(result, errors_left)
    used = result.active_point

    def of_points(item: AdjustmentResult) -> Floats:
        return np.asarray((item.state.object_point - scene.truth.object_point)[used])

    def rms(values: Floats) -> Floats:
        return np.asarray(np.sqrt(np.mean(values**2, axis=0)))

    exact = adjusted(replace(measured, offset=-errors))
    # Head by head, heights and plan across had errors of 1.38 and 1.14 times these, and of 1.3 and 1.4 σ.
    assert rms(of_points(without))[2] > 3.0 * rms(of_points(exact))[2]
    assert np.all(rms(of_points(result)) < 1.08 * rms(of_points(exact)))
    assert np.all(rms(of_points(result) / sigma_of_points(result)[used]) < 1.15)


def test_a_set_without_images_and_cells_without_means_have_no_corrections() -> None:
    test = high_block(ImageErrorSpecification(radial=4e-6))
    found = collocate(
        test.block, test.result, (cells(9), None), every_image(test), GridRule(1, cross_validate=False)
    )
    field, rays, residuals = found.fields[0], test.observations.image_points, test.result.groups[0]
    assert field is not None
    assert found.fields[1] is None
    before = residual_grid(cells(9), rays.xy, residuals.residual, controlled(residuals))
    np.testing.assert_array_equal(np.isfinite(field.value), np.isfinite(before.mean))
