"""Noise of images: in homogeneous areas, by grey level, without the structure of the scene.

The mask N = [1 −2 1; −2 4 −2; 1 −2 1] takes away whatever is linear; of white noise σ it leaves 6 σ (Immerkær
1996). Its median does not mind the edges of the scene:

    σ = 1.4826 median |I ∗ N| / 6
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats, Ints

_OF_MASK = 6.0
_OF_MEDIAN = 1.4826
#: Side of a tile, px.
SIDE = 16
_CLASSES, _IN_CLASS = 16, 300
_TENTH, _FEWEST = 10, 30


def masked(grey: NDArray[Any]) -> Floats:
    """I ∗ N (rows − 2, columns − 2) of an image (rows, columns)."""
    image = np.asarray(grey, dtype=np.float32)
    across = image[:, 2:] - 2.0 * image[:, 1:-1] + image[:, :-2]
    return np.asarray(across[2:] - 2.0 * across[1:-1] + across[:-2])


def noise_of(grey: NDArray[Any]) -> float:
    """Standard deviation of the noise of an image (rows, columns), grey values; NaN if it is too small.

    Pixels that are NaN are not used. In an image of whole grey values the quantisation is a part of it.
    """
    if min(grey.shape) < 3:
        return float("nan")
    left = np.abs(masked(grey))
    known = left[np.isfinite(left)]
    return float(_OF_MEDIAN * np.median(known) / _OF_MASK) if len(known) else float("nan")


@dataclass(frozen=True, eq=False)
class TileNoise:
    """Tiles (n,) of an image.

    Attributes
    ----------
    level : mean grey value.
    activity : differences between the quarters of the tile, grey values: what is there of the scene.
    noise : standard deviation of the noise from the mask, grey values.
    """

    level: Floats
    activity: Floats
    noise: Floats

    @classmethod
    def together(cls, parts: Sequence[TileNoise]) -> TileNoise:
        """The tiles of several strips."""
        return cls(*(np.concatenate([getattr(one, name) for one in parts]) for name in _OF_TILES))


_OF_TILES = ("level", "activity", "noise")


def tile_noise(grey: NDArray[Any]) -> TileNoise:
    """The tiles of 16 × 16 pixels of an image (rows, columns), without those that have a NaN."""
    down, across = grey.shape[0] // SIDE, grey.shape[1] // SIDE
    image = np.asarray(grey[: down * SIDE, : across * SIDE], dtype=np.float32)
    tiles = image.reshape(down, SIDE, across, SIDE).swapaxes(1, 2).reshape(-1, SIDE, SIDE)
    tiles = tiles[np.isfinite(tiles.sum(axis=(1, 2)))]
    across_columns = tiles[:, :, 2:] - 2.0 * tiles[:, :, 1:-1] + tiles[:, :, :-2]
    left = across_columns[:, 2:] - 2.0 * across_columns[:, 1:-1] + across_columns[:, :-2]
    noise = np.sqrt(np.pi / 2.0) / _OF_MASK * np.abs(left).mean(axis=(1, 2))
    half = SIDE // 2
    quarters = tiles.reshape(-1, 2, half, 2, half).mean(axis=(2, 4)).reshape(-1, 4)
    level, activity = tiles.mean(axis=(1, 2)), np.ptp(quarters, axis=1)
    return TileNoise(*(np.asarray(values, dtype=np.float64) for values in (level, activity, noise)))


@dataclass(frozen=True, eq=False)
class NoiseLevels:
    """Noise by grey level; arrays (m,) of the classes of levels that have tiles enough.

    Attributes
    ----------
    level : mean grey value of the tiles.
    noise, sigma_noise : standard deviation of the noise, grey values, and that of this estimate.
    tiles : number of homogeneous tiles.
    """

    level: Floats
    noise: Floats
    sigma_noise: Floats
    tiles: Ints


def noise_levels(tiles: TileNoise) -> NoiseLevels:
    """Noise in classes of grey levels with equal numbers of tiles, from the most homogeneous tenth of each.

    Tiles of the same level, such as those of an area of one colour, are in the same class.

    Tiles are chosen by the differences of their quarters, which hardly share noise with the mask: choosing
    the ones of least noise would make it too small.
    """
    order = np.argsort(tiles.level, kind="stable")
    classes = int(np.clip(len(order) // _IN_CLASS, 1, _CLASSES)) if len(order) else 0
    sizes = [len(part) for part in np.array_split(order, classes)] if classes else []
    level = tiles.level[order]
    label = np.repeat(np.arange(classes), sizes)[np.searchsorted(level, level)]
    rows = []
    for members in (order[label == number] for number in np.unique(label)):
        number = max(len(members) // _TENTH, min(len(members), _FEWEST))
        quiet = members[np.argsort(tiles.activity[members], kind="stable")[:number]]
        noise = float(np.median(tiles.noise[quiet]))
        spread = _OF_MEDIAN * float(np.median(np.abs(tiles.noise[quiet] - noise)))
        # A median is 1.25 times as uncertain as a mean.
        rows.append((tiles.level[quiet].mean(), noise, 1.25 * spread / np.sqrt(number), number))
    table = np.array(rows).reshape(-1, 4)
    return NoiseLevels(table[:, 0], table[:, 1], table[:, 2], table[:, 3].astype(np.int64))
