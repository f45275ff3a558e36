"""Applanix POSEO: exterior orientations as text, in map or geocentric coordinates.

A header tells datum, projection, order of the rotations and what was applied; the line under ``Record Format``
names the columns; rows are separated by blanks.

| columns | CRS to declare | angles to declare |
|---|---|---|
| EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA | that of the map | about the grid |
| X, Y, Z, ROLL, PITCH, HEADING | geographic, e.g. "EPSG:4326": geocentric X, Y, Z are read as longitude, latitude, ellipsoidal height | heading-pitch-roll against true north |
"""  # noqa: E501

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from adjust.geometry.earth import Ellipsoid, geodetic_from_ecef
from tasks.errors import Location
from tasks.formats.records import AngleOrder, ExposureRecords, FileStatement
from tasks.formats.text_lines import DeliveredLines
from tasks.formats.text_rows import Layout
from tasks.formats.text_table import TextTable, read_rows

_MAP = ("EASTING", "NORTHING", "ELLIPSOID HEIGHT", "OMEGA", "PHI", "KAPPA")
_GEOCENTRIC = ("X", "Y", "Z", "HEADING", "PITCH", "ROLL")
_FORMAT = re.compile(r"^\s*Record Format\s*:\s*$", re.IGNORECASE | re.MULTILINE)
_NUMBER = r"\s*[=:]\s*(-?\d+(?:\.\d+)?)"
_DATUM = re.compile(r"Mapping frame datum\s*:\s*([^;\n]+?)\s*;")
_PROJECTION = re.compile(r"Mapping frame projection\s*:\s*([^;\n]+?)\s*;")
_AXES = re.compile(r"(?:First|Second|Third) rotation is about the '(\w)' axis by the '(\w+)' angle")
_ORDERS: dict[tuple[str, ...], AngleOrder] = {
    ("omega", "phi", "kappa"): "omega-phi-kappa",
    ("phi", "omega", "kappa"): "phi-omega-kappa",
}
_ELLIPSOIDS = {"WGS84": "WGS84", "NAD83": "GRS80", "ETRS89": "GRS80"}
_WGS84 = Ellipsoid(6_378_137.0, 1.0 / 298.257223563)
_GRS80 = Ellipsoid(6_378_137.0, 1.0 / 298.257222101)
_APPLIED = (
    "Kappa cardinal rotation",
    "Boresight values",
    "Lever arm values",
    "Shift values",
    "Scale the Height",
)


