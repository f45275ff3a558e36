"""Image errors within sub-areas: seen where there are some, in noise as often as stated."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats, Ints
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Interpolation
from adjust.residual_grid.within_cells import WithinCells, within_cells
from tests.adjust.calibration.camera_errors import NOTHING, TILES, high_block
from tests.adjust.calibration.camera_errors import cells as cells_of
from tests.adjust.residual_grid.test_remaining_errors import Corrected

HALF = (0.05, 0.04)
CELLS = FormatCells.of(HALF, 4)
MICROMETRE = 1e-6


def places(random: np.random.Generator, number: int = 4000) -> tuple[Ints, Floats]:
    """Image points of 40 images."""
    return np.arange(number) % 40, random.uniform(-1.0, 1.0, (number, 2)) * HALF


def found(
    image: Ints, xy: Floats, residual: Floats, interpolation: Interpolation = "bilinear"
) -> WithinCells:
    every = np.ones(residual.shape, dtype=bool)
    item = within_cells(CELLS, interpolation, image, xy, residual, every)
    assert item is not None
    return item


def test_noise_of_any_size_is_called_an_error_as_often_as_stated() -> None:
    probability = []
    for seed in range(300):
        random = np.random.default_rng(seed)
        image, xy = places(random, 1200)
        # The noise of some images, and of the border, is much larger.
        size = np.where(image % 5 == 0, 3.0, 1.0)[:, None] * (1.0 + np.abs(xy) / 0.05)
        probability.append(found(image, xy, size * random.standard_t(5, xy.shape)).probability)
    # Three standard deviations about 10 % and about one half.
    assert 0.05 < np.mean(np.array(probability) < 0.1) < 0.152
    assert 0.41 < np.mean(np.array(probability) < 0.5) < 0.59


@pytest.mark.parametrize("interpolation", ["bilinear", "cell"])
def test_corrections_of_the_sub_areas_change_nothing(interpolation: Interpolation) -> None:
    random = np.random.default_rng(1)
    image, xy = places(random)
    noise = MICROMETRE * random.normal(size=xy.shape)
    values = 5.0 * MICROMETRE * random.normal(size=(CELLS.count, 2))
    correction = CELLS.interpolate(values, xy, interpolation)
    one, other = (found(image, xy, noise + own, interpolation) for own in (0.0, correction))
    assert other.probability == pytest.approx(one.probability, rel=1e-4)
    # Every second one of the images is meant, not of their numbers in the block.
    assert found(2 * image, xy, noise, interpolation) == one


def test_sub_areas_without_image_points_do_not_matter() -> None:
    random = np.random.default_rng(7)
    image, xy = places(random)
    corner = np.all(xy > 0.2 * np.array(HALF), axis=1)
    item = found(image[~corner], xy[~corner], random.normal(size=xy.shape)[~corner])
    assert 0.01 < item.probability < 1.0


def test_errors_within_the_sub_areas_have_their_size() -> None:
    # Of the thirds of each side the middle one goes the other way: of zero mean, and alike to both sides.
    random = np.random.default_rng(2)
    image, xy = places(random, 20_000)
    third = CELLS.finer(3).place[CELLS.finer(3).cell_of(xy)] % 3
    errors = MICROMETRE * np.where(third == 1, -2.0, 1.0)
    item = found(image, xy, errors + 3.0 * MICROMETRE * random.normal(size=xy.shape))
    assert item.rms == pytest.approx(np.sqrt(2.0) * MICROMETRE, rel=0.05)
    assert item.probability < 1e-12
    # What only one half of the images shows is no error of the camera.
    of_half = np.where((image % 2 == 0)[:, None], errors, 0.0)
    noise = 3.0 * MICROMETRE * random.normal(size=xy.shape)
    assert found(image, xy, of_half + noise).probability > 0.01
    # Nor is what they contradict each other in.
    opposite = found(image, xy, np.where((image % 2 == 0)[:, None], errors, -errors) + noise)
    assert opposite.rms == 0.0
    assert opposite.probability > 0.99


def test_each_coordinate_counts_as_far_as_it_is_chosen() -> None:
    random = np.random.default_rng(5)
    image, xy = places(random)
    third = CELLS.finer(3).place[CELLS.finer(3).cell_of(xy)] % 3
    residual = random.normal(size=xy.shape)
    residual[:, 1] += np.where(third[:, 1] == 1, -2.0, 1.0)
    assert found(image, xy, residual).probability < 1e-12
    for coordinate in (0, 1):
        # What is not chosen is as if it were not there.
        chosen = np.ones(xy.shape, dtype=bool)
        chosen[: len(xy) // 2, coordinate] = False
        other = np.where(chosen, residual, 100.0 + residual)
        one, same = (within_cells(CELLS, "bilinear", image, xy, own, chosen) for own in (residual, other))
        assert one == same
        assert one is not None
        assert one.probability < 1e-12
        only = np.ones(xy.shape, dtype=bool)
        only[:, 1 - coordinate] = False
        single = within_cells(CELLS, "bilinear", image, xy, residual, only)
        assert single is not None
        assert (single.probability < 1e-12) == (coordinate == 1)


def test_one_image_says_nothing() -> None:
    random = np.random.default_rng(3)
    _, xy = places(random, 500)
    every = np.ones(xy.shape, dtype=bool)
    one_image = np.zeros(len(xy), dtype=np.int64)
    assert within_cells(CELLS, "bilinear", one_image, xy, random.normal(size=xy.shape), every) is None


def of_block(item: Corrected, number: int) -> WithinCells:
    rays, residuals = item.result.observations.image_points, item.result.groups[0]
    found = within_cells(
        cells_of(number), "bilinear", rays.image, rays.xy, residuals.residual, controlled(residuals)
    )
    assert found is not None
    return found


def test_sub_areas_too_coarse_for_shifts_of_ccd_images_are_seen_after_their_correction() -> None:
    # Corrections between the middles of sub-areas smooth the steps at the seams, to the last iteration.
    item = Corrected.of_test(high_block(TILES), cells_of(9))
    coarse, fine = of_block(item, 9), of_block(item, 25)
    assert coarse.probability < 1e-5
    assert fine.probability > 0.001
    assert fine.rms < coarse.rms
    assert of_block(Corrected.of_test(high_block(NOTHING), cells_of(9)), 9).probability > 0.01
