"""Inpho project (``.prj``): cameras, photos with orientations and measured points, control points.

| block | read |
|---|---|
| ``$CAMERA`` (named by ``$TYPE``), ``$CAMERA_DEFINITION`` | focal length, principal point (mm), size, pixels per mm; distortion only if it is zero |
| ``$PHOTO`` | name, camera, ``$EXT_ORI``: c, X0, Y0, Z0 and the rotation camera from ground, row by row |
| ``$PHOTO_POINTS`` of a photo | id, column, row: pixels, the centre of the first is 0, 0 |
| ``$CONTROL_POINTS`` | id, X, Y, Z |

Rotations are read as ω, φ, κ in degrees. ``$COORDINATE_SYSTEM`` is compared with the declared CRS where it is
well-known text. What is not named here, and would count, is said with the orientations.
"""  # noqa: E501

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tasks.errors import Location
from tasks.formats.crs_definition import WELL_KNOWN
from tasks.formats.long_columns import LongPoints, LongRows
from tasks.formats.named_entries import NotTaken, take_camera
from tasks.formats.plain_records import numbers_of
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
)
from tasks.formats.text_lines import numbered_lines
from tasks.plain_text import quoted

_KEY = re.compile(r"\s*\$(\w+)\s*:(.*)$")
_BLOCK = re.compile(r"\s*\$(\w+)\b(.*)$")
_BLANK = re.compile(r"(?<!\\)\s+")
# Lines of control points that are in memory together.
_TOGETHER = 10_000
_CAMERAS = ("CAMERA", "CAMERA_DEFINITION")
_CALIBRATION = "CALIBRATION_SET"
_SYSTEMS = ("PROJECT", "COORDINATE_SYSTEM_SET")
_READ = (*_SYSTEMS, "PHOTO", "CONTROL_POINTS", *_CAMERAS)
# What would count if it is on, or not zero.
_SWITCHES = ("CURV_CORR_DEFAULT", "REFRACT_CORR_DEFAULT")
_UNITS = {"LINEAR_UNITS_OF_OBJECT": "m", "LINEAR_UNITS_OF_IMAGE": "mm", "ANGULAR_UNITS": "deg"}
# A pixel outside of the image: measurements end at its edge.
_FIRST_PIXEL = -1.5
# Of the shorter side of the image.
_MOST_OFF_CENTRE = 0.05
_MOUNTING = ("GPS_ANTENNA_OFFSET", "CAMERA_MOUNT_ROTATION", "INS_BORESIGHT_ALIGNMENT")


@dataclass
class _Block:
    """A block: its own keys with the lines of their values, and lines without any key."""

    name: str
    line: int
    values: dict[str, list[tuple[int, list[str]]]] = field(default_factory=dict)
    inner: list[_Block] = field(default_factory=list)

    def words(self, key: str) -> list[str]:
        """All words of a key."""
        return [word for _, words in self.values.get(key, []) for word in words]

    def numbers(self, path: Path, key: str, count: int, what: str) -> list[float]:
        """The first numbers of a key."""
        found = self.values.get(key)
        if not found:
            raise Location(path, self.line).error(
                f"The block ${self.name} lacks ${key}.", "Deliver the project again."
            )
        return numbers_of(path, self.words(key), count, found[0][0], what)

    def name_of(self, path: Path, *keys: str) -> str:
        """Its name, from the first of these keys that it has."""
        for key in keys:
            if self.words(key):
                return " ".join(self.words(key))
        raise Location(path, self.line).error(
            f"The block ${self.name} lacks ${keys[0]}.", "Deliver the project again."
        )


def _blocks(path: Path) -> Iterator[_Block]:
    stack: list[_Block] = []
    key = ""
    for number, line in numbered_lines(path):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        value, opened = (_KEY.match(line), _BLOCK.match(line)) if "$" in line else (None, None)
        if value is not None and stack:
            key = value.group(1).upper()
            text = value.group(2).strip()
            # A camera has one name: another one begins the next of its calibrations.
            again = key == "ID" and stack[-1].name in _CAMERAS and key in stack[-1].values
            if again or (key == _CALIBRATION and not text):
                stack.append(_Block(_CALIBRATION, number))
            if key == _CALIBRATION and not text:
                continue
            stack[-1].values.setdefault(key, [])
        elif opened is not None and value is None:
            name, key = opened.group(1).upper(), ""
            closed = _close(stack, _kept(stack, name, outmost=not line[0].isspace()))
            if closed is not None:
                yield closed
            if not name.startswith("END"):
                stack.append(_Block(name, number))
            continue
        if stack and text:
            words = text.split()
            if "\\" in text:
                words = [word.replace("\\ ", " ") for word in _BLANK.split(text)]
            rows = stack[-1].values.setdefault(key, [])
            rows.append((number, words))
            if len(rows) >= _TOGETHER and len(stack) == 1 and stack[0].name == "CONTROL_POINTS":
                yield _Block("CONTROL_POINTS", number, {key: rows})
                stack[0].values = {}
    if stack:
        raise Location(path, stack[0].line).error(
            f"The block ${stack[0].name} does not end.", "The file may have been cut off: deliver it again."
        )


