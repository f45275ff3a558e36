"""Grids of numbers as cloud-optimized GeoTIFF, as OGC 21-026 and OGC 19-008r4 describe it.

Classic TIFF with tiles of 256 × 256 cells, deflated, one plane for each band, float32, NaN where there is
nothing. All directories stand before all data; of the data the coarsest overview comes first, the full grid
last, so a reader needs the beginning of the file and the tiles it shows. An overview has every second cell
of the one below it. The names of the bands are those that GDAL shows.

Written here, because the libraries that write GeoTIFF bring GEOS along, whose licence this program avoids.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TypeAlias
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from adjust.options import available_threads
from tasks.coordinates.crs import MapFrame
from tasks.files.in_turn import in_turn
from tasks.handover.geotiff_keys import geo_keys

Grids: TypeAlias = NDArray[np.float32]

_TILE = 256
# Higher ones take half as much time again, for 2 % of the size.
_DEFLATE_LEVEL = 1
# TIFF's types: number, and format of struct.
_ASCII, _SHORT, _LONG, _DOUBLE = (2, "s"), (3, "H"), (4, "I"), (12, "d")


@dataclass(frozen=True)
class GridPlace:
    """Where a grid lies in the map.

    Attributes
    ----------
    west, north : outer corner of the first cell, m.
    cell : side of a cell, m.
    """

    west: float
    north: float
    cell: float


@dataclass(frozen=True)
class _Entry:
    """A tag of a directory: its type, and its values packed."""

    tag: int
    kind: int
    count: int
    data: bytes

    @classmethod
    def of(cls, tag: int, kind: tuple[int, str], values: Sequence[int | float]) -> _Entry:
        number, letter = kind
        return cls(tag, number, len(values), struct.pack(f"<{len(values)}{letter}", *values))

    @classmethod
    def text(cls, tag: int, text: str) -> _Entry:
        data = text.encode("utf-8") + b"\0"
        return cls(tag, _ASCII[0], len(data), data)


@dataclass(frozen=True)
class _Level:
    """One resolution: its entries without the offsets of its tiles, and these tiles."""

    entries: tuple[_Entry, ...]
    tiles: tuple[bytes, ...]


def write_geotiff(
    path: Path, bands: Mapping[str, Grids], place: GridPlace, frame: MapFrame, about: str
) -> None:
    """Write grids (rows, columns) of one shape, row 0 in the north, as the bands of a file.

    Parameters
    ----------
    bands : by the description of each.
    about : one sentence about the file.
    """
    data = np.stack([np.asarray(grid, np.float32) for grid in bands.values()])
    levels = [_level(data, 0, (*_place_entries(place), *_crs_entries(frame), *_words(list(bands), about)))]
    while max(data.shape[1:]) > _TILE:
        data = data[:, ::2, ::2]
        levels.append(_level(data, 1, (_Entry.text(42113, "nan"),)))
    path.write_bytes(_file(levels))


def _level(data: Grids, kind: int, further: tuple[_Entry, ...]) -> _Level:
    bands, rows, columns = data.shape
    entries = (
        _Entry.of(254, _LONG, (kind,)),
        _Entry.of(256, _LONG, (columns,)),
        _Entry.of(257, _LONG, (rows,)),
        _Entry.of(258, _SHORT, (32,) * bands),
        _Entry.of(259, _SHORT, (8,)),  # deflate
        _Entry.of(262, _SHORT, (1,)),  # small values are dark
        _Entry.of(277, _SHORT, (bands,)),
        _Entry.of(284, _SHORT, (2,)),  # one plane for each band
        _Entry.of(322, _LONG, (_TILE,)),
        _Entry.of(323, _LONG, (_TILE,)),
        _Entry.of(338, _SHORT, (0,) * (bands - 1)),
        _Entry.of(339, _SHORT, (3,) * bands),  # floating point
        *further,
    )
    return _Level(tuple(entry for entry in entries if entry.count), tuple(_tiles(data)))


def _tiles(data: Grids) -> Iterator[bytes]:
    """Deflated tiles, band by band, row by row; those at the border are filled up with NaN."""
    corners = product(
        *(range(0, size, step) for size, step in zip(data.shape, (1, _TILE, _TILE), strict=True))
    )

    def deflated(corner: tuple[int, ...]) -> bytes:
        band, top, left = corner
        tile = np.full((_TILE, _TILE), np.nan, "<f4")
        part = data[band, top : top + _TILE, left : left + _TILE]
        tile[: part.shape[0], : part.shape[1]] = part
        return zlib.compress(tile.tobytes(), _DEFLATE_LEVEL)

    return in_turn(deflated, corners, threads=available_threads())


def _place_entries(place: GridPlace) -> tuple[_Entry, ...]:
    return (
        _Entry.of(33550, _DOUBLE, (place.cell, place.cell, 0.0)),
        _Entry.of(33922, _DOUBLE, (0.0, 0.0, 0.0, place.west, place.north, 0.0)),
    )


def _crs_entries(frame: MapFrame) -> tuple[_Entry, ...]:
    keys = geo_keys(frame)
    return (
        _Entry.of(34735, _SHORT, keys.directory),
        _Entry.of(34736, _DOUBLE, keys.doubles),
        _Entry.text(34737, keys.texts),
    )


def _words(names: Sequence[str], about: str) -> tuple[_Entry, ...]:
    items = "".join(
        f'<Item name="DESCRIPTION" sample="{number}" role="description">{escape(name)}</Item>'
        for number, name in enumerate(names)
    )
    metadata = f'<GDALMetadata><Item name="ABOUT">{escape(about)}</Item>{items}</GDALMetadata>'
    return (_Entry.text(42112, metadata), _Entry.text(42113, "nan"))


def _file(levels: Sequence[_Level]) -> bytes:
    """Header, all directories, then the tiles, those of the coarsest level first."""
    sizes = [_directory_size(level) for level in levels]
    starts = [8 + sum(sizes[:number]) for number in range(len(levels))]
    data, following = list[bytes](), 8 + sum(sizes)
    offsets: list[list[int]] = [[] for _ in levels]
    for number in reversed(range(len(levels))):
        for tile in levels[number].tiles:
            offsets[number].append(following)
            data.append(tile)
            following += len(tile)
    following_directory = [*starts[1:], 0]
    directories = [
        _directory(level, start, after, places)
        for level, start, after, places in zip(levels, starts, following_directory, offsets, strict=True)
    ]
    return b"".join((b"II", struct.pack("<HI", 42, 8), *directories, *data))


def _with_tiles(level: _Level, offsets: Sequence[int]) -> list[_Entry]:
    """All entries of a directory in the order of their tags."""
    lengths = [len(tile) for tile in level.tiles]
    own = (_Entry.of(324, _LONG, offsets), _Entry.of(325, _LONG, lengths))
    return sorted((*level.entries, *own), key=lambda entry: entry.tag)


def _directory_size(level: _Level) -> int:
    entries = _with_tiles(level, [0] * len(level.tiles))
    return 2 + 12 * len(entries) + 4 + sum(_padded(entry) for entry in entries)


def _padded(entry: _Entry) -> int:
    """Bytes next to the directory; values of four bytes and less are in it."""
    return 0 if len(entry.data) <= 4 else len(entry.data) + len(entry.data) % 2


def _directory(level: _Level, start: int, following: int, offsets: Sequence[int]) -> bytes:
    entries = _with_tiles(level, offsets)
    head, beside = [struct.pack("<H", len(entries))], list[bytes]()
    place = start + 2 + 12 * len(entries) + 4
    for entry in entries:
        head.append(struct.pack("<HHI", entry.tag, entry.kind, entry.count))
        if len(entry.data) <= 4:
            head.append(entry.data.ljust(4, b"\0"))
            continue
        head.append(struct.pack("<I", place))
        beside.append(entry.data.ljust(_padded(entry), b"\0"))
        place += _padded(entry)
    return b"".join((*head, struct.pack("<I", following), *beside))
