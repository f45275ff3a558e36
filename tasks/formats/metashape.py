"""Metashape XML: cameras and orientations (Export Cameras), markers and their measurements (Export Markers).

| element | read |
|---|---|
| ``sensor/calibration`` (adjusted before initial), or a saved ``calibration`` on its own | f, cx, cy, distortion; in pixels, cx and cy from the middle of the image |
| ``camera/transform`` | camera (x right, y down, z forward) to chunk, row by row |
| ``sensor`` and ``camera`` with ``master_id`` | heads and events of a rig (``metashape_rigs``) |
| ``component/transform`` or ``chunk/transform`` | chunk to geocentric WGS 84: read as longitude, latitude, ellipsoidal height, angles against true north |
| without such a transform, or if it leads to a ``LOCAL_CS`` or into the earth | local coordinates |
| ``marker/reference`` | coordinates of a marker and their accuracies (sx, sy, sz; sxy; sxyz), in the CRS of the markers |
| ``marker/location`` with ``pinned="true"`` | a measurement, pixels from the corner; the others are computed |

Its P1 and P2 are p2 and p1 of ``brown-forward``; B1 and B2 are b1 and b2 times f. PhotoScan up to 1.2 had fx, fy, skew, cx and cy
from the corner, and P1 and P2 in the order of OpenCV (manual of Agisoft Lens; a published project: 0.4 px).

Metashape's OPK text: photo, X, Y, Z, ω, φ, κ in degrees and the rotation camera from ground, by tabs.

Coordinates and angles are of the CRS and the grid that the export was made in.
"""  # noqa: E501

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from array import array
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.formats.earth_poses import GEOGRAPHIC, geographic_poses
from tasks.formats.long_columns import LongPoints, LongRows, table_of
from tasks.formats.metashape_rigs import MetashapeRigs, transform_of
from tasks.formats.named_entries import ImagesByName
from tasks.formats.plain_records import (
    CV_AXES,
    LOCAL,
    degrees_of_rotations,
    number_of,
    numbers_of,
)
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.rigs import Rigs, with_rigs
from tasks.formats.text_lines import numbered_lines
from tasks.formats.xml_text import elements, parsed_xml

# Terms of older versions, which later ones have no more.
_UNREAD = ("p3", "p4", "skew")
_RADIAL = {"k1": "k1", "k2": "k2", "k3": "k3", "k4": "k4"}
_LENS = {**_RADIAL, "p1": "p2", "p2": "p1"}
# Of calibrations with fx.
_OLD_LENS = {**_RADIAL, "p1": "p1", "p2": "p2"}
_ACCURACIES = (("sx", "sxy", "sxyz"), ("sy", "sxy", "sxyz"), ("sz", "sxyz"))
_LOCAL = ("LOCAL_CS", "ENGCRS", "ENGINEERINGCRS")
# Metres from the middle of the earth: no camera is nearer.
_ON_EARTH = 6.3e6