def _kept(stack: list[_Block], name: str, *, outmost: bool) -> int:
    """How many blocks are still open after a line ``$NAME``; outmost: it begins in the first column."""
    if name == "END" or not name.startswith("END"):
        # What begins in the first column ends what is open, and $END within a block a part of it at most.
        inside = max(1, len(stack) - 1) if name == "END" else len(stack)
        return 0 if outmost else min(inside, len(stack))
    of = name.removeprefix("END").removeprefix("_")
    # END_COORDINATE_SYSTEM ends COORDINATE_SYSTEM_SET, END_POINTS CONTROL_POINTS; others end lists.
    ends = bool(stack) and (stack[-1].name.startswith(of) or stack[-1].name.endswith(of))
    return len(stack) - ends


def _close(stack: list[_Block], keep: int) -> _Block | None:
    """Close all open blocks but so many; the outmost one, if it is among them."""
    while len(stack) > keep:
        closed = stack.pop()
        if not stack:
            return closed
        stack[-1].inner.append(closed)
    return None


def read_inpho_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the photos that have an exterior orientation.

    Raises
    ------
    InputError
        With file and line: no photos, numbers missing, a rotation that is none.
    """
    photos, crs, rest = LongRows("position", "rotation"), None, NotTaken()
    for block in _blocks(path):
        rest.add(_not_taken(block))
        if block.name in _SYSTEMS:
            crs = _well_known_text(block) or crs
        if block.name != "PHOTO" or "EXT_ORI" not in block.values:
            continue
        # The first words may be time and date of the orientation, in the line of the key itself.
        rows = [entry for entry in block.values["EXT_ORI"] if not re.match(r"\d+:\d+|\d+/", entry[1][0])]
        words = [word for _, row in rows for word in row]
        values = numbers_of(path, words, 13, block.line, "c, X0, Y0, Z0 and nine elements of a rotation")
        name = block.name_of(path, "PHOTO_NUM", "ID", "PHOTO_FILE")
        camera = " ".join(block.words("CAMERA_ID")) or None
        photos.append(name, values[1:4], values[4:], text=camera, line=block.line)
    ground_from_camera = np.swapaxes(photos["rotation"], 1, 2)
    states = FileStatement(crs=crs, order="omega-phi-kappa")
    return photos.exposures(path, states, remarks=rest.remarks(path), rotation=ground_from_camera)


def _not_taken(block: _Block) -> Iterator[str]:
    """What of a block no reader here takes over."""
    if block.name not in _READ:
        yield f"${block.name}"
    elif block.name == "PROJECT":
        yield from (f"${key} : on" for key in _SWITCHES if block.words(key) == ["on"])
        words = ((key, " ".join(block.words(key)), usual) for key, usual in _UNITS.items())
        yield from (f"${key} : {unit}" for key, unit, usual in words if unit not in ("", usual))
    elif block.name == "PHOTO":
        yield from () if "EXT_ORI" in block.values else ("$PHOTO without $EXT_ORI",)
        yield from ("$FIDUCIALS",) if "FIDUCIALS" in block.values else ()
    elif block.name in _CAMERAS:
        of_camera = _calibrated(block)
        yield from (f"${key}" for key in _MOUNTING if any(map(_is_given, of_camera.words(key))))


def _is_given(number: str) -> bool:
    return bool(number.strip("+-0."))


def _well_known_text(block: _Block) -> str | None:
    text = " ".join(block.words("COORDINATE_SYSTEM"))
    # Of a set of several it is not known which one counts.
    only = len(block.values.get("ID", [])) < 2
    return text if only and text.startswith(WELL_KNOWN) else None


def read_inpho_image_points(path: Path) -> ImagePointRecords:
    """Read the measured points of all photos, in pixels (pixel_origin = "centre").

    Raises
    ------
    InputError
        With file and line: no points, numbers missing, points that are not pixels.
    """
    points = LongPoints()
    for block in _blocks(path):
        if block.name != "PHOTO":
            continue
        rows = block.values.get("PHOTO_POINTS", [])
        name = block.name_of(path, "PHOTO_NUM", "ID", "PHOTO_FILE") if rows else ""
        for number, words in rows:
            points.append(name, words[0], numbers_of(path, words[1:], 2, number, "column and row"), number)
    found = points.records(path)
    outside = np.flatnonzero((found.xy < _FIRST_PIXEL).any(axis=1))
    if len(outside):
        x, y = found.xy[outside[0]]
        raise Location(path, int(found.line[outside[0]])).error(
            f"The points are not pixels from the first one on: here is one at ({x:g}, {y:g}).",
            "Points of scanned film are in mm from the middle: export them as PATB, and declare the unit.",
        )
    return found


def read_inpho_control(path: Path) -> ControlRecords:
    """Read control points.

    Raises
    ------
    InputError
        With file and line: no points, numbers missing.
    """
    points, crs, rest = LongRows("position"), None, NotTaken()
    for block in _blocks(path):
        if block.name in _SYSTEMS:
            crs = _well_known_text(block) or crs
        if block.name != "CONTROL_POINTS":
            continue
        for one in block.inner:
            rest.add(f"${key}" for key in one.values if key not in ("ID", "POSITION"))
            name = one.name_of(path, "ID")
            points.append(name, one.numbers(path, "POSITION", 3, "X, Y, Z"), line=one.line)
        for number, words in block.values.get("", []):
            points.append(words[0], numbers_of(path, words[1:], 3, number, "X, Y, Z"), line=number)
            rest.add(f"type {text}" for text in words[4:5])
    return points.control(path, FileStatement(crs=crs), rest.remarks(path))


def read_inpho_cameras(path: Path) -> Mapping[str, CameraRecord]:
    """Read the cameras by their names.

    Raises
    ------
    InputError
        With file and line: no camera, numbers missing, distortion, a camera turned against its image.
    """
    found: dict[str, CameraRecord] = {}
    for block in _blocks(path):
        if block.name in _CAMERAS:
            name = block.name_of(path, "ID", "CAMERA_ID", "TYPE")
            take_camera(path, found, name, _camera(path, _calibrated(block)))
    if not found:
        raise Location(path).error("There is no camera in the file.", "Declare it in the project file.")
    return found


def _calibrated(block: _Block) -> _Block:
    """The camera with the values of its active calibration."""
    sets = [one for one in block.inner if one.name == _CALIBRATION]
    active = block.words("ACTIVE_CALIBRATION")
    chosen = next((one for one in sets if one.words("ID") == active), sets[-1] if sets else None)
    if chosen is None:
        return block
    return _Block(block.name, block.line, {**chosen.values, **block.values})


def _camera(path: Path, block: _Block) -> CameraRecord:
    (c,) = block.numbers(path, "FOCAL_LENGTH", 1, "the focal length")
    x0, y0 = block.numbers(path, "PRINCIPAL_POINT_PPA", 2, "the principal point")
    (columns,) = block.numbers(path, "CCD_COLUMNS", 1, "the number of columns")
    (rows,) = block.numbers(path, "CCD_ROWS", 1, "the number of rows")
    to_pixel = block.numbers(path, "CCD_INTERIOR_ORIENTATION", 6, "the six numbers from mm to pixels")
    a, b, column, d, e, row = to_pixel
    side = 0.5 * (a - e)
    # Of the sides of a pixel, and of the middle: what no reader notices, and what no swapped image has.
    straight = a > 0.0 and abs(b) + abs(d) <= 1e-9 * a and abs(a + e) * max(columns, rows) <= 0.1 * a
    off = (column - 0.5 * (columns - 1), 0.5 * (rows - 1) - row)
    centred = max(map(abs, off)) <= _MOST_OFF_CENTRE * min(columns, rows)
    if not (straight and centred and columns.is_integer() and rows.is_integer()):
        raise Location(path, block.line).error(
            "The interior orientation of this camera is not x right, y up from the middle of the image with "
            "square pixels.",
            "Declare the camera in the project file, with the rotation of its images.",
        )
    _refuse_distortion(path, block)
    # The interior orientation may count from elsewhere than the middle: that is a principal point, too.
    point = (round(x0 + off[0] / side, 9), round(y0 + off[1] / side, 9))
    return CameraRecord(int(columns), int(rows), round(1e3 / side, 9), c, point)


def _refuse_distortion(path: Path, block: _Block) -> None:
    kind = " ".join(block.words("DISTORTION_TYPE"))
    if kind.lower() not in ("", "none", "polynomial"):
        raise Location(path, block.line).error(
            f"The camera has distortion of the type {quoted(kind)}, which is not read.",
            "Declare the camera in the project file, with cameras.NAME.additional_parameters.",
        )
    for key in ("RADIAL_COEFFS", "DECENTRE_COEFFS"):
        for number, words in block.values.get(key, []):
            if any(numbers_of(path, words, len(words), number, "a coefficient")):
                raise Location(path, number).error(
                    f"The camera has distortion (${key}), but the file does not state its direction.",
                    "Declare the camera in the project file, with cameras.NAME.additional_parameters.",
                )
