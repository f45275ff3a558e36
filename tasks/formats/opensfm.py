"""OpenSfM and OpenDroneMap: ``reconstruction.json``, ``tracks.csv``, ``gcp_list.txt``, ``geo.txt``.

| file | read |
|---|---|
| ``reconstruction.json`` | shots as longitude, latitude, ellipsoidal height and angles against true north where it has a reference (its frame is east, north, up there), else local; cameras perspective and brown, in pixels; rig cameras and rig instances as heads and events |
| ``tracks.csv`` | image points from the middle of the image, in parts of its longer side: unit = "longer-side" |
| ``gcp_list.txt`` | CRS in the first line, then x y z column row image and a name; points without a name are distinguished by their coordinates |
| ``geo.txt`` | CRS in the first line, then image x y z, angles, which are not read, and accuracies in plan and height |

A point of ``gcp_list.txt`` whose name begins with ``CHK-`` is a check point. Names may have blanks if tabulators
separate the fields.
"""  # noqa: E501

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import exp
from tasks.errors import Location
from tasks.formats.earth_poses import GEOGRAPHIC, geocentric_poses, geographic_poses
from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.long_columns import LongPoints, LongRows, table_of
from tasks.formats.opensfm_rigs import opensfm_rigs
from tasks.formats.plain_records import (
    CV_AXES,
    LOCAL,
    control_of,
    degrees_of_rotations,
    exposures_of,
    number_of,
    numbers_of,
    pieces_of,
)
from tasks.formats.records import (
    AngleOrder,
    ControlRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.rigs import Rigs, with_rigs
from tasks.formats.text_lines import numbered_lines
from tasks.formats.text_table import read_bytes
from tasks.plain_text import quoted

_CHECK = "CHK-"
# Fields of a line of geo.txt that has angles and accuracies.
_WITH_ACCURACIES = 9
_UTM = re.compile(r"WGS84\s+UTM\s+(\d{1,2})\s*([NS])", re.IGNORECASE)
_IMAGE_FILE = re.compile(r"\.(tiff?|jpe?g|png|dng|jp2)$", re.IGNORECASE)
_TRACKS = re.compile(r"OPENSFM_TRACKS_VERSION_v[12]$")


def read_opensfm_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the shots of a reconstruction.

    Raises
    ------
    InputError
        If the file is not a reconstruction, has several, or numbers are missing.
    """
    shots = _shots(path)
    image, at = shots.image, range(1, len(shots.image) + 1)
    centre, angles = np.empty((len(image), 3)), np.empty((len(image), 3))
    for piece in pieces_of(len(image)):
        world_from_camera = np.swapaxes(exp(shots.turn[piece]), 1, 2)
        rotation = world_from_camera @ CV_AXES
        centre[piece] = -np.einsum("nij,nj->ni", world_from_camera, shots.shift[piece])
        if shots.reference:
            poses = geocentric_poses(shots.reference, centre[piece], rotation)
            centre[piece], rotation = geographic_poses(*poses)
        angles[piece] = degrees_of_rotations(path, rotation, image[piece], at[piece])
    # Altitudes are whatever the images came with.
    states = replace(GEOGRAPHIC, heights=None) if shots.reference else LOCAL
    records = exposures_of(path, image, centre, angles, at, camera=shots.camera, unit="deg", states=states)
    if not (shots.rigs.heads or shots.rigs.remarks):
        return records
    world_from_camera = np.swapaxes(exp(shots.turn), 1, 2)
    where = -np.einsum("nij,nj->ni", world_from_camera, shots.shift)
    return with_rigs(records, shots.rigs, where, world_from_camera)


class _Shots(NamedTuple):
    """Shots: rotation (axis, angle) and translation camera from world (n, 3), place of the origin, rigs."""

    image: list[str]
    camera: list[str | None]
    turn: Floats
    shift: Floats
    reference: list[float]
    rigs: Rigs


def _shots(path: Path) -> _Shots:
    """The shots of a reconstruction, the rest of which is not kept; no reference of a local one."""
    one = _reconstruction(path)
    cameras: dict[str, str | None] = {}
    turn, shift = array("d"), array("d")
    for name, shot in one["shots"].entries():
        turn.extend(shot["rotation"].numbers(3))
        shift.extend(shot["translation"].numbers(3))
        cameras[name] = str(shot["camera"].value) if shot.has("camera") else None
    found = opensfm_rigs(one, cameras)
    camera = [found.camera.get(image, own) for image, own in cameras.items()]
    reference: list[float] = []
    if one.has("reference_lla"):
        place = one["reference_lla"]
        reference = [place[name].number() for name in ("latitude", "longitude", "altitude")]
    return _Shots(list(cameras), camera, table_of(turn, 3), table_of(shift, 3), reference, found.rigs)


def read_opensfm_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the cameras of a reconstruction.

    Raises
    ------
    InputError
        If the file is not a reconstruction, or a camera is neither perspective nor brown.
    """
    found = {}
    one = _reconstruction(path)
    for name, camera in one["cameras"].entries():
        kind = camera["projection_type"].value if camera.has("projection_type") else None
        if kind not in ("perspective", "brown"):
            raise Location(path, entity=name).error(
                f"The camera is '{kind}', but only perspective and brown cameras are supported.",
                "Leave it out.",
            )
        columns, rows = (int(camera[key].number()) for key in ("width", "height"))
        longer = max(columns, rows)
        c = camera["focal" if kind == "perspective" else "focal_y"].number()
        if c <= 0.0 or columns <= 0 or rows <= 0:
            raise Location(path, entity=name).error("A focal length or size is not positive.", "Correct it.")
        values = {key: camera[key].number() for key in ("k1", "k2", "k3", "p1", "p2") if camera.has(key)}
        if kind == "brown":
            values["b1"] = camera["focal_x"].number() / c - 1.0
        x0, y0 = (longer * camera[key].number() if camera.has(key) else 0.0 for key in ("c_x", "c_y"))
        known = {f"brown-forward:{key}": value for key, value in values.items() if value}
        found[name] = PixelCamera(columns, rows, longer * c, (x0, 0.0 - y0), known)
    # Heads with the same camera model have it each.
    heads = opensfm_rigs(one, _models(one)).models
    return {**found, **{name: found[model] for name, model in heads.items() if model in found}}


def _models(one: JsonValue) -> dict[str, str | None]:
    """The camera of each shot, as far as they are told."""
    shots = one["shots"].entries() if one.has("shots") else []
    return {name: str(shot["camera"].value) if shot.has("camera") else None for name, shot in shots}


def read_opensfm_tracks(path: Path) -> ImagePointRecords:
    """Read the image points of all tracks.

    Raises
    ------
    InputError
        With file and line: another version of the file, fields missing.
    """
    rows = numbered_lines(path)
    if not _TRACKS.match(next(rows)[1].strip()):
        raise Location(path, 1).error(
            "The file does not begin with OPENSFM_TRACKS_VERSION_v1 or v2.", "Check that it is tracks.csv."
        )
    points = LongPoints()
    for number, line in rows:
        if not line.strip():
            continue
        fields = line.split("\t")
        x, y = numbers_of(path, fields[3:], 2, number, "shot, track, feature, x, y")
        # Their y counts downwards.
        points.append(fields[0], fields[1], (x, 0.0 - y), number)
    return points.records(path)


def read_odm_control(path: Path) -> ControlRecords:
    """Read the points of a ``gcp_list.txt``.

    Raises
    ------
    InputError
        With file and line: fields missing, a name with two different coordinates.
    """
    crs, rows = _with_crs(path)
    found: dict[str, tuple[list[float], int]] = {}
    for name, position, _, _, number in _gcp_list(path, rows):
        known = found.setdefault(name, (position, number))
        if not np.array_equal(known[0], position, equal_nan=True):
            raise Location(path, number, name).error(
                f"The point has other coordinates in line {known[1]}.",
                "Correct one of the two. A name ends at a blank, unless tabulators separate the fields.",
            )
    role = ["check" if name.startswith(_CHECK) else "control" for name in found]
    positions, at = [value[0] for value in found.values()], [value[1] for value in found.values()]
    return control_of(path, list(found), positions, at, role=role, states=FileStatement(crs=crs))


def read_odm_measurements(path: Path) -> ImagePointRecords:
    """Read the measurements of a ``gcp_list.txt`` in pixels (pixel_origin = "centre").

    Raises
    ------
    InputError
        With file and line: fields missing.
    """
    points = LongPoints()
    for name, _, column_row, seen_in, number in _gcp_list(path, _with_crs(path)[1]):
        points.append(seen_in, name, column_row, number)
    return points.records(path)


def _gcp_list(
    path: Path, rows: Iterator[tuple[int, str]]
) -> Iterator[tuple[str, list[float], list[float], str, int]]:
    """Name, coordinates, pixel, image and number of every line."""
    names: dict[tuple[float, ...], str] = {}
    for number, line in rows:
        tabbed = line.count("\t") >= 5
        fields = line.split("\t") if tabbed else line.split()
        x, y = numbers_of(path, fields, 2, number, "x, y, z, column, row, image")
        z = float("nan") if len(fields) > 2 and fields[2].lower() in ("", "nan") else None
        column_row = numbers_of(path, fields[3:], 2, number, "x, y, z, column, row, image")
        height = number_of(path, fields[2], number, "z of the point") if z is None else z
        if len(fields) < 6:
            raise Location(path, number).error("The line contains no image.", "Add it.")
        goes_on = len(fields) > 6 and not tabbed and _IMAGE_FILE.search(fields[6])
        if goes_on and not _IMAGE_FILE.search(fields[5]):
            raise Location(path, number).error(
                f"The name of the image, {quoted(fields[5])}, seems to go on with {quoted(fields[6])}.",
                "Separate the fields by tabulators if names contain blanks.",
            )
        # Not a number is not itself, and would make of each row a point of its own.
        key = (x, y, -1e15 if np.isnan(height) else height)
        name = fields[6].strip() if len(fields) > 6 and fields[6].strip() else None
        name = name or names.setdefault(key, f"gcp{len(names) + 1}")
        yield name, [x, y, height], column_row, fields[5].strip(), number


def read_odm_geo(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the positions of a ``geo.txt``; its angles are not used for orientations there, nor here.

    Raises
    ------
    InputError
        With file and line: fields missing.
    """
    crs, rows = _with_crs(path)
    images = LongRows("position", "sigma_position")
    for number, line in rows:
        fields = line.split()
        position = numbers_of(path, fields[1:], 3, number, "image, x, y, z")
        plan, height = np.nan, np.nan
        if len(fields) >= _WITH_ACCURACIES:
            plan, height = numbers_of(path, fields[7:], 2, number, "accuracies in plan and height")
        images.append(fields[0], position, (plan, plan, height), line=number)
    return images.exposures(path, FileStatement(crs=crs))


def _with_crs(path: Path) -> tuple[str, Iterator[tuple[int, str]]]:
    """The CRS of the first line as PROJ understands it, and the other lines that say anything."""
    rows = ((k, line) for k, line in numbered_lines(path) if line.strip() and line.strip()[0] != "#")
    at, first = next(rows, (1, ""))
    first = first.strip()
    utm = _UTM.match(first)
    if utm is not None:
        crs = f"+proj=utm +zone={utm.group(1)} {'+south ' if utm.group(2).upper() == 'S' else ''}+datum=WGS84"
    elif first.upper() in ("WGS84", "WGS 84"):
        crs = "+proj=longlat +datum=WGS84"
    elif first.upper().startswith("EPSG:") or first.startswith("+proj="):
        crs = first
    else:
        raise Location(path, at).error(
            "The first line does not state a CRS.",
            'It is "EPSG:NUMBER", "WGS84", "WGS84 UTM 32N" or a text for PROJ.',
        )
    return crs, rows


def _reconstruction(path: Path) -> JsonValue:
    found = json_value(path, read_bytes(path, "document"))
    one = found.items()
    if len(one) != 1:
        raise Location(path).error(
            f"The file has {len(one)} reconstructions, but only one can be read.",
            "Deliver a file with the required one only.",
        )
    return one[0]
