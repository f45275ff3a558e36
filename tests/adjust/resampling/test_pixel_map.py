"""The map of the pixels is the one asked for: to 0.01 pixels, on both sides of a jump, with its gaps."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.resampling.pixel_map import PixelMap, pixel_map

SIZE = (700, 413)


def every_pixel(found: PixelMap) -> Floats:
    row, column = np.indices((found.rows, found.columns))
    return found.at(column.ravel(), row.ravel())


def places(size: tuple[int, int] = SIZE) -> Floats:
    row, column = np.indices(size[::-1])
    return np.stack([column.ravel(), row.ravel()], axis=-1).astype(np.float64)


def test_an_affine_map_needs_no_divided_cell_and_is_exact() -> None:
    turn = np.array([[1.001, 2e-4], [-3e-4, 0.999]])
    found = pixel_map(lambda p: p @ turn.T + [0.3, -1.7], SIZE, SIZE)
    assert not len(found.fine)
    np.testing.assert_allclose(every_pixel(found), places() @ turn.T + [0.3, -1.7], rtol=0, atol=1e-10)
    assert found.error_px < 1e-10


@pytest.mark.parametrize("bend", [1e-7, 1e-5, 1e-4])
def test_a_smooth_map_is_kept_to_the_stated_error(bend: float) -> None:
    def source(p: Floats) -> Floats:
        return p + bend * (p - [350.0, 200.0]) ** 2

    found = pixel_map(source, SIZE, SIZE)
    away = np.abs(every_pixel(found) - source(places())).max()
    assert away < 0.0026
    assert found.error_px == pytest.approx(away, rel=0.2)


def test_the_stated_error_is_that_of_pixels_that_have_a_source() -> None:
    def source(p: Floats) -> Floats:
        away = p - [350.0, 206.0]
        return np.asarray(p + 3e-6 * away * (away**2).sum(axis=1, keepdims=True))

    found, true = pixel_map(source, SIZE, SIZE), source(places())
    inside = ((true >= -0.5) & (true < np.array(SIZE) - 0.5)).all(axis=1)
    assert 0.5 < inside.mean() < 0.9
    away = np.abs(every_pixel(found) - true)
    assert found.error_px == pytest.approx(away[inside].max(), rel=0.5)
    assert found.error_px < 0.01 < away.max()


@pytest.mark.parametrize("step", [4.5, pytest.param(0.9, marks=pytest.mark.slow)])
def test_a_bend_anywhere_in_a_cell_is_kept_to_a_hundredth_of_a_pixel(step: float) -> None:
    size = (200, 70)
    for at in np.arange(64.0, 128.0, step):

        def source(p: Floats, at: float = at) -> Floats:
            return p + np.column_stack([1e-3 * np.maximum(p[:, 0] - at, 0.0), np.zeros(len(p))])

        found = pixel_map(source, size, size)
        assert np.abs(every_pixel(found) - source(places(size))).max() < 0.01


@pytest.mark.parametrize("jump", [0.02, 0.4, 30.0])
def test_a_jump_stands_between_the_pixels_where_it_is(jump: float) -> None:
    def source(p: Floats) -> Floats:
        beyond = p[:, 0] + 0.3 * p[:, 1] > 301.5
        return p + np.column_stack([np.zeros(len(p)), jump * beyond])

    found = pixel_map(source, SIZE, SIZE)
    np.testing.assert_allclose(every_pixel(found), source(places()), rtol=0, atol=1e-9)


def test_a_pixel_without_a_source_has_none() -> None:
    def source(p: Floats) -> Floats:
        return np.where((np.hypot(*(p - [300.0, 200.0]).T) < 150.0)[:, None], p, np.nan)

    np.testing.assert_array_equal(every_pixel(pixel_map(source, SIZE, SIZE)), source(places()))


def test_rows_of_the_source_are_those_of_the_positions() -> None:
    def source(p: Floats) -> Floats:
        return p + np.column_stack(
            [0.0 * p[:, 0], 1e-3 * (p[:, 0] - 350.0) ** 2 / 7 + 20.0 * (p[:, 1] > 200)]
        )

    found, everywhere = pixel_map(source, SIZE, (700, 900)), source(places())[:, 1].reshape(SIZE[::-1])
    for rows in ((0, 64), (100, 101), (190, 413)):
        lowest, highest = found.source_rows(rows)
        inside = everywhere[rows[0] : rows[1]]
        assert lowest <= inside.min() + 0.01
        assert highest >= inside.max() - 0.01


def test_cells_outside_the_source_are_not_looked_at_closely() -> None:
    def far(p: Floats) -> Floats:
        return p + np.where(p > 320.0, 5000.0 + np.sin(p) * 99.0, 0.0)

    found = pixel_map(far, (640, 640), (300, 300))
    assert not len(found.finest)