def read_applanix(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read exposures.

    Raises
    ------
    InputError
        With file and line: no header of POSEO, columns missing, an order of angles the file does not have.
    """
    delivered = DeliveredLines.of(path, lone_return=b"")
    encoding = "utf-8" if delivered.is_utf8 else "latin-1"
    pieces = (piece.decode(encoding) for piece in delivered.pieces())
    # The header is a page of text, and a piece holds megabytes.
    text = next(pieces)
    found = _FORMAT.search(text)
    if found is None:
        raise Location(path).error(
            "There is no line 'Record Format:', which ends the header of an Applanix EO file.",
            "Deliver the file with its header, or declare another format.",
        )
    header, begin = text[: found.start()], text.count("\n", 0, found.end()) + 1
    below = text[found.end() :].split("\n")[1:]
    head = next((k for k, line in enumerate(below) if line.strip()), None)
    units = None if head is None else next((k for k in range(head + 1, len(below)) if below[k].strip()), None)
    if head is None or units is None:
        raise Location(path).error("The file ends in its header.", "Deliver it again.")
    names = [name.strip().upper() for name in below[head].split(",")]
    geocentric = set(_GEOCENTRIC) <= set(names)
    wanted = _GEOCENTRIC if geocentric else _MAP
    stated: AngleOrder = "heading-pitch-roll" if geocentric else _stated_order(header, path)
    missing = [name for name in ("ID", "TIME (S)", *wanted) if name not in names]
    if missing or len(set(names)) < len(names):
        raise Location(path, begin + head + 1).error(
            f"The columns of this file lack {', '.join(missing)}."
            if missing
            else "A column name is used twice.",
            "Required are ID, TIME (s) and EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, or X, "
            "Y, Z, ROLL, PITCH, HEADING.",
        )
    _refuse_other_units(below[units], path, begin + units + 1)
    numeric = tuple(name for name in names if name not in ("ID", "# EVENT"))
    layout = Layout(path, tuple(names), numeric, "blank")
    rows = (piece.encode() for piece in chain(["\n".join(below[units + 1 :])], pieces))
    table = read_rows(delivered, rows, layout, begin + units + 2)
    return _records(path, table, wanted, stated, header)


def _records(
    path: Path, table: TextTable, wanted: tuple[str, ...], stated: AngleOrder, header: str
) -> ExposureRecords:
    geocentric = wanted == _GEOCENTRIC
    position = table.numbers(wanted[:3])
    datum = _DATUM.search(header)
    name = datum.group(1) if datum is not None else None
    if geocentric:
        position = _geographic(position, name)
    nothing = np.full((len(table), 3), np.nan)
    empty = pa.nulls(len(table), pa.string())
    return ExposureRecords(
        file=path,
        image=table.text("ID"),
        camera=empty,
        strip=empty,
        flight=empty,
        time_s=table.numbers(("TIME (S)",))[:, 0],
        position=position,
        angles=table.numbers(wanted[3:]),
        sigma_position=nothing,
        sigma_angles=nothing,
        line=table.line,
        declared_angle_unit="deg",
        states=FileStatement(
            crs=f"+proj=longlat +ellps={_ellipsoid_name(name)}" if geocentric else _projection(header, name),
            datum=name,
            heights="ellipsoidal",
            order=stated,
            reference="true-north" if geocentric else "grid",
            position="projection_centre" if "Perspective Centre" in header else None,
        ),
        remarks=_applied(path, header),
    )


def _stated_order(header: str, path: Path) -> AngleOrder:
    axes = _AXES.findall(header)
    angles = tuple(angle.lower() for _, angle in axes)
    about = {"omega": "x", "phi": "y", "kappa": "z"}
    if angles in _ORDERS and all(about[angle.lower()] == axis.lower() for axis, angle in axes):
        return _ORDERS[angles]
    raise Location(path).error(
        "The header does not say that rotations are about x by omega, about y by phi, about z by kappa "
        f"({', '.join(angles) or 'no sequence is stated'}).",
        "Compute the orientations with this sequence, or deliver them as a table.",
    )


def _refuse_other_units(line: str, path: Path, number: int) -> None:
    plain = line.lower()
    if not (re.search(r"position in m(eters?|etres?)?\b", plain) and re.search(r"orientation in deg", plain)):
        raise Location(path, number).error(
            "The line of units does not state positions in metres and orientations in degrees.",
            "Compute the orientations in metres and degrees.",
        )


def _geographic(position: Floats, datum: str | None) -> Floats:
    """Longitude, latitude (degrees) and ellipsoidal height (n, 3) of geocentric coordinates."""
    ellipsoid = _GRS80 if _ellipsoid_name(datum) == "GRS80" else _WGS84
    latitude, longitude, height = geodetic_from_ecef(ellipsoid, position).T
    return np.column_stack([np.degrees(longitude), np.degrees(latitude), height])


def _ellipsoid_name(datum: str | None) -> str:
    return _ELLIPSOIDS.get((datum or "WGS84").upper().replace(" ", ""), "WGS84")


def _projection(header: str, datum: str | None) -> str | None:
    """The transverse Mercator projection of the header; None for others, which are not compared."""
    named = _PROJECTION.search(header)
    if named is None or named.group(1).upper() != "TM":
        return None
    keys = {
        "lon_0": "central meridian", "lat_0": "latitude of the grid origin", "k": "grid scale factor",
        "x_0": "false easting", "y_0": "false northing",
    }  # fmt: skip
    values = {key: re.search(text + _NUMBER, header) for key, text in keys.items()}
    if any(value is None for value in values.values()):
        return None
    terms = " ".join(f"+{key}={value.group(1)}" for key, value in values.items() if value is not None)
    return f"+proj=tmerc {terms} +ellps={_ellipsoid_name(datum)} +units=m"


def _applied(path: Path, header: str) -> tuple[str, ...]:
    """Corrections applied according to the header, for those who calibrate with these exposures."""
    said = [
        re.sub(r"\s+", " ", line).strip(" .")
        for line in header.split("\n")
        if any(name.lower() in line.lower() for name in _APPLIED)
    ]
    return (f"{path.name}: its header states: {'; '.join(said)}.",) if said else ()
