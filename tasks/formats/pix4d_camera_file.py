"""Pix4Dmapper's camera file, ``…_calibrated_internal_camera_parameters.cam`` of its parameter folder.

Cameras begin with ``camera_calibration_file N``. Of each are read: size of the sensor (mm, in the comment
above ``FOCAL``) and of the image (``#Image size``), ``FOCAL`` (mm), the principal point from the middle of
the image, and distortion. The principal point is there three times: in mm for Inpho (x along columns, y
against rows), in mm and in pixels with x reversed. Distortion is that of the file next to it,
``…_calibrated_camera_parameters.txt``: forward, of coordinates divided by the focal length, here with powers
of that in it:

    SYM_DIST K0 K1 K2 K3:  k_i = K_i f^(2i+1)        DEC_DIST p1 p2 p3:  p_i = p_i' f²

(seen in a published project of Pix4D, all five to nine digits). Its sibling ``…_pix4d_calibrated_…`` does not
state the size of the image in pixels.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from tasks.errors import Location
from tasks.formats.plain_records import numbers_of
from tasks.formats.records import CameraRecord
from tasks.formats.text_lines import numbered_lines

_BEGIN = re.compile(r"camera_calibration_file\s+(\S+)\s*")
_SENSOR = re.compile(r"#\s*Focal Length.*sensor width of\s*(\S+?)x(\S+?)\s*mm\s*")
# Some versions print the numbers of pixels with twenty decimals.
_IMAGE = re.compile(r"#\s*Image size\s*(\d{1,6})(?:\.0*)?x(\d{1,6})(?:\.0*)?\s*pixel\s*", re.ASCII)
_OFFSET = re.compile(r"#\s*Principal Point Offset xpoff ypoff in (mm \(Inpho\)|mm|pixel)\s*")
_NUMBERS = {"FOCAL": 1, "SYM_DIST": 4, "DEC_DIST": 3}
_SIBLING = "Pix4D camera calibration file"
_CUT = "The file may have been cut off: deliver it again."
# Sizes and offsets are printed with twenty digits.
_SAME, _SAME_MM = 1e-6, 1e-6
# Nothing that is read is as long.
_LONGEST = 500


@dataclass
class _Camera:
    """What the lines of one camera say.

    Attributes
    ----------
    line : its first.
    offsets : principal point by its unit, as x and y are read.
    numbers : of each key.
    """

    line: int
    sensor: list[float] = field(default_factory=list)
    image: list[float] = field(default_factory=list)
    offsets: dict[str, list[float]] = field(default_factory=dict)
    numbers: dict[str, list[float]] = field(default_factory=dict)


def read_pix4d_camera_file(path: Path) -> Mapping[str, CameraRecord]:
    """Read the cameras by their numbers.

    Raises
    ------
    InputError
        With file and line: another file, numbers missing, pixels that are not square, principal points that
        contradict each other, distortion of another kind.
    """
    said = dict(_said(path))
    if not said:
        raise Location(path).error(
            "No line begins with 'camera_calibration_file'.",
            "Check that this is …_calibrated_internal_camera_parameters.cam.",
        )
    return {name: _record(path, camera) for name, camera in said.items()}


def _said(path: Path) -> Iterator[tuple[str, _Camera]]:
    camera, unit = None, ""
    names = set()
    for number, text in numbered_lines(path):
        line = text if len(text) < _LONGEST else ""
        if line.startswith(_SIBLING):
            raise Location(path, number).error(
                "This camera file does not state the size of the image in pixels.",
                "Deliver the file without '_pix4d' in its name, or …_calibrated_camera_parameters.txt.",
            )
        if found := _BEGIN.fullmatch(line):
            if found[1] in names:
                raise Location(path, number).error(
                    f"The camera {found[1]} exists twice.", "Keep one of them."
                )
            names.add(found[1])
            camera, unit = _Camera(number), ""
            yield found[1], camera
        elif camera is None:
            continue
        elif found := _SENSOR.fullmatch(line):
            camera.sensor = numbers_of(path, found.groups(), 2, number, "width and height of the sensor")
        elif found := _IMAGE.fullmatch(line):
            camera.image = numbers_of(path, found.groups(), 2, number, "width and height of the image")
        elif found := _OFFSET.fullmatch(line):
            unit = found[1]
            camera.offsets[unit] = []
        else:
            _keyed(path, number, line.split(), camera, unit)


def _keyed(path: Path, number: int, words: list[str], camera: _Camera, unit: str) -> None:
    """A line that begins with a key."""
    if not words:
        return
    if words[0] in ("XPOFF", "YPOFF") and unit:
        camera.offsets[unit] += numbers_of(path, words[1:], 1, number, "an offset of the principal point")
    elif words[0] in _NUMBERS:
        count = _NUMBERS[words[0]]
        camera.numbers[words[0]] = numbers_of(path, words[1:], count, number, f"{count} behind {words[0]}")


def _record(path: Path, camera: _Camera) -> CameraRecord:
    offsets = [camera.offsets.get(unit, []) for unit in ("mm (Inpho)", "mm", "pixel")]
    if not (camera.sensor and camera.image and camera.numbers.keys() == _NUMBERS.keys()) or any(
        len(offset) != 2 for offset in offsets
    ):
        raise Location(path, camera.line).error(
            "The camera lacks at least one of: size of sensor and image, FOCAL, SYM_DIST, DEC_DIST, "
            "three offsets of the principal point.",
            _CUT,
        )
    (focal,), radial, tangential = (camera.numbers[key] for key in _NUMBERS)
    pixels = [side / count if count else 0.0 for side, count in zip(camera.sensor, camera.image, strict=True)]
    if not (min(pixels) > 0.0 and focal > 0.0 and abs(pixels[1] / pixels[0] - 1.0) < _SAME):
        raise Location(path, camera.line).error(
            "Sensor and image do not have square pixels, or the focal length is not positive.",
            "Declare the camera in the project file.",
        )
    inpho, reversed_x, in_pixels = offsets
    in_mm = [pixels[0] * value for value in in_pixels]
    points = [inpho, [-reversed_x[0], reversed_x[1]], [-in_mm[0], in_mm[1]]]
    if any(abs(a - b) > _SAME_MM for one, other in pairwise(points) for a, b in zip(one, other, strict=True)):
        raise Location(path, camera.line).error(
            "The three offsets of the principal point (mm for Inpho, mm, pixels) are not the same point.",
            "Use …_calibrated_camera_parameters.txt, or declare the camera in the project file.",
        )
    if radial[0] or tangential[2]:
        raise Location(path, camera.line).error(
            "K0 or p3 is not zero, but Pix4D's distortion has neither.", "Check where the file comes from."
        )
    values = {f"k{i}": radial[i] * focal ** (2 * i + 1) for i in (1, 2, 3)}
    values |= {f"p{i}": tangential[i - 1] * focal**2 for i in (1, 2)}
    distortion = {f"brown-forward:{key}": value for key, value in values.items() if value}
    columns, rows = map(int, camera.image)
    return CameraRecord(columns, rows, 1e3 * pixels[0], focal, (inpho[0], inpho[1]), distortion)
