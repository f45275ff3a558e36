"""COLMAP ``database.db`` (SQLite): cameras, tie points of verified matches, position priors.

| table | read |
|---|---|
| ``cameras`` | as ``cameras.txt`` (see ``colmap``), by their numbers |
| ``keypoints``, ``two_view_geometries`` | verified matches joined to tie points; pixels from the corner of the first one |
| ``pose_priors`` | positions: latitude, longitude, ellipsoidal height as longitude, latitude, height; or Cartesian ones, local |

Of ``pose_priors`` there are three generations, distinguished by their columns. The database is opened in
memory: nothing in it is carried out.
"""  # noqa: E501

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.errors import InputError, Location
from tasks.formats.colmap import camera_of_colmap, model_of_number
from tasks.formats.homologous_points import joined_to_tracks, named, tie_names
from tasks.formats.long_columns import LongRows
from tasks.formats.plain_records import image_points_of
from tasks.formats.records import (
    AngleOrder,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.text_table import read_bytes

_MAGIC = b"SQLite format 3\0"
_PAIR = 2147483647
_WGS84, _CARTESIAN = 0, 1
# COLMAP has one for each image at the most.
_MOST_CAMERAS = 100_000


def read_colmap_database_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the cameras by their numbers.

    Raises
    ------
    InputError
        If the database is damaged or has more than 100,000 cameras, or a model is none that is read.
    """
    found = {}
    with _opened(path) as database:
        for entry, row in enumerate(
            _rows(path, database, "cameras", "camera_id, model, width, height, params"), 1
        ):
            if entry > _MOST_CAMERAS:
                raise Location(path).error(
                    f"The database has more than {_MOST_CAMERAS:,} cameras.",
                    "Let the images of a camera share it (COLMAP: ImageReader.single_camera).",
                )
            number, model, columns, rows = (_whole(path, value, entry) for value in row[:4])
            values = _array(path, row[4], "<f8", entry).tolist()
            found[str(number)] = camera_of_colmap(
                path, str(number), model_of_number(model), float(columns), float(rows), values, entry
            )
    if not found:
        raise Location(path).error("There is no camera in the database.", "Check that it is the right one.")
    return found


def read_colmap_database_image_points(path: Path) -> ImagePointRecords:
    """Read the tie points of all verified matches.

    Raises
    ------
    InputError
        If the database is damaged, or has no verified match.
    """
    with _opened(path) as database:
        names = _names(path, database)
        number = {image: k for k, image in enumerate(names)}
        places = {}
        for entry, row in enumerate(_rows(path, database, "keypoints", "image_id, rows, cols, data"), 1):
            image, rows, columns = (_whole(path, value, entry) for value in row[:3])
            values = _array(path, row[3] or b"", "<f4", entry)
            if image not in names or columns < 2 or len(values) != rows * columns:
                raise _damaged(path, entry)
            places[image] = values.reshape(rows, columns)[:, :2].copy()
        image_of_end, xy = [np.zeros(0, np.int32)], [np.zeros((0, 2), np.float32)]
        ends: tuple[list[Any], list[Any]] = ([], [])
        for entry, row in enumerate(_rows(path, database, "two_view_geometries", "pair_id, rows, data"), 1):
            pair, rows = _whole(path, row[0], entry), _whole(path, row[1], entry)
            matches = _array(path, row[2] or b"", "<u4", entry)
            if len(matches) != 2 * rows:
                raise _damaged(path, entry)
            for side, image in enumerate(divmod(pair, _PAIR) if rows else ()):
                index = matches.reshape(rows, 2)[:, side].astype(np.int64)
                if image not in places or index.max() >= len(places[image]):
                    raise _damaged(path, entry)
                ends[side].append((np.full(rows, number[image], np.int32), places[image][index]))
    for image, place in (*ends[0], *ends[1]):
        image_of_end.append(image)
        xy.append(place)
    del places, ends
    of_ends = np.concatenate(image_of_end)
    measured = np.concatenate(xy)
    image_of_end.clear()
    xy.clear()
    if len(of_ends) == 0:
        raise Location(path).error(
            "There is no verified match in the database (two_view_geometries).",
            "Run the matcher of COLMAP with geometric verification.",
        )
    kept, track = joined_to_tracks(of_ends, measured)
    return image_points_of(
        path,
        named(of_ends[kept], pa.array(names.values(), pa.string())),
        tie_names(track),
        measured[kept].astype(np.float64),
        range(1, len(kept) + 1),
    )


def read_colmap_database_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the position priors; there are no angles.

    Raises
    ------
    InputError
        If the database is damaged, has no priors, or both geographic and Cartesian ones.
    """
    images, systems = LongRows("position", "sigma_position"), set()
    with _opened(path) as database:
        names = _names(path, database)
        cameras = {number: str(own) for number, own in _rows(path, database, "images", "image_id, camera_id")}
        known = {row[1] for row in database.execute("PRAGMA table_info(pose_priors)")}
        key = "corr_data_id" if "corr_data_id" in known else "image_id"
        covariance = "position_covariance" if "position_covariance" in known else "NULL"
        if not {key, "position", "coordinate_system"} <= known:
            raise Location(path).error(
                "The database has no position priors (pose_priors).",
                "Databases of COLMAP before 3.10 have none: give the positions in a table.",
            )
        columns = f"{key}, position, {covariance}, coordinate_system"
        for entry, row in enumerate(_rows(path, database, "pose_priors", columns), 1):
            number, system = _whole(path, row[0], entry), row[3]
            values = _array(path, row[1] or b"", "<f8", entry)
            if number not in names or len(values) != 3 or system not in (_WGS84, _CARTESIAN):
                raise _damaged(path, entry)
            position = values[[1, 0, 2]] if system == _WGS84 else values
            images.append(names[number], position, _sigma(path, row[2], entry), text=cameras[number])
            systems.add(system)
    if len(systems) > 1:
        raise Location(path).error(
            "Some priors are geographic, others Cartesian.", "Use the same system for all."
        )
    states = FileStatement(crs="local" if systems == {_CARTESIAN} else None, datum="WGS 84")
    return images.exposures(path, states)


def _sigma(path: Path, covariance: object, entry: int) -> Floats:
    """Standard deviations (3,) of a covariance; NaN if it is invalid."""
    values = _array(path, covariance or b"", "<f8", entry)
    if len(values) != 9:
        return np.full(3, np.nan)
    variance = values.reshape(3, 3).diagonal()
    return np.sqrt(np.where(variance > 0.0, variance, np.nan))


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """The database in memory; its errors as one sentence."""
    content = read_bytes(path)
    if not content.startswith(_MAGIC):
        raise Location(path).error("This is not a SQLite database.", "Deliver COLMAP's database.db.")
    with closing(sqlite3.connect(":memory:")) as connection:
        try:
            connection.deserialize(content)
            connection.execute("PRAGMA trusted_schema = OFF")
            # A computed column could make values of any length out of nothing.
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, len(content))
            # The database has a copy of its own.
            del content
            yield connection
        except (sqlite3.Error, OverflowError, UnicodeDecodeError, MemoryError) as error:
            raise Location(path).error(
                f"The database cannot be read: {error}.", "Deliver it again."
            ) from error


