"""OSSIM's camera file, a list of keywords (``.kwl``), as it lies beside POSEO text of Applanix DSS.

| keyword | read |
|---|---|
| ``sensor`` | name of the camera |
| ``focal_length``, ``principal_point`` | mm; from the middle of the image, x right, y up |
| ``image_size`` | columns, rows |
| ``pixel_size`` | mm; one number, or two that are the same |
| ``d0``, ``d1``, … | radius (mm) and radial distortion there |
| ``distortion_units`` | ``millimeters`` or ``microns`` |

Signs and directions are those of OSSIM (ossimApplanixUtmModel, ossimMeanRadialLensDistortion): a measured
point is reduced by the principal point, and the distortion at its radius is subtracted: K = −(polynomial r³,
r⁵, r⁷ through the table). A table that is no such polynomial to 0.1 µm has a misprint, and is refused with
its line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np

from adjust.arrays import Floats
from tasks.errors import InputError
from tasks.formats.plain_records import numbers_of
from tasks.formats.records import CameraRecord
from tasks.formats.text_lines import numbered_lines
from tasks.magnitude import MOST_PIXELS

_LINE = re.compile(r"\s*([A-Za-z_]\w*)\s*:\s*(.*?)\s*")
_DISTORTION = re.compile(r"d\d+", re.ASCII)
_COUNTS = {"focal_length": 1, "principal_point": 2, "image_size": 2, "pixel_size": 1}
_MM = {"millimeters": 1.0, "microns": 1e-3}
_POWERS = np.array([3, 5, 7])
# One row more than coefficients shows a misprint, two more show where it is.
_FEWEST = len(_POWERS) + 2
_LARGEST_MISFIT_MM = 1e-4
# Nothing that is read has longer lines, or more.
_LONGEST, _MOST = 500, 1_000


def read_ossim_camera(path: Path) -> Mapping[str, CameraRecord]:
    """Read the camera.

    Raises
    ------
    InputError
        With file and line: another file, keywords missing or twice, pixels that are not square, a distortion
        that contradicts itself.
    """
    said = _said(path)
    lacking = [key for key in ("sensor", *_COUNTS) if key not in said]
    if lacking:
        _refuse(path, None, f"The list of keywords lacks {', '.join(lacking)}.", "Deliver the camera's file.")
    (focal,), (x0, y0), size, pitch = (
        numbers_of(path, said[key][1].split(), count, said[key][0], key) for key, count in _COUNTS.items()
    )
    sides = said["pixel_size"][1].split()
    if focal <= 0.0 or pitch[0] <= 0.0 or set(sides[1:]) - {sides[0]}:
        _refuse(
            path,
            said["pixel_size"][0],
            "Pixels are not square, or the focal length is not positive.",
            "Declare the camera in the project file.",
        )
    if not all(value.is_integer() and 0.0 < value <= MOST_PIXELS for value in size):
        _refuse(
            path, said["image_size"][0], "The size of the image is not a number of pixels.", "Correct it."
        )
    return {
        said["sensor"][1]: CameraRecord(
            int(size[0]), int(size[1]), 1e3 * pitch[0], focal, (x0, y0), _distortion(path, said)
        )
    }


def _said(path: Path) -> dict[str, tuple[int, str]]:
    """Line and value of every keyword; comments begin with two slashes."""
    found: dict[str, tuple[int, str]] = {}
    for number, text in numbered_lines(path):
        line = text.partition("//")[0][:_LONGEST].strip()
        if not line:
            continue
        parts = _LINE.fullmatch(line)
        if parts is None:
            _refuse(
                path, number, "This is not a keyword with a value.", "Check that this is a file of OSSIM."
            )
        if parts[1] in found:
            _refuse(path, number, f"The keyword {parts[1]} exists twice.", "Keep one of the two.")
        found[parts[1]] = (number, parts[2])
        if len(found) > _MOST:
            _refuse(path, number, f"There are more than {_MOST:,} keywords.", "Deliver the camera's file.")
    return found


def _distortion(path: Path, said: Mapping[str, tuple[int, str]]) -> dict[str, float]:
    keys = sorted((key for key in said if _DISTORTION.fullmatch(key)), key=lambda key: int(key[1:]))
    if not keys:
        return {}
    unit = said.get("distortion_units", (0, ""))[1]
    if unit not in _MM:
        _refuse(
            path,
            said.get("distortion_units", (None, ""))[0],
            "The unit of the distortion is not stated.",
            "Add the line distortion_units: microns, or millimeters.",
        )
    lines = [said[key][0] for key in keys]
    table = np.array(
        [
            numbers_of(path, said[key][1].split(), 2, line, "radius (mm) and distortion")
            for key, line in zip(keys, lines, strict=True)
        ]
    )
    behind = np.flatnonzero(np.diff(table[:, 0], prepend=-1.0) <= 0.0)
    if len(behind):
        row = int(behind[0])
        _refuse(
            path,
            lines[row],
            f"The radius {table[row, 0]:g} mm of {keys[row]} is not larger than that of the line before.",
            "Correct the radius.",
        )
    if len(keys) < _FEWEST:
        _refuse(
            path, lines[-1], f"The distortion has {len(keys)} rows, and {_FEWEST} are needed.", "Deliver all."
        )
    radius, value = table[:, 0], table[:, 1] * _MM[unit]
    coefficients, misfit = _fitted(radius, value)
    if misfit > _LARGEST_MISFIT_MM:
        _refuse_misprint(path, lines, radius, value, misfit)
    return {
        f"brown_mm:K{k}": -float(coefficient) for k, coefficient in enumerate(coefficients, 1) if coefficient
    }


def _fitted(radius: Floats, value: Floats) -> tuple[Floats, float]:
    """Coefficients (3,) per mmⁿ of the polynomial through a table (n,), and its largest misfit, mm."""
    # Of the largest radius, so that the columns are alike.
    longest = radius[-1]
    columns = (radius[:, None] / longest) ** _POWERS
    found = np.linalg.lstsq(columns, value, rcond=None)[0]
    return found / longest**_POWERS, float(np.abs(columns @ found - value).max())


def _refuse_misprint(path: Path, lines: list[int], radius: Floats, value: Floats, misfit: float) -> NoReturn:
    """Raise, naming the row without which all others fit one polynomial."""
    without = [_fitted(np.delete(radius, row), np.delete(value, row)) for row in range(len(radius))]
    row = int(np.argmin([left for _, left in without]))
    coefficients, left = without[row]
    if left > _LARGEST_MISFIT_MM:
        _refuse(
            path,
            None,
            f"The distortion is not a polynomial of r³, r⁵, r⁷: it is off by {1e3 * misfit:.3g} µm.",
            "Write the camera, with a parameter set that has this distortion, into the project file.",
        )
    expected = float(radius[row] ** _POWERS @ coefficients)
    _refuse(
        path,
        lines[row],
        f"The distortion at {radius[row]:g} mm is {1e3 * value[row]:.3f} µm, where all others together have "
        f"{1e3 * expected:.3f} µm.",
        "Correct the misprint.",
    )


def _refuse(path: Path, line: int | None, what: str, remedy: str) -> NoReturn:
    raise InputError(what, remedy, path, line)
