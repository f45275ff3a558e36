"""Resampled pixels in closed cases: the identity changes none, a plane stays one, nothing invalid enters."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adjust.arrays import Floats
from adjust.resampling.pixel_map import PixelMap, pixel_map
from adjust.resampling.resampled import (
    Pixels,
    ResampledRows,
    SourceRows,
    Values,
    needed_columns,
    needed_rows,
    resampled,
)

TYPES = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")
Kind = Literal["cubic", "lanczos"]
KINDS: tuple[Kind, ...] = ("cubic", "lanczos")
ROWS, COLUMNS = 90, 150


def shifted(x: float, y: float, size: tuple[int, int] = (COLUMNS, ROWS)) -> PixelMap:
    return pixel_map(lambda p: p + np.array([x, y]), size, size)


def noise(dtype: str, bands: int = 2) -> Pixels:
    drawn = np.random.default_rng(5).integers(0, 127, (bands, ROWS, COLUMNS))
    return (drawn * (1.7 if dtype.startswith("float") else 1)).astype(dtype)


def limits(dtype: str) -> Values:
    kind = np.finfo(dtype) if dtype.startswith("float") else np.iinfo(dtype)
    return Values(float(kind.min), float(kind.max))


def whole(
    pixels: Pixels,
    of: PixelMap,
    values: Values,
    kind: Kind = "cubic",
    valid: Pixels | None = None,
    threads: int = 1,
) -> ResampledRows:
    return resampled(SourceRows(pixels, valid, 0, pixels.shape[1]), of, (0, of.rows), values, kind, threads)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dtype", TYPES)
def test_the_identity_changes_no_byte(dtype: str, kind: Kind) -> None:
    pixels = noise(dtype)
    made = whole(pixels, shifted(0.0, 0.0), limits(dtype), kind)
    assert made.pixels.dtype == pixels.dtype
    np.testing.assert_array_equal(made.pixels, pixels)
    assert made.outside == 0
    assert made.valid is None


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("x", "y"), [(3, -2), (-7, 0), (0, 40)])
def test_whole_pixels_are_only_moved(kind: Kind, x: int, y: int) -> None:
    pixels = noise("uint16")
    made = whole(pixels, shifted(x, y), Values(0.0, 65535.0, fill=9.0), kind)
    row, column = np.indices((ROWS, COLUMNS))
    inside = (row + y >= 0) & (row + y < ROWS) & (column + x >= 0) & (column + x < COLUMNS)
    expected = np.where(
        inside, pixels[:, np.clip(row + y, 0, ROWS - 1), np.clip(column + x, 0, COLUMNS - 1)], 9
    )
    np.testing.assert_array_equal(made.pixels, expected)
    assert made.outside == np.count_nonzero(~inside)


@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.sampled_from(KINDS))
@settings(max_examples=25, deadline=None)
def test_a_plane_stays_a_plane_and_an_even_grey_even(x: float, y: float, kind: Kind) -> None:
    row, column = np.indices((ROWS, COLUMNS)).astype(np.float64)
    pixels = np.stack([3.0 * column - 2.0 * row, np.full((ROWS, COLUMNS), 77.25)])
    made = whole(pixels, shifted(x, y), limits("float64"), kind).pixels[:, 4:-4, 4:-4]
    plane = (pixels[0] + 3.0 * x - 2.0 * y)[4:-4, 4:-4]
    # Positions are rounded to steps of 1/1024.
    np.testing.assert_allclose(made[0], plane, atol=0.0026)
    np.testing.assert_allclose(made[1], 77.25, rtol=1e-12)


def keys(s: Floats) -> Floats:
    s = np.abs(s)
    return np.where(
        s < 1, 1.5 * s**3 - 2.5 * s**2 + 1, np.where(s < 2, -0.5 * s**3 + 2.5 * s**2 - 4 * s + 2, 0.0)
    )


def lanczos(s: Floats) -> Floats:
    return np.where(np.abs(s) < 3, np.sinc(s) * np.sinc(s / 3), 0.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_pixel_is_the_convolution_of_its_surroundings(kind: Kind) -> None:
    pixels, x, y = noise("float64", 1), 0.3125, -0.59375  # whole steps of 1/1024
    made = whole(pixels, shifted(x, y), limits("float64"), kind).pixels[0]
    function = {"cubic": keys, "lanczos": lanczos}[kind]
    row, column = 30, 71
    along, down = (
        function(np.arange(side) - place) for side, place in ((COLUMNS, column + x), (ROWS, row + y))
    )
    expected = (down / down.sum()) @ pixels[0] @ (along / along.sum())
    # Lanczos' weights are changed by up to 0.025, so that a plane stays one.
    assert made[row, column] == pytest.approx(expected, rel=1e-12 if kind == "cubic" else 0.05)


def test_values_stay_within_what_the_image_can_hold() -> None:
    pixels = np.zeros((1, ROWS, COLUMNS), np.uint16)
    pixels[0, 20:60, 30:90] = 4095
    made = whole(pixels, shifted(0.5, 0.5), Values(0.0, 4095.0)).pixels
    assert made.max() == 4095
    assert made[0, 40, 60] == 4095
    assert made[0, 5, 5] == 0


@pytest.mark.parametrize("planes", [1, 2])
def test_what_is_not_valid_comes_into_no_other_pixel(planes: int) -> None:
    rng = np.random.default_rng(8)
    valid = rng.random((planes, ROWS, COLUMNS)) > 0.2
    pixels = np.where(valid, 1000, 60000).astype(np.uint16)
    # A copy: for pixels that cannot be written to, the kernel would be compiled again.
    pixels = np.broadcast_to(pixels, (2, ROWS, COLUMNS)).copy()
    made = whole(pixels, shifted(0.37, -0.21), Values(0.0, 65535.0), "lanczos", valid)
    # With an even grey below, every pixel is that or was not valid.
    assert set(np.unique(made.pixels)) == {1000, 60000}
    assert made.valid is not None
    inside = np.s_[:, 1:, :-1]
    near = valid[:1, :, :][:, 1:, :-1]
    np.testing.assert_array_equal(made.valid[inside], near)
    if planes == 1:
        np.testing.assert_array_equal(made.pixels[0][1:, :-1] == 1000, near[0])


def test_a_valid_pixel_never_has_the_value_for_no_data() -> None:
    rng = np.random.default_rng(8)
    pixels = np.where(rng.random((1, ROWS, COLUMNS)) > 0.5, 7, 9).astype(np.uint8)
    made = whole(
        pixels,
        shifted(0.5, 0.0),
        Values(0.0, 255.0, nodata=8.0, fill=8.0),
        "cubic",
        np.ones_like(pixels, bool),
    )
    assert 8 not in made.pixels[0, :, :-1]
    # The last column is where the image ends.
    assert made.outside == ROWS


def test_an_alpha_band_is_moved_but_not_interpolated() -> None:
    alpha = np.random.default_rng(8).random((1, ROWS, COLUMNS)) > 0.3
    pixels = np.concatenate([noise("uint8", 1), np.where(alpha, 255, 0).astype(np.uint8)])
    made = whole(pixels, shifted(0.4, 0.4), Values(0.0, 255.0, nearest=(1,)), "cubic", alpha)
    np.testing.assert_array_equal(made.pixels[1, :-1, :-1], pixels[1, :-1, :-1])


def test_borders_are_interpolated_between_the_pixels_there_are() -> None:
    row, column = np.indices((ROWS, COLUMNS)).astype(np.float64)
    made = whole((10.0 * column + row)[None], shifted(0.25, 0.25), limits("float64")).pixels[0]
    np.testing.assert_allclose(made[0, :-1], (10.0 * column + row)[0, :-1] + 2.75, rtol=1e-12)
    # Beyond the middle of the last pixel there is only that one.
    np.testing.assert_allclose(made[0, -1], 10.0 * (COLUMNS - 1) + 0.25, rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_pixels_depend_neither_on_the_window_nor_on_threads(kind: Kind) -> None:
    size = (COLUMNS, ROWS)
    of = pixel_map(lambda p: p + 1e-4 * (p - [70.0, 40.0]) ** 2 + 3.0 * (p > 61.3), size, size)
    pixels = noise("uint8")
    expected = whole(pixels, of, limits("uint8"), kind)
    np.testing.assert_array_equal(whole(pixels, of, limits("uint8"), kind, threads=3).pixels, expected.pixels)
    outside = 0
    for first in range(0, ROWS, 7):
        rows = (first, min(first + 7, ROWS))
        begin, end = needed_rows(of, rows, ROWS)
        for columns in ((0, 64), (64, 128), (128, COLUMNS)):
            left, right = needed_columns(of, rows, columns, COLUMNS)
            assert right - left < 90
            some = np.ascontiguousarray(pixels[:, begin:end, left:right])
            part = SourceRows(some, None, begin, ROWS, left, COLUMNS)
            made = resampled(part, of, rows, limits("uint8"), kind, columns=columns)
            np.testing.assert_array_equal(made.pixels, expected.pixels[:, slice(*rows), slice(*columns)])
            outside += made.outside
    assert outside == expected.outside > 0
