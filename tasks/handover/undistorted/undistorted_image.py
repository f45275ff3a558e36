"""One image without its distortion: read, resampled and written strip by strip from top to bottom.

A row of large blocks is made some columns at a time; of the source, its rows are in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import lcm
from pathlib import Path
from typing import TypeAlias

import numpy as np

from adjust.resampling.pixel_map import COARSE, PixelMap
from adjust.resampling.resampled import (
    Resampling,
    SourceRows,
    Values,
    needed_columns,
    needed_rows,
    resampled,
)
from tasks.image_files.image_reader import ImageDescription, ImageReader
from tasks.image_files.image_writer import ImageWriter, image_like

#: Told how much of an image is done, 0 to 1.
Progress: TypeAlias = Callable[[float], None]
# Pixels that are made at a time, bytes, if a block is not larger.
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


def coding_threads(about: ImageDescription, threads: int) -> int:
    """Threads that decode and encode blocks; each holds a whole one or two."""
    size = about.block_rows * about.block_columns * about.bands * np.dtype(about.dtype).itemsize
    return min(max(_STRIP_BYTES // size, 1), threads)


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
    with image_like(source, path, coding_threads(about, work.threads)) as written:
        rows_of_source = _RollingRows(source, _rows_read(about, written.block_rows))
        # The mask of a file; by a value or an alpha band the pixels themselves say it.
        has_mask = about.validity == "mask"
        for rows in _strips(about, written.block_rows, work.strip_bytes):
            for part in _parts(about, written, rows, work.strip_bytes):
                columns = needed_columns(pixels, rows, part.columns, about.columns)
                # The rows get no name here, with which they would still be held when the next ones are read.
                of_part = _cut(
                    about, rows_of_source.of(*needed_rows(pixels, rows, about.rows)), part, columns
                )
                made = resampled(
                    of_part, pixels, rows, _values(about, part), work.resampling, work.threads, part.columns
                )
                is_first = part.bands.start == 0
                valid = made.valid if has_mask and is_first else None
                written.write((rows[0], part.columns[0]), made.pixels, valid, part.bands)
                outside += made.outside if is_first else 0
                del of_part, made, valid
            progress(rows[1] / about.rows)
    return outside


@dataclass(frozen=True)
class _Part:
    """Columns from the first to below the second, and bands, that are made at a time."""

    columns: tuple[int, int]
    bands: slice


def _parts(
    about: ImageDescription, written: ImageWriter, rows: tuple[int, int], strip_bytes: int
) -> Iterator[_Part]:
    """Whole rows of all bands, or of a row of large blocks some at a time, in the order of the file."""
    of_column = (rows[1] - rows[0]) * np.dtype(about.dtype).itemsize
    if about.bands * about.columns * of_column <= strip_bytes:
        yield _Part((0, about.columns), slice(0, about.bands))
        return
    together = 1 if written.is_by_bands else about.bands
    # The map is read in cells.
    least = lcm(written.block_columns, COARSE)
    step = max(strip_bytes // (together * of_column * least), 1) * least
    for band in range(0, about.bands, together):
        for first in range(0, about.columns, step):
            yield _Part((first, min(first + step, about.columns)), slice(band, band + together))


def _cut(about: ImageDescription, held: SourceRows, part: _Part, columns: tuple[int, int]) -> SourceRows:
    """The columns of the rows that are needed for a part, and which pixels of them are valid."""
    some = slice(*columns)
    pixels = np.ascontiguousarray(held.pixels[part.bands, :, some])
    said = held.valid
    if said is not None:
        said = said[part.bands if len(said) > 1 else slice(None), :, some]
    if np.issubdtype(pixels.dtype, np.floating):
        if about.validity in ("mask", "alpha"):
            # A mask is one for all bands.
            is_number = np.asarray(np.isfinite(held.pixels[:, :, some]).all(axis=0, keepdims=True))
        else:
            is_number = np.isfinite(pixels)
        said = is_number if said is None else np.asarray(is_number & said)
    elif about.validity == "nodata" and said is None:
        said = np.asarray(pixels != pixels.dtype.type(about.nodata))
    valid = None if said is None else np.ascontiguousarray(said)
    return SourceRows(pixels, valid, held.first, held.all_rows, columns[0], about.columns)


class _RollingRows:
    """Rows of an image that are requested from top to bottom; each is read once, with `step` of them.

    `valid` of them is what the file says; None: all are, or their values say it.
    """

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
        found = None if _is_by_value(self._source) else self._source.valid((first + known, end))
        if found is not None:
            valid = found if known_valid is None else np.concatenate([known_valid, found], axis=1)
        return SourceRows(pixels, valid, first, about.rows)


def _is_by_value(source: ImageReader) -> bool:
    """Whether integers say by one value that there are none, without decoding the file once more."""
    about = source.description
    return (
        about.validity == "nodata"
        and not about.dtype.startswith("float")
        and set(source.dataset.nodatavals) == {about.nodata}
    )


def _end(rows: SourceRows) -> int:
    return rows.first + int(rows.pixels.shape[1])


def _from(rows: SourceRows, first: int) -> SourceRows:
    """Copy of the rows from first on."""
    kept = slice(first - rows.first, None)
    valid = None if rows.valid is None else rows.valid[:, kept].copy()
    return SourceRows(rows.pixels[:, kept].copy(), valid, first, rows.all_rows)


def _values(about: ImageDescription, part: _Part) -> Values:
    whole = not about.dtype.startswith("float")
    least = float(np.iinfo(about.dtype).min) if whole else -about.largest
    fill = 0.0 if about.nodata is None else about.nodata
    nearest = tuple(k - part.bands.start for k in about.alpha if part.bands.start <= k < part.bands.stop)
    return Values(least, about.largest, about.nodata, fill, nearest)


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
