"""Correction by mean residuals: what one pass leaves, what the iteration recovers, and when it stops.

The blocks are those of mathematics 8.3 in kind (UltraCam X, 20 cm, noise 0.8 µm, 9 control points).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.residual_grid.choice import cells_of_cameras
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import GridIteration, iterate_grid
from adjust.residual_grid.residual_grid import residual_grid
from adjust.residual_grid.smoothing import Smoothing
from adjust.result import AdjustmentResult
from adjust.solve.system import Observations
from tests.adjust.calibration.camera_errors import (
    MICROMETRE,
    NOTHING,
    RADIAL_AND_TILES,
    SEAMS,
    TILES,
    CameraTest,
    cells,
    high_block,
    low_block,
    with_true_correction,
)
from tests.adjust.scenes import two_strips
from tests.grids import diagonal_daily

PLAIN = GridRule(smoothing=Smoothing(), cross_validate=False)


def _iterated(test: CameraTest, rule: GridRule, number: int = 25) -> GridIteration:
    return iterate_grid(test.block, test.result, (cells(number),), test.block.camera_of_image, rule)


def _recovered(test: CameraTest, found: GridIteration) -> tuple[float, float]:
    """Correlation of the corrections with the true ones, and regression on them."""
    field = found.fields[0]
    assert field is not None
    known = np.isfinite(field.value[:, 0])
    true = test.true_correction(field.cells.middles)[known].ravel()
    value = field.value[known].ravel()
    return float(np.corrcoef(true, value)[0, 1]), float(np.polyfit(true, value, 1)[0])


@pytest.fixture(scope="module")
def tiles() -> CameraTest:
    return high_block(TILES)


@pytest.fixture(scope="module")
def surveyed_from_the_air() -> CameraTest:
    """Radial errors, too; GNSS positions keep the block from bending after them."""
    return high_block(RADIAL_AND_TILES, gnss=True)


def test_one_pass_recovers_little_more_than_half(tiles: CameraTest) -> None:
    found = _iterated(tiles, replace(PLAIN, most_iterations=1))
    correlation, regression = _recovered(tiles, found)
    # mathematics 8.2 has a regression of 0.57 and a correlation of 0.81.
    assert 0.5 < regression < 0.65
    assert 0.7 < correlation < 0.9


def test_iteration_recovers_the_rest_and_heights_gain_most(tiles: CameraTest) -> None:
    without = tiles.check_rms(tiles.result.state)
    one, five = (_iterated(tiles, replace(PLAIN, most_iterations=most)) for most in (1, 5))
    best = with_true_correction(tiles)
    z_one, z_five = (tiles.check_rms(found.state)[2] for found in (one, five))
    z_best = tiles.check_rms(best.state)[2]
    assert without[2] > 2.0 * z_best
    gain_of_one, gain_of_five = ((without[2] - z) / (without[2] - z_best) for z in (z_one, z_five))
    assert 0.5 < gain_of_one < 0.75
    assert gain_of_five > 0.85
    # The residuals are content long before: σ0 hardly moves after the first pass.
    assert tiles.result.test.sigma0 > 1.2
    assert one.steps[-1].sigma0 == pytest.approx(best.test.sigma0, abs=0.03)
    assert five.steps[-1].rms < 0.25 * one.steps[-1].rms


# The example `residual_grid` prints the same heights, daily; here they are compared with the best.
@pytest.mark.slow
def test_what_the_block_holds_against_comes_back(surveyed_from_the_air: CameraTest) -> None:
    test = surveyed_from_the_air
    # The plain procedure, five times; then cross-validated with smoothing.
    z_best = test.check_rms(with_true_correction(test).state)[2]
    z = [test.check_rms(_iterated(test, replace(PLAIN, most_iterations=m)).state)[2] for m in (1, 3, 5)]
    assert test.check_rms(test.result.state)[2] > 7.0 * z_best
    assert z[0] > 4.0 * z_best
    assert z[1] > 1.5 * z_best
    assert z[2] < 1.4 * z_best
    validated = _iterated(test, GridRule())
    assert validated.taken >= 4
    assert test.check_rms(validated.state)[2] < 1.6 * z_best


def test_seams_and_smoothing_help_the_images_that_took_no_part(tiles: CameraTest) -> None:
    blind = _iterated(tiles, GridRule())
    division = cells(25, SEAMS)
    seeing = iterate_grid(tiles.block, tiles.result, (division,), tiles.block.camera_of_image, GridRule())
    raw = _iterated(tiles, GridRule(smoothing=Smoothing()))
    assert raw.gain < blind.gain < seeing.gain
    # What the true correction takes away of vᵀPv is the most that can be gained.
    best = 1.0 - (with_true_correction(tiles).test.sigma0 / tiles.result.test.sigma0) ** 2
    assert 0.9 * best < seeing.gain <= 1.02 * best


@pytest.mark.parametrize(
    ("smoothing", "seed"),
    diagonal_daily([Smoothing(), Smoothing("counts"), Smoothing("gaussian", 0.08)], [3, 21, 22]),
)
def test_where_there_is_nothing_to_model_hardly_anything_is_done(smoothing: Smoothing, seed: int) -> None:
    test = high_block(NOTHING, seed=seed)
    found = _iterated(test, GridRule(smoothing=smoothing))
    assert found.taken <= 1
    assert found.reason in ("nothing_to_model", "cross_validation")
    assert np.isnan(found.gain) or found.gain < 0.0
    np.testing.assert_allclose(test.check_rms(found.state), test.check_rms(test.result.state), atol=2e-3)


def test_without_cross_validation_the_noise_would_be_modelled() -> None:
    test = high_block(NOTHING)
    found = _iterated(test, replace(PLAIN, settled=0.0))
    if found.reason == "limit":
        # σ0 falls below what the noise allows: an illusion.
        assert found.steps[-1].sigma0 < test.result.test.sigma0 - 0.015
    else:
        assert found.reason == "nothing_to_model"


def test_a_step_that_was_refused_is_not_taken(tiles: CameraTest) -> None:
    found = _iterated(tiles, GridRule(most_iterations=8, smoothing=Smoothing()))
    assert found.reason == "cross_validation"
    tried = [step.mean_rms for step in found.cross_validation]
    assert len(tried) == found.taken + 2
    assert tried[-1] >= tried[-2]
    assert tried[:-1] == sorted(tried[:-1], reverse=True)
    limited = _iterated(tiles, GridRule(most_iterations=found.taken, smoothing=Smoothing()))
    assert limited.reason == "limit"
    np.testing.assert_array_equal(limited.fields[0].value, found.fields[0].value)  # type: ignore[union-attr]


def test_the_iteration_ends_when_new_means_are_a_small_part_of_the_noise(tiles: CameraTest) -> None:
    found = _iterated(tiles, replace(PLAIN, most_iterations=40))
    assert found.reason == "settled"
    assert found.steps[-1].rms <= 0.1 * found.steps[0].noise < found.steps[-2].rms


def test_means_that_chance_explains_are_not_corrected() -> None:
    found = _iterated(high_block(NOTHING, seed=21), replace(PLAIN, most_iterations=1))
    assert found.steps[0].rms < found.steps[0].noise
    assert found.reason == "nothing_to_model"


def _root_mean_square(values: Floats, weight: Floats | float = 1.0) -> float:
    known = np.isfinite(values)
    weight = np.broadcast_to(weight, values.shape)[known]
    return float(np.sqrt(np.average(values[known] ** 2, weights=weight)))


def test_no_iterations_change_nothing(tiles: CameraTest) -> None:
    found = _iterated(tiles, GridRule(most_iterations=0))
    # What is judged is the mean residuals of all images, and of every second one.
    rays, points = tiles.result.groups[0], tiles.observations.image_points
    chosen = controlled(rays)
    before = residual_grid(cells(25), points.xy, rays.residual, chosen)
    assert found.steps[0].rms == pytest.approx(_root_mean_square(before.mean))
    assert found.steps[0].noise == pytest.approx(_root_mean_square(before.sigma))
    halves = [
        residual_grid(cells(25), points.xy[own], rays.residual[own], chosen[own])
        for own in (points.image % 2 == 0, points.image % 2 == 1)
    ]
    both = np.isfinite(halves[0].mean) & np.isfinite(halves[1].mean)
    mean, count = (
        np.concatenate([getattr(half, name)[both] for half in halves]) for name in ("mean", "count")
    )
    assert found.cross_validation[0].mean_rms == pytest.approx(_root_mean_square(mean, count))
    assert found.cross_validation[0].rms == pytest.approx(
        _root_mean_square((rays.residual / points.sigma)[chosen])
    )
    assert found.taken == 0
    assert found.fields[0] is not None
    assert np.isnan(found.fields[0].value).all()
    np.testing.assert_array_equal(found.state.object_point, tiles.result.state.object_point)


# The example `residual_grid` prints the same figures, daily; here the correction is continued, too.
@pytest.mark.slow
def test_the_grid_of_the_high_flight_helps_the_low_one() -> None:
    high, low = high_block(RADIAL_AND_TILES, gnss=True), low_block(RADIAL_AND_TILES)
    fields = _iterated(high, GridRule()).fields
    assert fields[0] is not None
    corrected = _adjusted_with(low, fields[0].cells.interpolate(
        fields[0].value, low.observations.image_points.xy, "bilinear"))  # fmt: skip
    assert corrected.test.sigma0 < 0.9 * low.result.test.sigma0
    before, after = low.check_rms(low.result.state), low.check_rms(corrected.state)
    assert after[2] < 0.5 * before[2]
    chosen = controlled(corrected.groups[0])
    assert chosen.mean() > 0.5
    # Going on from there in the low block: start is what came from the high one.
    further = iterate_grid(
        low.block, corrected, (fields[0].cells,), low.block.camera_of_image, GridRule(), start=fields
    )
    assert further.steps[0].rms == pytest.approx(further.steps[0].noise, rel=0.25)
    assert further.steps[-1].sigma0 <= corrected.test.sigma0


def test_an_iteration_goes_on_from_corrections_of_before(tiles: CameraTest) -> None:
    one = _iterated(tiles, replace(PLAIN, most_iterations=1))
    field = one.fields[0]
    assert field is not None
    half = replace(field, value=0.5 * field.value)
    rays = tiles.observations.image_points
    corrected = _adjusted_with(tiles, half.cells.interpolate(half.value, rays.xy, "bilinear"))
    rule, cameras = replace(PLAIN, most_iterations=1), tiles.block.camera_of_image
    further = iterate_grid(tiles.block, corrected, (half.cells,), cameras, rule, start=(half,))
    assert further.steps[0].sigma0 == pytest.approx(corrected.test.sigma0)
    assert further.steps[1].sigma0 < 0.95 * further.steps[0].sigma0
    # A pass finds more than half of what is left of the errors.
    _, of_one = _recovered(tiles, one)
    _, of_both = _recovered(tiles, further)
    assert of_both == pytest.approx(0.5 * of_one + (1.0 - 0.5 * of_one) * of_one, abs=0.1)


def _adjusted_with(test: CameraTest, offset: Floats) -> AdjustmentResult:
    rays = replace(test.observations.image_points, offset=offset)
    return adjust_block(test.block, Observations(rays, test.observations.others))


def test_a_block_too_small_for_halves_is_iterated_without_them() -> None:
    scene = two_strips(strips=1, images_per_strip=3, headings_deg=(90.0,), noise_seed=4)

    result = adjust_block(scene.block, scene.observations)
    camera = scene.block.cameras[0]
    division = FormatCells.of(camera.half_format, 4)
    found = iterate_grid(scene.block, result, (division,), scene.block.camera_of_image)
    assert found.cross_validation == ()
    assert np.isnan(found.gain)
    assert found.steps[0].sigma0 == pytest.approx(result.test.sigma0)


def test_two_cameras_have_two_fields() -> None:
    scene = two_strips(cameras=2, noise_seed=4, points_along=60, points_across=40)
    rays = scene.observations.image_points
    second = scene.block.camera_of_image[rays.image] == 1
    # The middle of the second camera's images is shifted.
    wrong = second & np.all(np.abs(rays.xy) < np.array(scene.block.cameras[1].half_format) / 3, axis=1)
    xy = rays.xy + np.where(wrong[:, None], [0.0, 4.0 * MICROMETRE], 0.0)
    given = Observations(replace(rays, xy=xy), scene.observations.others)
    result = adjust_block(scene.block, given)
    division, rule = cells_of_cameras(scene.block, rays, 3), replace(PLAIN, interpolation="cell")
    found = iterate_grid(scene.block, result, division, scene.block.camera_of_image, rule)
    assert found.taken >= 1
    first, other = found.fields
    assert first is not None
    assert other is not None
    outside = np.arange(9) != 4
    step = np.nanmean(other.value[outside, 1]) - other.value[4, 1]
    assert step == pytest.approx(4.0 * MICROMETRE, rel=0.3)
    assert np.nanmax(np.abs(first.value)) < 1.2 * MICROMETRE
