"""Images of scenes, strip by strip: their edges and the noise of their homogeneous areas.

Pixels without data, and those at the limits of their range (0 and the largest value), take no part: what was
clipped has another shape. Of an image of a gigabyte only some strips are in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.image_quality.edge_search import OVERLAP, EdgeSearch, GivenEdges
from adjust.image_quality.noise import NoiseLevels, TileNoise, noise_levels, noise_of, tile_noise
from adjust.options import available_threads
from tasks.errors import Location
from tasks.image_files.image_reader import ImageDescription, ImageReader, Pixels, opened_image
from tasks.image_quality.grey_values import GreyValues, clipping_value

_STRIP = 256
#: Rows of a strip whose noise stands for that of the strip.
_OF_STRIP = 128

Strip = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class BandQuality:
    """A band of an image.

    Attributes
    ----------
    band : its number, from 1.
    edges : that were measured, with the reasons why others were not.
    levels : noise by grey level.
    values : its grey values.
    """

    band: int
    edges: EdgeSearch
    levels: NoiseLevels
    values: GreyValues


@dataclass(frozen=True, eq=False)
class SceneQuality:
    """An image of a scene.

    Attributes
    ----------
    image : name of the file.
    description : what the file says about itself.
    bands : without those of alpha.
    """

    image: str
    description: ImageDescription
    bands: tuple[BandQuality, ...]


def examined_scene(
    path: Path,
    given: GivenEdges | None = None,
    tell: Callable[[float], None] = lambda _done: None,
    threads: int | None = None,
    chosen: Sequence[int] = (),
) -> SceneQuality:
    """Examine an image.

    Parameters
    ----------
    given : the edges that are measured; None: those that are found over the whole format.
    tell : called with the fraction of the image that is done, after each strip.
    chosen : numbers of the bands that are examined, from 1; none: all but alpha.
    threads : bands at a time, which changes nothing about the result; None: as many as there may be.

    Raises
    ------
    InputError
        If it cannot be read, is too small, lacks a band, or has one without any pixel to examine.
    InstallationError
        If rasterio is not installed.
    """
    threads = available_threads() if threads is None else threads
    with opened_image(path, threads) as reader:
        about = reader.description
        if min(about.rows, about.columns) < OVERLAP:
            raise Location(path).error(
                f"The image has {about.columns} × {about.rows} pixels, too few for edges.",
                f"Give an image of at least {OVERLAP} × {OVERLAP} pixels.",
            )
        bands = [
            _Band(index, EdgeSearch(about.rows, about.columns), [], GreyValues(about))
            for index in _indices(about, chosen)
        ]
        with ThreadPoolExecutor(threads) as pool:
            for first, pixels, grey_values in _strips(reader):
                # Of a generator errors of the threads would be lost.
                list(
                    pool.map(
                        lambda band, at=first, grey=grey_values, raw=pixels: band.take(
                            grey[band.index], raw[band.index], at, given
                        ),
                        bands,
                    )
                )
                tell(min(first + _STRIP, about.rows) / about.rows)
    for band in bands:
        band.values.require_something(band.index + 1)
    found = tuple(
        BandQuality(band.index + 1, band.search, noise_levels(TileNoise.together(band.tiles)), band.values)
        for band in bands
    )
    return SceneQuality(path.name, about, found)


def _indices(about: ImageDescription, chosen: Sequence[int]) -> Sequence[int]:
    """Indices of the bands that are examined."""
    if not chosen:
        return [index for index in range(about.bands) if index not in about.alpha]
    for number in chosen:
        if number > about.bands or number - 1 in about.alpha:
            what = f"has {about.bands} bands" if number > about.bands else "has an alpha channel there"
            raise Location(about.path, entity="image_quality.bands").error(
                f"Band {number} cannot be examined: the image {what}.", "Name bands of the image, from 1."
            )
    return [number - 1 for number in sorted(set(chosen))]


@dataclass(frozen=True, eq=False)
class _Band:
    """Results of a band so far."""

    index: int
    search: EdgeSearch
    tiles: list[TileNoise]
    values: GreyValues

    def take(self, grey: Strip, pixels: Pixels, first_row: int, given: GivenEdges | None) -> None:
        """Examine the next strip; its last rows are the first of the one after it."""
        self.values.take(pixels[:_STRIP], np.isfinite(grey[:_STRIP]))
        noise = noise_of(grey[:_OF_STRIP])
        if given is None:
            self.search.search(grey, noise, first_row)
        else:
            self.search.search_given(grey, noise, first_row, given)
        self.tiles.append(tile_noise(grey[:_STRIP]))


def _strips(reader: ImageReader) -> Iterator[tuple[int, Pixels, Strip]]:
    """First row and pixels (bands, rows, columns) of strips; the same with NaN where one takes no part."""
    about = reader.description
    whole_numbers = not about.dtype.startswith("float")
    for first in range(0, about.rows, _STRIP):
        rows = (first, min(first + _STRIP + OVERLAP, about.rows))
        if first and rows[1] - first <= OVERLAP:
            return
        pixels, valid = reader.read(rows), reader.valid(rows)
        if valid is not None and whole_numbers:
            # A value that stands for no data is none of the sensor, and not the largest of it.
            pixels = np.where(valid, pixels, pixels.dtype.type(0))
        grey: Strip = pixels.astype(np.float32)
        if not whole_numbers:
            grey[~np.isfinite(grey)] = np.nan
        else:
            clipped = [clipping_value(about, band) for band in pixels]
            grey[(pixels <= 0) | (pixels >= np.reshape(clipped, (-1, 1, 1)))] = np.nan
        if valid is not None:
            _leave_out(grey, valid)
        yield first, pixels, grey


def _leave_out(grey: Strip, valid: NDArray[Any]) -> None:
    grey[~np.broadcast_to(valid, grey.shape)] = np.nan
