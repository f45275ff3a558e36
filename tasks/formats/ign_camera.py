"""IGN's camera file: an XML element ``sensor`` with the virtual, distortion-free image of a camera.

| element | meaning |
|---|---|
| ``name`` | name of the camera, as orientations call it |
| ``usefull-frame/rect/w, h`` | size of the image, px |
| ``pixel_size`` | side of a pixel, m |
| ``focal/pt3d/x, y`` | principal point, px from the top left corner, y downwards |
| ``focal/pt3d/z`` | principal distance, px |
| ``objectif`` | the lens; where it is a length (``123.9mm``), the principal distance must be near it |

Files of real cameras also have ``distortion`` (r3, r5, r7 about a point of symmetry) or ``doublegrid``, and a
``usefull-frame`` that begins within the sensor: they are refused, unless all of these are zero.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from tasks.errors import Location
from tasks.formats.records import CameraRecord
from tasks.formats.xml_text import parsed_xml
from tasks.magnitude import LARGEST, MOST_PIXELS, SMALLEST

_LENGTH = re.compile(r"(\d+(?:\.\d+)?)\s*mm", re.IGNORECASE)
# A lens is called by its nominal focal length, which the calibrated one keeps to some percent.
_LENS_TOLERANCE = 0.05


def read_ign_cameras(path: Path) -> dict[str, CameraRecord]:
    """Read the only camera of a file, by its name; raises the errors of `read_ign_camera`."""
    return {(parsed_xml(path).findtext("name") or "").strip(): read_ign_camera(path)}


def read_ign_camera(path: Path) -> CameraRecord:
    """Read a camera.

    Raises
    ------
    InputError
        If the file is not such an XML file, declares entities, or lacks a value.
    """
    root = parsed_xml(path)
    frame = "usefull-frame/rect"
    columns, rows = (_whole(root, f"{frame}/{name}", path) for name in "wh")
    pixel_m = _positive(root, "pixel_size", path, SMALLEST)
    x, y = (_number(root, f"focal/pt3d/{name}", path) for name in "xy")
    focal = _positive(root, "focal/pt3d/z", path)
    pixel_mm = pixel_m * 1e3
    _refuse_real_camera(root, path)
    _refuse_other_lens(root, focal * pixel_mm, path)
    return CameraRecord(
        columns=columns,
        rows=rows,
        pixel_um=round(pixel_m * 1e6, 9),
        focal_length_mm=round(focal * pixel_mm, 12),
        principal_point_mm=(
            round((x - 0.5 * columns) * pixel_mm, 12),
            round((0.5 * rows - y) * pixel_mm, 12),
        ),
    )


def _refuse_real_camera(root: ElementTree.Element, path: Path) -> None:
    """Refuse a camera that is not virtual: it has distortion, or its image is a part of the sensor."""
    terms = [f"distortion/{name}" for name in ("r3", "r5", "r7")]
    distorted = any(_number(root, name, path) for name in terms if root.find(name) is not None)
    if distorted or root.find("doublegrid") is not None:
        where = "distortion" if distorted else "doublegrid"
        raise Location(path).error(
            f"The camera has distortion (<{where}>), which is not read.",
            "Declare the camera in the project file, with cameras.NAME.additional_parameters.",
        )
    corner = [f"usefull-frame/rect/{name}" for name in "xy"]
    if any(_number(root, name, path) for name in corner if root.find(name) is not None):
        raise Location(path).error(
            "The usable frame does not begin at the corner of the sensor (<usefull-frame>).",
            "Declare the camera in the project file, with the principal point in its image.",
        )


def _refuse_other_lens(root: ElementTree.Element, focal_mm: float, path: Path) -> None:
    """Refuse an implausible lens: a wrong pixel size changes the principal distance without other signs."""
    stated = _LENGTH.fullmatch((root.findtext("objectif") or "").strip())
    if stated is None:
        return
    lens_mm = float(stated.group(1))
    if abs(focal_mm / lens_mm - 1.0) > _LENS_TOLERANCE:
        raise Location(path).error(
            f"The principal distance of {focal_mm:.6g} mm (<focal> times <pixel_size>) differs from that "
            f"of the lens, {lens_mm:g} mm (<objectif>).",
            "Correct <pixel_size>, which is in metres, or <focal>, which is in pixels.",
        )


def _whole(root: ElementTree.Element, name: str, path: Path) -> int:
    value = _positive(root, name, path)
    if not value.is_integer():
        raise Location(path).error(
            f"The value {value:g} of <{name}> is not a whole number of pixels.",
            "Deliver the camera file again.",
        )
    return int(value)


def _number(root: ElementTree.Element, name: str, path: Path) -> float:
    found = root.findall(name)
    if len(found) > 1:
        raise Location(path).error(
            f"The camera file has {len(found)} elements <{name}>, but must have only one.",
            "Deliver it with one.",
        )
    element = found[0] if found else None
    text = (element.text or "").strip() if element is not None else ""
    try:
        # Python takes 1_000 for a number, the parsers of other programs do not.
        value = math.nan if "_" in text else float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST:
        raise Location(path).error(
            f"The camera file lacks a number in <{name.replace('/', '><')}>.",
            "Deliver it again, or declare the values of the camera in the project file.",
        )
    return value


def _positive(root: ElementTree.Element, name: str, path: Path, least: float = 0.5) -> float:
    """A number not below a minimum (by default a pixel when rounded) and not above the pixels of an image."""
    value = _number(root, name, path)
    if not least < value <= MOST_PIXELS:
        raise Location(path).error(
            f"The value {value:g} of <{name}> cannot be.", "Deliver the camera file again."
        )
    return value
