"""Images of a sensor without a scene, strip by strip: defects, light over the format, levels of a series."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.image_quality.defects import MARGIN, deviating
from adjust.image_quality.photon_transfer import pair_statistics
from tasks.errors import Location
from tasks.image_files.image_reader import ImageDescription, ImageReader, opened_image
from tasks.image_quality.grey_values import GreyValues

#: Cells of the format for the fall-off of light, and pixels in the middle for photon transfer.
CELLS = (32, 48)
_MIDDLE = 1024
_SMALLEST = 256


@dataclass(frozen=True, eq=False)
class FlatImages:
    """The average of flat or dark images of the same light.

    Attributes
    ----------
    description : of the first file.
    deviating : for each band, rows and columns (n, 2) of pixels that deviate from their neighbours.
    cells : (bands, rows, columns) mean grey values of cells of the format, without those pixels.
    counts : (bands, rows, columns) pixels of the cells.
    """

    description: ImageDescription
    deviating: tuple[Ints, ...]
    cells: Floats
    counts: Ints

    @property
    def mean(self) -> Floats:
        """Mean grey value of each band."""
        return np.asarray((self.cells * self.counts).sum(axis=(1, 2)) / self.counts.sum(axis=(1, 2)))


def flat_images(paths: Sequence[Path], limit: float | None, *, relative: bool) -> FlatImages:
    """Average images and find pixels that deviate from their neighbours.

    Parameters
    ----------
    limit : as of `deviating`; None: 1 % of the largest grey value.

    Raises
    ------
    InputError
        If an image cannot be read, is too small, differs from the first in size or bands, is overexposed, or
        was scaled from 8 bits.
    """
    with ExitStack() as open_files:
        readers = [open_files.enter_context(opened_image(path)) for path in paths]
        about = readers[0].description
        _require_alike(readers)
        rule = _Rule(0.01 * about.largest if limit is None else limit, relative)
        borders = [
            _borders(size, number) for size, number in zip((about.rows, about.columns), CELLS, strict=True)
        ]
        found: list[list[Ints]] = [[] for _ in range(about.bands)]
        values = [[GreyValues(one.description) for _ in range(about.bands)] for one in readers]
        cells, counts = np.zeros((about.bands, *CELLS)), np.zeros((about.bands, *CELLS), dtype=np.int64)
        for at, (first, last) in enumerate(pairwise(borders[0].tolist())):
            above, below = max(first - MARGIN, 0), min(last + MARGIN, about.rows)
            strips = np.stack([one.read((above, below)) for one in readers])
            for own_values, strip in zip(values, strips, strict=True):
                for band, pixels in enumerate(strip):
                    own_values[band].take(pixels, np.ones(pixels.shape, dtype=bool))
            mean = np.asarray(np.mean(strips, axis=0, dtype=np.float32))
            for band, grey in enumerate(mean):
                own = slice(first - above, last - above)
                places, cells[band, at], counts[band, at] = _in_cells(grey, own, borders[1], rule)
                found[band].append(places + np.array([first, 0]))
        for own_values in values:
            for band, seen in enumerate(own_values, start=1):
                seen.require_raw(band)
        return FlatImages(about, tuple(np.concatenate(parts) for parts in found), cells, counts)


@dataclass(frozen=True)
class _Rule:
    """When a pixel deviates; see `deviating`."""

    limit: float
    relative: bool


def _borders(size: int, cells: int) -> Ints:
    return np.linspace(0, size, cells + 1).astype(np.int64)


def _in_cells(grey: Any, own: slice, columns: Ints, rule: _Rule) -> tuple[Ints, Floats, Ints]:
    """Deviating pixels of some rows of a strip, and the means and numbers of the others between columns."""
    places = deviating(grey, rule.limit, relative=rule.relative)
    places = places[(places[:, 0] >= own.start) & (places[:, 0] < own.stop)]
    light = np.array(grey, dtype=np.float64)
    light[tuple(places.T)] = np.nan
    known = np.add.reduceat(np.count_nonzero(np.isfinite(light[own]), axis=0), columns[:-1])
    sums = np.add.reduceat(np.nansum(light[own], axis=0), columns[:-1])
    return places - np.array([own.start, 0]), sums / known, known


def _require_alike(readers: Sequence[ImageReader]) -> None:
    first = readers[0].description
    for reader in readers:
        about = reader.description
        if (about.columns, about.rows, about.bands) != (first.columns, first.rows, first.bands):
            raise Location(about.path).error(
                f"The image has {about.columns} × {about.rows} pixels in {about.bands} bands; "
                f"{first.path.name} has {first.columns} × {first.rows} in {first.bands}.",
                "Examine the images of each sensor separately.",
            )
        if min(about.columns, about.rows) < _SMALLEST:
            raise Location(about.path).error(
                f"The image has {about.columns} × {about.rows} pixels: too few for a sensor.",
                f"Give images of at least {_SMALLEST} × {_SMALLEST} pixels.",
            )


def middle_levels(paths: tuple[Path, Path]) -> Iterator[tuple[float, float, int, bool]]:
    """Mean, variance and number of pixels of two images of the same light in the middle, band by band.

    The last is whether they are whole grey values, as those of the sensor: averages are not.

    Raises
    ------
    InputError
        As of `flat_images`.
    """
    with ExitStack() as open_files:
        readers = [open_files.enter_context(opened_image(path)) for path in paths]
        _require_alike(readers)
        about = readers[0].description
        rows, columns = (_middle(size) for size in (about.rows, about.columns))
        first, second = (reader.read(rows, columns) for reader in readers)
        for pair in zip(first, second, strict=True):
            yield *pair_statistics(*pair), all(np.array_equal(one, np.rint(one)) for one in pair)


def middle_means(paths: Sequence[Path]) -> Floats:
    """Mean grey value (bands,) of images in the middle.

    Raises
    ------
    InputError
        If an image cannot be read.
    """
    means = []
    for path in paths:
        with opened_image(path) as reader:
            about = reader.description
            window = reader.read(_middle(about.rows), _middle(about.columns))
            means.append(window.mean(axis=(1, 2), dtype=np.float64))
    return np.asarray(np.mean(means, axis=0))


def _middle(size: int) -> tuple[int, int]:
    used = min(size, _MIDDLE)
    return (size - used) // 2, (size - used) // 2 + used
