"""A GeoPackage 1.3 (OGC 12-128r17) of layers of points, lines and polygons with heights, in memory."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import pyproj

from adjust.arrays import Floats
from tasks.coordinates.crs import MapFrame

Geometry: TypeAlias = Literal["POINT", "LINESTRING", "POLYGON"]
Cell: TypeAlias = str | int | float | None

_APPLICATION_ID, _VERSION = 0x47504B47, 10300
_WKB = {"POINT": 1001, "LINESTRING": 1002, "POLYGON": 1003}
# Of systems that no authority numbers.
_OWN_SRS = 100_000
_SQL_TYPES = {str: "TEXT", int: "INTEGER", float: "REAL"}
# Engineering systems (OGC 18-010r7) have no earth, and every GIS shows them as they are.
_LOCAL_WKT2 = (
    'ENGCRS["{name}",EDATUM["{name}"],CS[Cartesian,2],AXIS["(E)",east,ORDER[1],LENGTHUNIT["metre",1]],'
    'AXIS["(N)",north,ORDER[2],LENGTHUNIT["metre",1]]]'
)
_LOCAL_WKT1 = 'LOCAL_CS["{name}",LOCAL_DATUM["{name}",0],UNIT["metre",1],AXIS["(E)",EAST],AXIS["(N)",NORTH]]'
_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL,
  description TEXT, definition_12_063 TEXT NOT NULL);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL,
  identifier TEXT UNIQUE, description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
  geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
  CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL,
  definition TEXT NOT NULL, scope TEXT NOT NULL,
  CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
INSERT INTO gpkg_extensions VALUES ('gpkg_spatial_ref_sys', 'definition_12_063', 'gpkg_crs_wkt',
  'http://www.geopackage.org/spec120/#extension_crs_wkt', 'read-write');
INSERT INTO gpkg_spatial_ref_sys VALUES
  ('Undefined cartesian SRS', -1, 'NONE', -1, 'undefined', NULL, 'undefined'),
  ('Undefined geographic SRS', 0, 'NONE', 0, 'undefined', NULL, 'undefined');
"""


@dataclass(frozen=True, eq=False)
class Layer:
    """Features of one kind.

    Attributes
    ----------
    name, description : of the layer.
    geometry : of all features.
    vertices : of each feature (k, 3), map coordinates; a polygon's ring is closed.
    columns : name → type of its cells.
    rows : cells of each feature.
    """

    name: str
    description: str
    geometry: Geometry
    vertices: Sequence[Floats] | Floats
    columns: dict[str, type[str] | type[int] | type[float]]
    rows: Sequence[Sequence[Cell]]


def geopackage(place: MapFrame, title: str, layers: Sequence[Layer]) -> bytes:
    """The file; a local frame becomes an engineering CRS of the title."""
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {_VERSION}")
        connection.executescript(_TABLES)
        _add_system(connection, 4326, pyproj.CRS.from_epsg(4326))
        system = _own_system(connection, place, title)
        for layer in layers:
            _add_layer(connection, layer, system)
        connection.commit()
        return connection.serialize()


def _add_system(connection: sqlite3.Connection, number: int, crs: pyproj.CRS) -> None:
    organization, code = crs.to_authority() or ("NONE", str(number))
    connection.execute(
        "INSERT OR IGNORE INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, NULL, ?)",
        (crs.name, number, organization, int(code), crs.to_wkt("WKT1_GDAL"), crs.to_wkt()),
    )


def _own_system(connection: sqlite3.Connection, place: MapFrame, title: str) -> int:
    """The number of the system of the coordinates."""
    if place.is_local:
        name = "local" + "".join(sign for sign in f" {title}" if sign.isalnum() or sign in " -_")
        connection.execute(
            "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, 'NONE', ?, ?, NULL, ?)",
            (name, _OWN_SRS, _OWN_SRS, _LOCAL_WKT1.format(name=name), _LOCAL_WKT2.format(name=name)),
        )
        return _OWN_SRS
    authority = place.crs.to_authority()
    number = int(authority[1]) if authority is not None and authority[0] == "EPSG" else _OWN_SRS
    _add_system(connection, number, place.crs)
    return number


def _add_layer(connection: sqlite3.Connection, layer: Layer, system: int) -> None:
    columns = ", ".join(f'"{name}" {_SQL_TYPES[kind]}' for name, kind in layer.columns.items())
    connection.execute(
        f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, '
        f"geom {layer.geometry}, {columns})"
    )
    plan = np.concatenate([np.zeros((0, 3)), *layer.vertices])[:, :2]
    box = [None] * 4 if not len(plan) else [*plan.min(axis=0).tolist(), *plan.max(axis=0).tolist()]
    connection.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, min_x, min_y, max_x, "
        "max_y, srs_id) VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, layer.description, *box, system),
    )
    connection.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)",
        (layer.name, layer.geometry, system),
    )
    marks = ", ".join("?" * (len(layer.columns) + 1))
    named = ", ".join(f'"{name}"' for name in layer.columns)
    connection.executemany(
        f'INSERT INTO "{layer.name}" (geom, {named}) VALUES ({marks})',
        (
            (_blob(layer.geometry, vertices, system), *(_cell(value) for value in row))
            for vertices, row in zip(layer.vertices, layer.rows, strict=True)
        ),
    )


def _blob(geometry: Geometry, vertices: Floats, system: int) -> bytes:
    """Header (little-endian, no envelope), then ISO well-known binary."""
    head = b"GP" + struct.pack("<BBi", 0, 1, system) + struct.pack("<BI", 1, _WKB[geometry])
    counts = {"POINT": b"", "LINESTRING": struct.pack("<I", len(vertices))}
    count = counts.get(geometry, struct.pack("<II", 1, len(vertices)))
    return head + count + np.ascontiguousarray(vertices, dtype="<f8").tobytes()


def _cell(value: Cell) -> Cell:
    """Python's own numbers; what is not known is null."""
    if value is None or isinstance(value, str):
        return value
    number = float(value)
    return None if np.isnan(number) else int(value) if isinstance(value, int | np.integer) else number
