"""One image without its distortion: read, resampled and written strip by strip from top to bottom."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from adjust.arrays import Bools
from adjust.resampling.pixel_map import PixelMap
from adjust.resampling.resampled import Resampling, SourceRows, Values, needed_rows, resampled
from tasks.image_files.image_reader import ImageDescription, ImageReader, Pixels
from tasks.image_files.image_writer import image_like

#: Told how much of an image is done, 0 to 1.
Progress: TypeAlias = Callable[[float], None]
# Pixels of a strip, bytes; there are three such arrays at a time.
_STRIP_BYTES = 48_000_000
# Rows that are read at a time where blocks of the file are not about as high.
_ROWS_READ = 256
# Higher blocks are read as a whole, so that none is decoded again, unless a row of them is larger, bytes.
_READ_BYTES = 192_000_000


@dataclass(frozen=True)
class Work:
    """How images are resampled.

    Attributes
    ----------
    resampling : between pixels.
    threads : how many may work at once; never changes a byte.
    strip_bytes : of the pixels that are written at a time; changes none, either.
    """

    resampling: Resampling = "cubic"
    threads: int = 1
    strip_bytes: int = _STRIP_BYTES


def undistort_image(source: ImageReader, pixels: PixelMap, path: Path, work: Work, progress: Progress) -> int:
    """Write an open image through a map; returns how many of its pixels have no source.

    Raises
    ------
    InputError
        If the image is damaged. Nothing is left then.
    InstallationError
        If the file cannot be written.
    """
    about, outside = source.description, 0
    values = _values(about)
    with image_like(source, path, work.threads) as written:
        rows_of_source = _RollingRows(source, _rows_read(about, written.block_rows))
        # The mask of a file; by a value or an alpha band the pixels themselves say it.
        has_mask = about.validity == "mask"
        for first, last in _strips(about, written.block_rows, work.strip_bytes):
            needed = needed_rows(pixels, (first, last), about.rows)
            made = resampled(
                rows_of_source.of(*needed), pixels, (first, last), values, work.resampling, work.threads
            )
            written.write(first, made.pixels, made.valid if has_mask else None)
            outside += made.outside
            progress(last / about.rows)
    return outside


class _RollingRows:
    """Rows of an image that are requested from top to bottom; each is read once, with `step` of them."""

    def __init__(self, source: ImageReader, step: int) -> None:
        self._source, self._step = source, step
        self._held: SourceRows | None = None

    def of(self, first: int, last: int) -> SourceRows:
        """Rows from first to below last at least."""
        begin = first // self._step * self._step
        end = min(-(-last // self._step) * self._step, self._source.description.rows)
        held = self._held
        # What is not needed any more makes room before more is read.
        if held is None or not held.first <= first < _end(held):
            self._held = held = None
            self._held = self._read(begin, end)
        elif end > _end(held):
            self._held, held = _from(held, first), None
            self._held = self._read(first, end)
        assert self._held is not None
        return self._held

    def _read(self, first: int, end: int) -> SourceRows:
        """Rows from first to below end; those that are held, the first ones, are moved."""
        about, held, valid = self._source.description, self._held, None
        pixels = np.empty((about.bands, end - first, about.columns), about.dtype)
        known, known_valid = 0, None
        if held is not None:
            known, known_valid = int(held.pixels.shape[1]), held.valid
            pixels[:, :known] = held.pixels
            self._held = held = None
        self._source.read((first + known, end), out=pixels[:, known:])
        found = self._valid(first + known, end, pixels[:, known:])
        if found is not None:
            valid = found if known_valid is None else np.concatenate([known_valid, found], axis=1)
        return SourceRows(pixels, valid, first, about.rows)

    def _valid(self, first: int, end: int, pixels: Pixels) -> Bools | None:
        """Which pixels are valid; of a value the pixels say it, without decoding the file once more."""
        about = self._source.description
        if np.issubdtype(pixels.dtype, np.floating):
            valid, is_number = self._source.valid((first, end)), np.isfinite(pixels)
            if about.validity in ("mask", "alpha"):
                # A mask is one for all bands.
                is_number = np.asarray(is_number.all(axis=0, keepdims=True))
            return is_number if valid is None else np.asarray(is_number & valid)
        value = about.nodata if about.validity == "nodata" else None
        if value is not None and set(self._source.dataset.nodatavals) == {value}:
            return np.asarray(pixels != pixels.dtype.type(value))
        return self._source.valid((first, end))


def _end(rows: SourceRows) -> int:
    return rows.first + int(rows.pixels.shape[1])


def _from(rows: SourceRows, first: int) -> SourceRows:
    """Copy of the rows from first on."""
    kept = slice(first - rows.first, None)
    valid = None if rows.valid is None else rows.valid[:, kept].copy()
    return SourceRows(rows.pixels[:, kept].copy(), valid, first, rows.all_rows)


def _values(about: ImageDescription) -> Values:
    whole = not about.dtype.startswith("float")
    least = float(np.iinfo(about.dtype).min) if whole else -about.largest
    fill = 0.0 if about.nodata is None else about.nodata
    return Values(least, about.largest, about.nodata, fill, about.alpha)


def _rows_read(about: ImageDescription, written: int) -> int:
    """Rows that are read at a time; blocks of `written` rows are written as a whole."""
    rows = about.block_rows
    if rows <= 2 * _ROWS_READ:
        return rows
    # As many are needed at once.
    if rows <= written:
        return _ROWS_READ
    while rows > _ROWS_READ and rows * _row_bytes(about) > _READ_BYTES:
        rows = -(-rows // 2)
    return rows


def _row_bytes(about: ImageDescription) -> int:
    return about.bands * about.columns * np.dtype(about.dtype).itemsize


def _strips(about: ImageDescription, block_rows: int, strip_bytes: int) -> Iterator[tuple[int, int]]:
    """First and last + 1 row of strips from top to bottom, of whole blocks."""
    rows = max(strip_bytes // (_row_bytes(about) * block_rows), 1) * block_rows
    for first in range(0, about.rows, rows):
        yield first, min(first + rows, about.rows)
