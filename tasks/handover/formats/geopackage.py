"""GeoPackage for QGIS, ArcGIS and every GIS: the block as layers.

| layer | geometry |
|---|---|
| ``cameras`` | projection centres with angles and standard deviations |
| ``footprints`` | corners of the images on the ground at middle height below each, through the curved earth |
| ``tie_points`` | adjusted object points |
| ``control_points``, ``check_points`` | as surveyed, with adjusted − surveyed; a coordinate that was not surveyed is the adjusted one |
| ``residual_vectors`` | from each of these to where it was adjusted, enlarged as ``enlarged`` says |

The file is written in memory: GeoPackage 1.3 (OGC 12-128r17), layers of points, lines and polygons with heights.
"""  # noqa: E501

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import pyproj

from adjust.arrays import Bools, Floats
from tasks.coordinates.crs import MapFrame
from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.footprint import footprints
from tasks.handover.formats.numbers import in_angles

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


# Largest residual vector as part of the block.
_LONGEST = 0.05
_SIGMAS = {"sigma_x_m": float, "sigma_y_m": float, "sigma_z_m": float}
_DIFFERENCES = {"dx_m": float, "dy_m": float, "dz_m": float}


def write_geopackage(delivery: Delivery) -> Files:
    """``block.gpkg``."""
    surveyed = delivery.points.surveyed
    layers = [
        _cameras(delivery),
        _footprints(delivery),
        _tie_points(delivery),
        _surveyed(delivery, "control_points", ~surveyed.check),
        _surveyed(delivery, "check_points", surveyed.check),
        _vectors(delivery),
    ]
    place = delivery.results.images.map_frame
    return {"block.gpkg": geopackage(place, delivery.results.name, layers)}


def _cameras(delivery: Delivery) -> Layer:
    pose = delivery.handed.pose
    angles, sigmas = in_angles(pose.map_from_camera, Angles()), delivery.sigmas
    rows: list[list[Cell]] = [
        [name, delivery.camera_names[k], delivery.results.strips[k], *angles[k].tolist(), *sigma]
        for k, (name, sigma) in enumerate(zip(delivery.names, sigmas.to_numpy(float).tolist(), strict=True))
    ]
    columns = dict.fromkeys(("image", "camera", "strip"), str)
    numbers = dict.fromkeys(("omega_deg", "phi_deg", "kappa_deg", *sigmas.columns), float)
    text = "Adjusted projection centres; angles from grid north"
    return Layer("cameras", text, "POINT", pose.centre[:, None], {**columns, **numbers}, rows)


def _footprints(delivery: Delivery) -> Layer:
    corners, below = footprints(delivery.results)
    rows: list[list[Cell]] = [
        [delivery.names[k], delivery.camera_names[k], delivery.results.strips[k], float(corners[k, 0, 2])]
        for k in np.flatnonzero(below)
    ]
    columns = {"image": str, "camera": str, "strip": str, "ground_m": float}
    text = "Images on the ground at the middle height of their tie points"
    return Layer("footprints", text, "POLYGON", list(corners[below]), columns, rows)


def _tie_points(delivery: Delivery) -> Layer:
    points = delivery.points
    kept = np.flatnonzero(~points.is_surveyed)
    rays = points.rays
    rows: list[list[Cell]] = [[points.names[k], int(rays[k]), *points.sigma[k].tolist()] for k in kept]
    columns = {"point": str, "rays": int, **_SIGMAS}
    return Layer("tie_points", "Adjusted object points", "POINT", points.in_map[kept, None], columns, rows)


def _surveyed(delivery: Delivery, name: str, kept: Bools) -> Layer:
    surveyed, place = delivery.points.surveyed, _places(delivery)
    kept = kept & np.isfinite(place).all(axis=1)
    rows: list[list[Cell]] = [
        [surveyed.names[k], *surveyed.sigma[k].tolist(), *surveyed.difference[k].tolist()]
        for k in np.flatnonzero(kept)
    ]
    columns = {"point": str, **_SIGMAS, **_DIFFERENCES}
    text = "Surveyed points, with adjusted minus surveyed coordinates"
    return Layer(name, text, "POINT", place[kept, None], columns, rows)


def _vectors(delivery: Delivery) -> Layer:
    """Lines in plan and height; zero for a coordinate that was not surveyed."""
    surveyed, place = delivery.points.surveyed, _places(delivery)
    difference = np.nan_to_num(surveyed.difference)
    kept = np.isfinite(place).all(axis=1) & np.isfinite(surveyed.difference).any(axis=1)
    enlarged = _enlargement(delivery, difference[kept])
    rows: list[list[Cell]] = [
        [
            surveyed.names[k],
            "check" if surveyed.check[k] else "control",
            *surveyed.difference[k].tolist(),
            float(np.hypot(*difference[k, :2])),
            enlarged,
        ]
        for k in np.flatnonzero(kept)
    ]
    columns = {"point": str, "role": str, **_DIFFERENCES, "plan_m": float, "enlarged": float}
    ends = place + enlarged * difference
    lines = np.stack([place, ends], axis=1)[kept]
    text = "Adjusted minus surveyed, enlarged by the factor in the column enlarged"
    return Layer("residual_vectors", text, "LINESTRING", list(lines), columns, rows)


def _places(delivery: Delivery) -> Floats:
    """(s, 3) surveyed coordinates, completed by adjusted ones."""
    points = delivery.points
    adjusted = dict(zip(points.names, points.in_map, strict=True))
    missing = np.full(3, np.nan)
    found = np.array([adjusted.get(name, missing) for name in points.surveyed.names]).reshape(-1, 3)
    return np.where(np.isfinite(points.surveyed.in_map), points.surveyed.in_map, found)


def _enlargement(delivery: Delivery, difference: Floats) -> float:
    """1, 2 or 5 times a power of ten that makes the largest vector in plan a small part of the block."""
    longest = float(np.linalg.norm(difference[:, :2], axis=1).max(initial=0.0))
    centre = delivery.handed.pose.centre
    extent = float(np.linalg.norm(np.ptp(centre[:, :2], axis=0)))
    if longest == 0.0 or extent == 0.0:
        return 1.0
    wanted = _LONGEST * extent / longest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(power * step for step in (1.0, 2.0, 5.0) if power * step <= wanted * (1.0 + 1e-9)))