def _rows(path: Path, database: sqlite3.Connection, table: str, columns: str) -> Iterator[tuple[Any, ...]]:
    """Rows of a plain table, not of a view of this name, which could be endless."""
    plain = "type = 'table' AND sql NOT LIKE 'CREATE VIRTUAL%'"
    found = database.execute(f"SELECT 1 FROM sqlite_master WHERE name = ? AND {plain}", (table,)).fetchone()
    if found is None:
        raise Location(path).error(
            f"The database has no table '{table}'.", "Check that it is a database of COLMAP."
        )
    yield from database.execute(f"SELECT {columns} FROM {table} ORDER BY 1")


def _names(path: Path, database: sqlite3.Connection) -> dict[int, str]:
    found = {}
    for entry, (number, name) in enumerate(_rows(path, database, "images", "image_id, name"), 1):
        if not isinstance(name, str):
            raise _damaged(path, entry)
        found[_whole(path, number, entry)] = name
    return found


def _whole(path: Path, value: object, entry: int) -> int:
    if not isinstance(value, int) or not 0 <= value < 2**62:
        raise _damaged(path, entry)
    return value


def _array(path: Path, value: object, kind: str, entry: int) -> Any:
    if not isinstance(value, bytes) or len(value) % np.dtype(kind).itemsize:
        raise _damaged(path, entry)
    found = np.frombuffer(value, kind)
    if kind != "<u4" and not np.isfinite(found).all():
        raise _damaged(path, entry)
    return found


def _damaged(path: Path, entry: int) -> InputError:
    return Location(path, entry).error(
        "A row is not as COLMAP writes it.", "The database may be damaged: deliver it again."
    )
