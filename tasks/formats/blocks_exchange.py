"""BlocksExchange XML (iTwin Capture, ContextCapture; also written by Metashape, Pix4D, RealityScan).

| element | read |
|---|---|
| ``Photogroup`` | size, focal length, principal point, distortion; its name is that of the camera |
| ``Photo/Pose`` | centre, rotation (nine elements world → camera, or ω, φ, κ) in the axes of ``CameraOrientation`` |
| ``ControlPoint`` | position, category (horizontal or vertical points lack a coordinate), check point |
| ``Measurement`` | of control and tie points: pixels, the centre of the first is 0, 0 |
| ``SRSId`` | of a point, else of all points; of a group, else of the block |
| ``SRS/Definition`` | ``ENU:latitude,longitude``: read as longitude, latitude, height; ``EPSG:…``: compared; none: local |

Its P1, P2 are p2, p1 of ``brown-forward``. Photos without a complete pose are left out.
"""  # noqa: E501

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path, PureWindowsPath

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import Location
from tasks.formats.crs_definition import WELL_KNOWN
from tasks.formats.earth_poses import GEOGRAPHIC, geocentric_poses, geographic_poses
from tasks.formats.long_columns import LongPoints, LongRows
from tasks.formats.named_entries import ImagesByName, take_camera
from tasks.formats.plain_records import number_of
from tasks.formats.records import (
    AngleOrder,
    ControlRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.xml_text import parsed_xml
from tasks.plain_text import quoted

_ENU = re.compile(r"ENU:\s*(-?\d+(?:\.\d+)?)\s*,\s*(-?\d+(?:\.\d+)?)$")
_LENS = {"K1": "k1", "K2": "k2", "K3": "k3", "P1": "p2", "P2": "p1"}
#: Of a photo group, what its camera is.
_OF_CAMERA = frozenset(
    ["ImageDimensions", "FocalLength", "FocalLengthPixels", "SensorSize", "PrincipalPoint", "Distortion"]
)
#: In our axes, x right and y up.
_RIGHT, _UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
_AXES = {"Right": _RIGHT, "Left": -_RIGHT, "Up": _UP, "Down": -_UP}
_ORIENTATION = re.compile(r"X(Right|Left|Up|Down)Y(Right|Left|Up|Down)$")


def read_blocks_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the photos with a pose.

    Raises
    ------
    InputError
        If there are none, numbers are missing, or the reference system is none that is read.
    """
    root = parsed_xml(path)
    _require_one_camera_a_name(path, root)
    rows = LongRows("position", "rotation")
    of_block, systems = root.findtext(".//Block/SRSId"), set()
    for number, (name, group, photo) in enumerate(_photos(path, root), start=1):
        pose = photo.find("Pose")
        point, turn = (None, None) if pose is None else (pose.find("Center"), pose.find("Rotation"))
        if point is None or turn is None or len(turn) == 0:
            continue
        systems.add(group.findtext("SRSId") or of_block)
        centre = [_number(path, point, axis) for axis in "xyz"]
        rotation = _world_from_camera(path, turn) @ _camera_from_ours(path, group)
        rows.append(name, centre, rotation.ravel(), text=group.findtext("Name"), line=number)
    crs, place = _reference(path, root, _one_of("Photos", path, systems))
    # Its elements have been taken apart.
    root.clear()
    if place is None:
        return rows.exposures(path, FileStatement(crs=crs, order="omega-phi-kappa"))
    centres, rotations = geocentric_poses((*place, 0.0), rows["position"], rows["rotation"])
    centres, rotations = geographic_poses(centres, rotations)
    return rows.exposures(path, GEOGRAPHIC, position=centres, rotation=rotations)


def read_blocks_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the cameras by the names of their photo groups.

    Raises
    ------
    InputError
        If there is none, numbers are missing, or one is not a perspective camera.
    """
    found: dict[str, PixelCamera] = {}
    for group in parsed_xml(path).iter("Photogroup"):
        name = group.findtext("Name") or "Photogroup"
        if (group.findtext("CameraModelType") or "Perspective") != "Perspective":
            raise Location(path, entity=name).error("Only perspective cameras are read.", "Leave it out.")
        size = _child(path, group, "ImageDimensions")
        columns, rows = _number(path, size, "Width"), _number(path, size, "Height")
        longer = max(columns, rows)
        if group.find("FocalLengthPixels") is not None:
            c = _number(path, group, "FocalLengthPixels")
        else:
            c = _number(path, group, "FocalLength") * longer / _number(path, group, "SensorSize")
        lens = group.find("Distortion")
        _refuse_other_distortion(path, name, lens)
        given = {
            ours: _number(path, lens, key)
            for key, ours in _LENS.items()
            if lens is not None and lens.find(key) is not None
        }
        aspect = _number(path, group, "AspectRatio") if group.find("AspectRatio") is not None else 1.0
        skew = _number(path, group, "Skew") if group.find("Skew") is not None else 0.0
        if not (columns.is_integer() and rows.is_integer() and c > 0.0) or aspect != 1.0 or skew != 0.0:
            raise Location(path, entity=name).error(
                "The camera has a fractional number of pixels, a focal length that is not positive, or "
                "pixels that are not square.",
                "Declare the camera in the project file.",
            )
        point = group.find("PrincipalPoint")
        offset = (0.0, 0.0)
        if point is not None:
            offset = (
                _number(path, point, "x") - 0.5 * (columns - 1),
                0.5 * (rows - 1) - _number(path, point, "y"),
            )
        known = {f"brown-forward:{key}": value for key, value in given.items() if value}
        take_camera(path, found, name, PixelCamera(int(columns), int(rows), c, offset, known))
    if not found:
        raise Location(path).error("There is no camera in the file.", "Export the photo groups.")
    return found


def _require_one_camera_a_name(path: Path, root: ElementTree.Element) -> None:
    """Refuse groups of one name with different cameras, which a camera of the project would replace."""
    cameras: dict[str, list[str]] = {}
    for group in root.iter("Photogroup"):
        stated = sorted(_stated(part) for part in group if part.tag in _OF_CAMERA)
        take_camera(path, cameras, group.findtext("Name") or "Photogroup", stated)


def _stated(part: ElementTree.Element) -> str:
    """What an element states, whatever the order of its parts and the digits of its numbers."""
    text = (part.text or "").strip()
    # A text that is no number states something else than any number.
    with suppress(ValueError):
        text = repr(float(text))
    return f"{part.tag} {text} ({', '.join(sorted(map(_stated, part)))})"


def _refuse_other_distortion(path: Path, name: str, lens: ElementTree.Element | None) -> None:
    """Refuse terms that are not read, unless they are zero."""
    others = [child.tag for child in lens if child.tag not in _LENS] if lens is not None else []
    if any(_number(path, lens, tag) for tag in others):
        raise Location(path, entity=name).error(
            f"The distortion has {', '.join(others)}; {', '.join(_LENS)} are read.",
            "Declare the camera in the project file.",
        )


def read_blocks_control(path: Path) -> ControlRecords:
    """Read control and check points.

    Raises
    ------
    InputError
        If there are none, numbers are missing, or they are in several reference systems.
    """
    root = parsed_xml(path)
    rows = LongRows("position", "sigma")
    of_list = root.findtext(".//ControlPoints/SRSId") or root.findtext(".//Block/SRSId")
    systems = set()
    for number, item in enumerate(root.iter("ControlPoint"), start=1):
        category = item.findtext("Category") or "Full"
        place = _child(path, item, "Position")
        wanted = {"Horizontal": "xy", "Vertical": "xyz"}.get(category, "xyz")
        values = [
            _number(path, place, axis) if place.find(axis) is not None or axis in wanted else np.nan
            for axis in "xyz"
        ]
        # A vertical point has a place in plan that was not surveyed.
        nan = float("nan")
        values = {"Horizontal": [values[0], values[1], nan], "Vertical": [nan, nan, values[2]]}.get(
            category, values
        )
        accuracy = [item.findtext(key) for key in ("HorizontalAccuracy", "VerticalAccuracy")]
        plan, height = (
            nan if text is None else number_of(path, text, number, "an accuracy") for text in accuracy
        )
        is_check = (item.findtext("CheckPoint") or "").strip().lower() in ("true", "1")
        role = "check" if is_check else "control"
        rows.append(item.findtext("Name") or "", values, (plan, plan, height), text=role, line=number)
        systems.add(item.findtext("SRSId") or of_list)
    crs, local_place = _reference(path, root, _one_of("Control points", path, systems))
    if local_place is None:
        return rows.control(path, FileStatement(crs=crs))
    given = rows["position"]
    if np.isnan(given).any():
        raise Location(path, entity=rows.names[int(np.argmax(np.isnan(given).any(axis=1)))]).error(
            "Points with incomplete coordinates cannot be read in a local east, north, up system.",
            "Export them in a map projection.",
        )
    turn = np.broadcast_to(np.eye(3), (len(given), 3, 3))
    geographic, _ = geographic_poses(*geocentric_poses((*local_place, 0.0), given, turn))
    states = FileStatement(crs=GEOGRAPHIC.crs, heights="ellipsoidal")
    return rows.control(path, states, position=geographic)


def read_blocks_image_points(path: Path) -> ImagePointRecords:
    """Read measurements of control points and tie points (pixel_origin = "centre").

    Tie points have no names: they are called tie1, tie2, … in the order of the file.

    Raises
    ------
    InputError
        If there are none, numbers are missing, or a photo is not in the file.
    """
    root = parsed_xml(path)
    elsewhere = root.findtext(".//TiePoints/Path")
    if elsewhere:
        raise Location(path).error(
            f"The tie points are in another file, {quoted(elsewhere)}.",
            "Replace <Path> by the <TiePoint> elements of that file, or export the block with them.",
        )
    images, photos = ImagesByName(path), dict[str | None, str]()
    for name, _, photo in _photos(path, root):
        number = photo.findtext("Id")
        photos[number] = images.named(name, number)
    points = LongPoints()
    named = ((item.findtext("Name") or "", item) for item in root.iter("ControlPoint"))
    ties = ((f"tie{k}", item) for k, item in enumerate(root.iter("TiePoint"), start=1))
    for name, item in chain(named, ties):
        for measurement in item.findall("Measurement"):
            number = measurement.findtext("PhotoId")
            if number not in photos:
                raise Location(path, entity=name).error(
                    f"A measurement is in the photo {number}, which is not in the file.",
                    "Export all photos of the block.",
                )
            points.append(photos[number], name, [_number(path, measurement, axis) for axis in "xy"])
    return points.records(path)


def _photos(
    path: Path, root: ElementTree.Element
) -> Iterator[tuple[str, ElementTree.Element, ElementTree.Element]]:
    """File name, group and element of every photo."""
    for group in root.iter("Photogroup"):
        for photo in group.findall("Photo"):
            name = PureWindowsPath(photo.findtext("ImagePath") or "").name
            if not name:
                raise Location(path).error("A photo has no ImagePath.", "Export the block again.")
            yield name, group, photo


def _world_from_camera(path: Path, turn: ElementTree.Element) -> Floats:
    if turn.find("M_00") is not None:
        rows = [[_number(path, turn, f"M_{i}{j}") for j in range(3)] for i in range(3)]
        return np.array(rows).T
    if turn.find("Omega") is None:
        raise Location(path).error(
            "Rotations are given as heading, pitch and roll, whose convention is not published.",
            "Export them as a matrix, or as omega, phi, kappa.",
        )
    angles = [np.radians(_number(path, turn, name)) for name in ("Omega", "Phi", "Kappa")]
    return from_omega_phi_kappa(np.array(angles))


def _camera_from_ours(path: Path, group: ElementTree.Element) -> Floats:
    """Axes of the group from ours, x right, y up, z back."""
    name = group.findtext("CameraOrientation") or "XRightYDown"
    found = _ORIENTATION.match(name.strip())
    if found is None or np.dot(_AXES[found.group(1)], _AXES[found.group(2)]) != 0.0:
        raise Location(path).error(
            f"The camera orientation '{name}' does not exist.", "Export the block again."
        )
    x, y = _AXES[found.group(1)], _AXES[found.group(2)]
    return np.array([x, y, np.cross(x, y)])


def _one_of(what: str, path: Path, systems: set[str | None]) -> str | None:
    """The id of the reference system of all of them."""
    if len(systems) > 1:
        raise Location(path).error(f"{what} are in several reference systems.", "Export them in one.")
    return next(iter(systems), None)


def _reference(
    path: Path, root: ElementTree.Element, number: str | None
) -> tuple[str | None, tuple[float, float] | None]:
    """The CRS, or latitude and longitude of the origin of a frame east, north, up."""
    text = None
    for system in root.iter("SRS"):
        if system.findtext("Id") == number:
            text = (system.findtext("Definition") or "").strip()
    if not text:
        return "local", None
    place = _ENU.match(text)
    if place is not None:
        return None, (float(place.group(1)), float(place.group(2)))
    if text.upper().startswith("EPSG:") or text.startswith(("+proj=", *WELL_KNOWN)):
        return text, None
    raise Location(path).error(
        f"The reference system '{text[:40]}' is not supported.", "Export the block in an EPSG system."
    )


def _child(path: Path, item: ElementTree.Element, name: str) -> ElementTree.Element:
    found = item.find(name)
    if found is None:
        raise Location(path).error(f"An element <{item.tag}> lacks <{name}>.", "Export the block again.")
    return found


def _number(path: Path, item: ElementTree.Element | None, name: str) -> float:
    text = None if item is None else item.findtext(name)
    return number_of(path, (text or "").strip(), 1, f"<{name}>")
