"""STAC with the extension perspective-imagery: an item, a collection, or a folder of them as one zip file.

| field | read |
|---|---|
| ``pers:perspective_center`` | position, with all three coordinates |
| ``pers:crs`` | EPSG number, WKT or PROJJSON; heights of ``pers:vertical_crs`` are declared |
| ``pers:rotation_matrix`` | image from object, row by row (as in the published example) |
| ``pers:omega``, ``phi``, ``kappa`` | degrees, R = Rx Ry Rz; compared with the matrix where both are there |
| ``pers:interior_orientation`` | size, pixel (mm), focal length (mm), principal point (mm, x right, y up) |

An image is called by its file: that of the asset with the role ``data``, or of the only asset. Sign and unit of
distortion refer to a standard that is not in the file, and a camera with any is refused.
"""  # noqa: E501

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import Location
from tasks.formats.crs_definition import known_crs
from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.long_columns import LongRows
from tasks.formats.named_entries import file_of_uri
from tasks.formats.packed_folder import is_packed, packed_folder
from tasks.formats.records import AngleOrder, CameraRecord, ExposureRecords, FileStatement
from tasks.formats.text_table import read_bytes
from tasks.magnitude import MOST_PIXELS

_ANGLES = ("pers:omega", "pers:phi", "pers:kappa")
_CAMERA = "pers:interior_orientation"
# Angles with four decimals of a degree, and a turn of the matrix by them.
_SAME_DEG = 2e-4


def read_stac_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the perspective centres and rotations of the items.

    Raises
    ------
    InputError
        If there is no such item, coordinates are missing or in several CRSs, or matrix and angles differ.
    """
    rows, crs, heights = LongRows("position", "rotation"), set(), set()
    for item in _of_type(path, "Feature"):
        said = item["properties"]
        if not said.has("pers:perspective_center"):
            continue
        camera = said[_CAMERA]["camera_id"].text() if _has_camera_id(said) else None
        position = said["pers:perspective_center"].numbers(3)
        rows.append(_image(item), position, _rotation(said).ravel(), text=camera)
        crs.add(_crs(said))
        heights |= {str(said["pers:vertical_crs"].value)} if said.has("pers:vertical_crs") else set()
    if len(crs) > 1:
        raise Location(path).error("The items are in several CRSs.", "Deliver each of them separately.")
    states = FileStatement(
        crs=next(iter(crs), None), order="omega-phi-kappa", reference="grid", position="projection_centre"
    )
    remarks = tuple(
        f"Its heights are of the vertical CRS {one}: declare `heights`." for one in sorted(heights)
    )
    return rows.exposures(path, states, remarks=remarks)


def read_stac_cameras(path: Path) -> Mapping[str, CameraRecord]:
    """Read the interior orientations by their ``camera_id``.

    Raises
    ------
    InputError
        If there is none, one has distortion or no square pixels, or a camera is described in two ways.
    """
    found: dict[str, CameraRecord] = {}
    for one in _of_type(path, "Feature", "Collection"):
        said = one["properties"] if one.has("properties") else one
        if not _has_camera_id(said):
            continue
        name = said[_CAMERA]["camera_id"].text()
        camera = _camera(said[_CAMERA], name)
        if found.setdefault(name, camera) != camera:
            raise Location(path, entity=name).error(
                "The camera is described in two ways.", "Deliver one of the two."
            )
    if not found:
        raise Location(path).error(f"Nothing has a {_CAMERA}.", "Deliver the collection, too.")
    return found


def _of_type(path: Path, *kinds: str) -> Iterator[JsonValue]:
    """Objects of these types in the file, or in the members of a zip file."""
    content = read_bytes(path)
    if is_packed(content):
        folder = packed_folder(path, content)
        documents = (
            json_value(path, folder.read(name), name) for name in folder.members if name.endswith("json")
        )
    else:
        documents = (json_value(path, content) for _ in range(1))
    seen = False
    for one in documents:
        if not one.has("stac_version"):
            continue
        seen = True
        if one["type"].text() in kinds:
            yield one
    if not seen:
        raise Location(path).error(
            "This is not a STAC file.", "Deliver an item, or a folder of items as one zip file."
        )


def _image(item: JsonValue) -> str:
    """The file of the image; the identifier of an item with several files, none of which is its data."""
    given = item["assets"].value if item.has("assets") else {}
    assets = [item["assets"][key] for key in given] if isinstance(given, dict) else []
    data = [one for one in assets if one.has("roles") and "data" in map(str, _listed(one["roles"]))]
    chosen = data[:1] or (assets if len(assets) == 1 else [])
    return file_of_uri(chosen[0]["href"].text()) if chosen else item["id"].text()


def _listed(value: JsonValue) -> list[object]:
    return [one.value for one in value.items()]


def _has_camera_id(said: JsonValue) -> bool:
    return said.has(_CAMERA) and said[_CAMERA].has("camera_id")


def _crs(said: JsonValue) -> str | None:
    if not said.has("pers:crs"):
        return None
    given = said["pers:crs"].value
    if isinstance(given, int) and not isinstance(given, bool):
        return f"EPSG:{given}"
    return known_crs(given if isinstance(given, str) else json.dumps(given)).to_wkt()


def _rotation(said: JsonValue) -> Floats:
    """Object from image; NaN where the item has neither matrix nor angles."""
    has_angles = all(said.has(key) for key in _ANGLES)
    degrees = np.array([said[key].number() for key in _ANGLES]) if has_angles else np.full(3, np.nan)
    if not said.has("pers:rotation_matrix"):
        return from_omega_phi_kappa(np.radians(degrees)[None])[0] if has_angles else np.full((3, 3), np.nan)
    matrix = np.array(said["pers:rotation_matrix"].numbers(9)).reshape(3, 3).T
    if has_angles:
        away = np.abs(from_omega_phi_kappa(np.radians(degrees)[None])[0] - matrix).max()
        if not away < np.radians(_SAME_DEG):
            raise Location(said.file, entity=said.where[-80:] or None).error(
                "pers:rotation_matrix is not the rotation of the stated angles.",
                "Deliver the items again: the matrix is image from object, row by row, angles are degrees.",
            )
    return matrix


def _camera(given: JsonValue, name: str) -> CameraRecord:
    columns, rows = given["sensor_array_dimensions"].numbers(2)
    across, along = given["pixel_spacing"].numbers(2)
    focal = given["focal_length"].number()
    whole = all(value.is_integer() and 0 < value <= MOST_PIXELS for value in (columns, rows))
    if not whole or across <= 0.0 or focal <= 0.0 or across != along:
        raise Location(given.file, entity=name).error(
            "Size, pixel or focal length are not those of a camera with square pixels.",
            "Declare the camera in the project file.",
        )
    for key in ("radial_distortion", "affine_distortion"):
        if given.has(key) and any(one.number() for one in given[key].items()):
            raise Location(given.file, entity=name).error(
                f"The camera has {key}, whose sign and unit the file does not say.",
                "Write the camera, with additional_parameters, into the project file.",
            )
    x0, y0 = given["principal_point_offset"].numbers(2)
    return CameraRecord(int(columns), int(rows), 1e3 * across, focal, (x0, y0))
