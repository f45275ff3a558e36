"""Rows of an image resampled through a map of its pixels, on several threads, the same on any number of them.

Cubic: the convolution of Keys (1981), IEEE Trans. ASSP 29(6), 1153–1160, with a = −½, over 4 × 4 pixels. Lanczos:
sinc(s) sinc(s/3) over 6 × 6 pixels (Duchon, 1979, J. Appl. Meteorology 18, 1016–1022), divided by its sum, and with its
centre of gravity moved to the position by the middle two, so that even greys and gradients stay as they are (otherwise
lines of 3 pixels move by 0.02). The weights are those of the next of 1024 steps between two pixels, so a position is
rounded by 0.0005 pixels at most.
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Bools, Floats
from adjust.resampling.pixel_map import PixelMap
from adjust.resampling.resampling_kernel import resample
from adjust.solve.lanes import in_any_order

Resampling: TypeAlias = Literal["cubic", "lanczos"]
Pixels: TypeAlias = NDArray[Any]
_STEPS = 1024
#: Types of pixels that a kernel is compiled for, besides float64.
_COMPILED = (np.uint8, np.uint16)
# Rows that a thread takes at once.
_PORTION = 16


@dataclass(frozen=True, eq=False)
class SourceRows:
    """Rows of the image that is resampled, or the part of them that is needed.

    Attributes
    ----------
    pixels : (bands, h, w).
    valid : (1 or bands, h, w) which are valid; None: all.
    first, all_rows : number of the first row here, and of the rows of the whole image.
    first_column, all_columns : the same of columns; None: those here are all.
    """

    pixels: Pixels
    valid: Bools | None
    first: int
    all_rows: int
    first_column: int = 0
    all_columns: int | None = None


@dataclass(frozen=True)
class Values:
    """What the pixels of an image can be.

    Attributes
    ----------
    least, largest : of them.
    nodata : means that there is none; None: no value does.
    fill : value where the image has no source.
    nearest : numbers of bands that are not interpolated (alpha).
    """

    least: float
    largest: float
    nodata: float | None = None
    fill: float = 0.0
    nearest: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class ResampledRows:
    """Rows of the resampled image.

    Attributes
    ----------
    pixels : (bands, r, c).
    valid : (1, r, c) where the nearest pixel of the source is valid; None: the source had no mask.
    outside : number of pixels without a source.
    """

    pixels: Pixels
    valid: Bools | None
    outside: int


def resampled(
    source: SourceRows,
    pixels: PixelMap,
    rows: tuple[int, int],
    values: Values,
    resampling: Resampling,
    threads: int = 1,
    columns: tuple[int, int] | None = None,
) -> ResampledRows:
    """Rows from rows[0] to below rows[1].

    Parameters
    ----------
    source : must have the rows and columns that `needed_rows` and `needed_columns` say.
    columns : first, a multiple of 64, and last + 1; None: all.
    """
    bands, given = len(source.pixels), source.pixels.dtype
    # The kernel is compiled for each type, for some seconds: float64 holds the values of all rare ones.
    taken = source.pixels.astype(given if given in _COMPILED else np.float64, copy=False)
    left, right = columns or (0, pixels.columns)
    out = np.empty((bands, rows[1] - rows[0], right - left), taken.dtype)
    all_columns = taken.shape[2] if source.all_columns is None else source.all_columns
    origin, size = (source.first, source.first_column), (source.all_rows, all_columns)
    masked = source.valid is not None
    valid = source.valid.view(np.uint8) if source.valid is not None else np.empty((0, 1, 1), np.uint8)
    out_valid = np.zeros((1, *out.shape[1:]) if masked else (0, 1, 1), np.uint8)
    is_nearest = np.isin(np.arange(bands), values.nearest)
    outside = np.zeros(out.shape[1], np.int64)

    def portion(first: int) -> None:
        outside[first] = resample(
            taken, valid, origin, size, is_nearest,
            pixels.nodes, pixels.divided, pixels.fine, pixels.divided_again, pixels.finest,
            _weights(resampling), np.issubdtype(given, np.integer), values.least, values.largest,
            np.nan if values.nodata is None else values.nodata, values.fill, (rows[0], left),
            (first, min(first + _PORTION, out.shape[1])), out, out_valid,
        )  # fmt: skip

    in_any_order(portion, range(0, out.shape[1], _PORTION), threads)
    out = out.astype(given, copy=False)
    return ResampledRows(out, out_valid.view(np.bool_) if masked else None, int(outside.sum()))


def needed_rows(pixels: PixelMap, rows: tuple[int, int], all_rows: int) -> tuple[int, int]:
    """First and last + 1 of the rows of the source for rows of the image; the first row, if there is none."""
    return _with_reach(pixels.source_rows(rows), all_rows)


def needed_columns(
    pixels: PixelMap, rows: tuple[int, int], columns: tuple[int, int], all_columns: int
) -> tuple[int, int]:
    """The same of the columns of the source for columns of rows of the image."""
    return _with_reach(pixels.source_columns(rows, columns), all_columns)


def _with_reach(extent: tuple[float, float], count: int) -> tuple[int, int]:
    """First and last + 1 of the `count` rows or columns around positions."""
    lowest, highest = extent
    if not (highest >= 0.0 and lowest <= count - 1.0):
        return 0, 1
    reach = _weights("lanczos").shape[1] // 2
    return max(int(np.floor(lowest)) - reach, 0), min(int(np.floor(highest)) + reach + 2, count)


@cache
def _weights(resampling: Resampling) -> Floats:
    """(1025, taps) of the pixels around a position, for each step of it between two of them."""
    taps = {"cubic": 4, "lanczos": 6}[resampling]
    away = np.arange(taps) - (taps // 2 - 1.0) - np.linspace(0.0, 1.0, _STEPS + 1)[:, None]
    s = np.abs(away)
    if resampling == "cubic":
        near, far = 1.0 + s**2 * (1.5 * s - 2.5), 2.0 + s * (-4.0 + s * (2.5 - 0.5 * s))
        return np.where(s <= 1.0, near, np.where(s < 2.0, far, 0.0))
    found = np.where(s < 3.0, np.sinc(s) * np.sinc(s / 3.0), 0.0)
    # At whole numbers the sine is not quite 0.
    found[[0, -1]] = np.round(found[[0, -1]])
    found = found / found.sum(axis=1, keepdims=True)
    moment = (found * away).sum(axis=1)
    found[:, 2] += moment
    found[:, 3] -= moment
    return np.asarray(found)