def read_metashape_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the orientations of all aligned and enabled cameras.

    Raises
    ------
    InputError
        If there are none, numbers are missing, or some cameras are on the earth and some are not.
    """
    root = parsed_xml(path)
    sensors = _sensor_names(root)
    rigs = MetashapeRigs.of(path, root, sensors)
    placed = {
        item.get("id"): similarity
        for item in root.iter("component")
        if (similarity := _similarity(path, item.find("transform"))) is not None
    }
    of_chunk = _similarity(path, root.find(".//chunk/transform"))
    reference = (root.findtext(".//chunk/reference") or "").strip()
    rows, to_earth = LongRows("transform"), []
    for number, item in enumerate(root.iter("camera"), start=1):
        transform = item.findtext("transform")
        own = rigs.placed(item, number) if transform is None else transform_of(path, transform, number)
        if own is None or item.get("enabled") in ("false", "0") or "label" not in item.attrib:
            continue
        camera = sensors.get(item.get("sensor_id", ""))
        rows.append(item.attrib["label"], own.ravel(), text=camera, line=number)
        to_earth.append(placed.get(item.get("component_id"), of_chunk))
    image, matrix = rows.names, rows["transform"]
    scales = {1.0 if one is None else one[2] for one in to_earth}
    found = rigs.rigs(image, scales) if rigs.cameras else Rigs()
    # Its elements have been taken apart.
    root.clear()
    rotation, centre = matrix[:, :3, :3] @ CV_AXES, matrix[:, :3, 3]
    states = LOCAL
    earthly = [one for one in to_earth if one is not None]
    if earthly:
        if len(earthly) < len(to_earth):
            raise Location(path, entity=image[to_earth.index(None)]).error(
                "Some cameras are geocentric and some are in a local frame.",
                "Export one component of the chunk.",
            )
        turn = np.array([one[0] for one in earthly])
        rotation = turn @ rotation
        moved = np.array([one[2] for one in earthly])[:, None] * np.einsum("nij,nj->ni", turn, centre)
        centre = moved + np.array([one[1] for one in earthly])
        inside = not reference and np.linalg.norm(centre, axis=1).max() < _ON_EARTH
        if not (inside or reference.upper().startswith(_LOCAL)):
            degrees_of_rotations(path, rotation, image, rows.line)
            centre, rotation = geographic_poses(centre, rotation)
            states = GEOGRAPHIC
    records = rows.exposures(path, states, position=centre, rotation=rotation)
    if not (found.heads or found.remarks):
        return records
    return with_rigs(records, found, max(scales) * matrix[:, :3, 3], matrix[:, :3, :3])


def _similarity(path: Path, item: ElementTree.Element | None) -> tuple[Floats, Floats, float] | None:
    """Rotation, translation and scale of a transform; None if it has none of them."""
    texts = [None if item is None else item.findtext(name) for name in ("rotation", "translation", "scale")]
    if any(text is None for text in texts):
        return None
    rotation, translation, scale = (
        numbers_of(path, (text or "").split(), count, 1, "a transform to the earth")
        for text, count in zip(texts, (9, 3, 1), strict=True)
    )
    return np.array(rotation).reshape(3, 3), np.array(translation), scale[0]


def _sensor_names(root: ElementTree.Element) -> dict[str, str]:
    """Names of the sensors by their ids: their labels, with the id where two are alike."""
    labels = {item.get("id", ""): item.get("label") or "" for item in root.iter("sensor")}
    alike = Counter(labels.values())
    return {
        number: label if label and alike[label] == 1 else f"{label} {number}".strip()
        for number, label in labels.items()
    }


def read_metashape_cameras(path: Path) -> Mapping[str, CameraRecord | PixelCamera]:
    """Read the cameras by the labels of their sensors; a saved calibration by the name of its file.

    Raises
    ------
    InputError
        If there is none, or numbers are missing.
    """
    root = parsed_xml(path)
    if root.tag == "calibration":
        return {path.stem: _sensor(path, root, root, path.stem)}
    names = _sensor_names(root)
    found: dict[str, CameraRecord | PixelCamera] = {}
    for item in root.iter("sensor"):
        calibrations = item.findall("calibration")
        chosen = next((one for one in calibrations if one.get("class") == "adjusted"), None)
        chosen = chosen if chosen is not None else next(iter(calibrations), None)
        if chosen is not None:
            name = names[item.get("id", "")]
            found[name] = _sensor(path, item, chosen, name)
        # It has been taken apart.
        item.clear()
    if not found:
        raise Location(path).error(
            "There is no camera in the file.", "Export the cameras of an aligned chunk."
        )
    return found


def _sensor(
    path: Path, item: ElementTree.Element, calibration: ElementTree.Element, name: str
) -> CameraRecord | PixelCamera:
    kind = calibration.get("type") or item.get("type") or calibration.findtext("projection")
    if kind not in (None, "frame"):
        raise Location(path, entity=name).error(
            f"The camera is of the type '{kind}', but only frame cameras are supported.", "Leave it out."
        )
    size = calibration.find("resolution")
    size = item.find("resolution") if size is None else size
    columns, rows = (
        _whole(path, (calibration.findtext(key) or "") if size is None else size.get(key, ""), name)
        for key in ("width", "height")
    )
    f = number_of(path, calibration.findtext("f") or calibration.findtext("fy") or "", 1, f"f of {name}")
    if f <= 0.0:
        raise Location(path, entity=name).error(
            "The focal length is not positive.", "Export the cameras again."
        )
    given = {
        child.tag.lower(): number_of(path, child.text or "", 1, child.tag)
        for child in calibration
        if child.tag.lower() in (*_LENS, *_UNREAD, "cx", "cy", "b1", "b2", "fx")
    }
    old = "fx" in given
    shear = given.pop("skew", 0.0) if old else given.get("b2", 0.0)
    unread = [theirs for theirs in _UNREAD if given.get(theirs)]
    if unread:
        raise Location(path, entity=name).error(
            f"The calibration has {', '.join(unread)}, which is not read.",
            "Adjust the chunk without these terms, or declare the camera in the project file.",
        )
    middle = (0.5 * columns, 0.5 * rows) if old else (0.0, 0.0)
    values = {ours: given.get(theirs, 0.0) for theirs, ours in (_OLD_LENS if old else _LENS).items()}
    values["b1"] = given["fx"] / f - 1.0 if old else given.get("b1", 0.0) / f
    values["b2"] = shear / f
    distortion = {f"brown-forward:{key}": value for key, value in values.items() if value}
    cx, cy = (given.get(key, start) - start for key, start in zip(("cx", "cy"), middle, strict=True))
    camera = PixelCamera(columns, rows, f, (cx, 0.0 - cy), distortion)
    pixel = [one.get("value", "") for one in item.findall("property") if one.get("name") == "pixel_width"]
    return camera.with_pixel(1e3 * number_of(path, pixel[0], 1, "pixel_width")) if pixel else camera


def _whole(path: Path, text: str, name: str) -> int:
    value = number_of(path, text, 1, f"the size of the image of {name}")
    if not (value.is_integer() and value > 0):
        raise Location(path, entity=name).error(
            "The image has no whole number of pixels.", "Export it again."
        )
    return int(value)


def read_metashape_markers(path: Path) -> ControlRecords:
    """Read the markers that have coordinates.

    Raises
    ------
    InputError
        If there are none, or numbers are missing.
    """
    points = LongRows("position", "sigma")
    for number, item in enumerate(elements(path, "marker"), start=1):
        reference = item.find("reference")
        if reference is None or "label" not in item.attrib or "x" not in reference.attrib:
            continue
        values = [number_of(path, reference.get(axis, ""), number, f"its {axis}") for axis in "xyz"]
        sigma = []
        for keys in _ACCURACIES:
            stated = [
                number_of(path, reference.attrib[key], number, key) for key in keys if key in reference.attrib
            ]
            sigma.append(stated[0] if stated else np.nan)
        # A marker that is switched off in the reference pane is a check point there.
        role = "check" if reference.get("enabled") in ("false", "0") else "control"
        points.append(item.attrib["label"], values, sigma, text=role, line=number)
    return points.control(path)


def read_metashape_measurements(path: Path) -> ImagePointRecords:
    """Read the measurements of markers in images (pixel_origin = "corner").

    Raises
    ------
    InputError
        If there are none, numbers are missing, or a camera or marker is not in the file.
    """
    root = parsed_xml(path)
    markers = {item.get("id"): item.get("label") for item in root.iter("marker") if "label" in item.attrib}
    cameras = {item.get("id"): item.get("label") for item in root.iter("camera") if "label" in item.attrib}
    points, images, number = LongPoints(), ImagesByName(path), 0
    for item in root.iter("camera"):
        if item.get("enabled") not in ("false", "0") and "label" in item.attrib:
            images.named(item.attrib["label"], item.get("id"))
    for item in root.iter("marker"):
        for location in item.findall("location"):
            number += 1
            if location.get("pinned") not in ("true", "1"):
                continue
            name, seen_in = markers.get(item.get("marker_id")), cameras.get(location.get("camera_id"))
            if name is None or seen_in is None:
                raise Location(path, entity=f"camera {location.get('camera_id')}").error(
                    "A measurement refers to a marker or camera that is not in the file.",
                    "Export the markers with the cameras of the chunk.",
                )
            image = images.named(seen_in, location.get("camera_id"))
            xy = [number_of(path, location.get(axis, ""), number, f"its {axis}") for axis in "xy"]
            points.append(image, name, xy, number)
    return points.records(path)


# Both are printed with six decimals and more.
_SAME_DEG = 1e-3
# Elements of rotations that are compared together: all at once take more memory than the file.
_TOGETHER = 9 * 10_000


def read_metashape_opk(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read orientations.

    Raises
    ------
    InputError
        With file and line: fields missing, angles that are not those of the rotation next to them.
    """
    rows, rotations = LongRows("position", "angles"), array("d")
    for number, line in numbered_lines(path):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        fields = line.split("\t") if "\t" in line else line.split()
        found = numbers_of(path, fields[1:], 15, number, "X, Y, Z, ω, φ, κ and nine elements")
        rows.append(fields[0].strip(), found[:3], found[3:6], line=number)
        rotations.extend(found[6:])
        if len(rotations) == _TOGETHER:
            _refuse_other_angles(path, rotations, rows)
            rotations = array("d")
    _refuse_other_angles(path, rotations, rows)
    return rows.exposures(path, FileStatement(order="omega-phi-kappa"), unit="deg")


def _refuse_other_angles(path: Path, rotations: array[float], rows: LongRows) -> None:
    """Compare the last rows with the rotations beside them."""
    first = len(rows.names) - len(rotations) // 9
    rotation = table_of(rotations, 9).reshape(-1, 3, 3).transpose(0, 2, 1)
    angles = degrees_of_rotations(path, rotation, rows.names[first:], rows.line[first:])
    away = np.abs((angles - rows["angles"][first:] + 180.0) % 360.0 - 180.0).max(axis=1, initial=0.0)
    if (away > _SAME_DEG).any():
        row = int(np.argmax(away))
        raise Location(path, rows.line[first + row], rows.names[first + row]).error(
            f"Omega, phi, kappa differ by {away[row]:.3g}° from the rotation next to them.",
            "Export the orientations again, as OPK.",
        )
