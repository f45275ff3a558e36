"""Units of image points: conversion, and whether the declared one can be right.

A wrong unit is a factor of 1,000 or an origin in the corner instead of the middle, which shows in the range
of the coordinates against the format. A few points outside it are mismatches; more of them are an error,
whatever the reason.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from tasks.deliveries.source_rows import Places
from tasks.formats.records import ImagePointRecords

Unit = Literal["px", "mm", "um", "centred-px", "longer-side"]
_UNITS: tuple[Unit, ...] = ("px", "mm", "um", "centred-px", "longer-side")
_NAMES = {
    "px": "px (column, row)",
    "mm": "mm",
    "um": "µm",
    "centred-px": "pixels from the middle of the image (centred-px)",
    "longer-side": "parts of the longer side of the image (longer-side)",
}
# A measurement on the border of the image may stand a pixel outside it.
_MARGIN_PX = 1.0
# If all points lie within this part of the half format, the unit is too large by orders of magnitude.
_TINY = 0.01
# From this number of points on, all in one quarter of the image is no accident.
_MANY = 50
# So large a part of them in one quarter speaks against a unit.
_MOST = 0.9
_EXCHANGED = 'columns = { x = "y", y = "x" }'
_LINE = re.compile(f'unit = "[a-z-]+"|{re.escape(_EXCHANGED)}')


@dataclass(frozen=True, slots=True, eq=False)
class InFormat:
    """What the format says about the image points of a file.

    Attributes
    ----------
    inside : (n,) whether they lie in their image; the others are to be left out.
    remarks : sentences for the user.
    """

    inside: NDArray[np.bool_]
    remarks: tuple[str, ...]


def in_millimetres(
    xy: Floats, unit: Unit, cameras: Sequence[FrameCamera], camera: NDArray[np.int64]
) -> Floats:
    """Image coordinates (n, 2) in mm of coordinates in `unit`; `camera` (n,) is the camera of each row."""
    if unit != "px":
        return np.asarray(xy * unit_mm(unit, cameras)[camera][:, None])
    result = np.empty_like(xy)
    for number, model in enumerate(cameras):
        rows = camera == number
        if rows.any():
            result[rows] = model.image_from_pixel(xy[rows]) * 1e3
    return result


def unit_mm(unit: Unit, cameras: Sequence[FrameCamera]) -> Floats:
    """Length of the unit in the image of each camera (cameras,), mm."""
    if unit in ("mm", "um"):
        return np.full(len(cameras), 1.0 if unit == "mm" else 1e-3)
    sides = [max(model.columns, model.rows) if unit == "longer-side" else 1 for model in cameras]
    return np.array([side * model.pixel_size * 1e3 for side, model in zip(sides, cameras, strict=True)])


def _over_format(
    xy: Floats, unit: Unit, cameras: Sequence[FrameCamera], camera: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Position in the image as a part of the half format (n, 2), and whether it lies inside (n,)."""
    half = np.array([model.half_format for model in cameras])[camera] * 1e3
    margin = _MARGIN_PX * np.array([model.pixel_size for model in cameras])[camera][:, None] * 1e3
    millimetres = in_millimetres(xy, unit, cameras, camera)
    return millimetres / half, np.asarray((np.abs(millimetres) <= half + margin).all(axis=1))


def in_format(
    records: ImagePointRecords,
    unit: Unit,
    cameras: Sequence[FrameCamera],
    camera: NDArray[np.int64],
    places: Places,
    outside_share: float,
) -> InFormat:
    """Which points lie in their image; more than a share of them outside are an error.

    Raises
    ------
    InputError
        Naming the first point outside the image, and a unit in which fewer would lie outside.
    """
    part, inside = _over_format(records.xy, unit, cameras, camera)
    outside = ~inside
    hint = _hint(records.xy, unit, cameras, camera, float(outside.mean()))
    row = int(np.argmax(outside))
    x, y = records.xy[row]
    count = f"{int(outside.sum()):,} of {len(outside):,} points"
    if outside.sum() > outside_share * len(outside):
        allowed = f", {100 * outside_share:g} % are allowed" if outside_share > 0.0 else ""
        error = places.error(
            row,
            f"The image point ({x:.10g}, {y:.10g}) {unit} in image '{records.image[row]}' lies outside "
            f"the image ({count} do{allowed}).",
            hint or "Check the camera, its size and the unit; delete points that are mistakes.",
            str(records.point[row]),
        )
        raise replace(error, declare=_declared(hint))
    remarks = []
    if outside.any():
        remarks.append(
            f"{records.file.name}: {count} lie outside their image and are left out; the first is "
            f"'{records.point[row]}' in '{records.image[row]}' (line {places.line[row]})."
        )
    suspicion = _unlikely_unit(records, part[inside], places, hint)
    return InFormat(inside, tuple(remarks) if suspicion is None else (*remarks, suspicion))


def _unlikely_unit(records: ImagePointRecords, part: Floats, places: Places, hint: str) -> str | None:
    """Raise if all points lie about the centre of the image; a sentence if all lie in one quarter."""
    if len(part) > 1 and np.abs(part).max() < _TINY:
        error = places.error(
            0,
            f"All {len(part):,} image points lie within {100 * _TINY:g} % of the image about its centre.",
            hint or "Check the unit.",
            str(records.point[0]),
        )
        raise replace(error, declare=_declared(hint))
    one_quarter = (part > 0.0).all(axis=0) | (part < 0.0).all(axis=0)
    if len(part) >= _MANY and one_quarter.all():
        return (
            f"{records.file.name}: all {len(part):,} image points lie in one quarter of the image. "
            f"{hint or 'Check the unit and the origin of the coordinates.'}"
        )
    return None


def _declared(hint: str) -> str | None:
    """The line of the project file in a hint."""
    found = _LINE.search(hint)
    return None if found is None else found[0]


def _hint(
    xy: Floats,
    declared: Unit,
    cameras: Sequence[FrameCamera],
    camera: NDArray[np.int64],
    outside_share: float,
) -> str:
    """Another unit in which the points fit better: fewer outside, most inside, spread over the image."""
    best, least = "", max(outside_share, 1e-12)
    for unit in _UNITS:
        part, inside = _over_format(xy, unit, cameras, camera)
        share = 1.0 - float(inside.mean())
        if unit != declared and share < min(least, 0.5) and _spread(part[inside]):
            what = "they would fit" if share == 0.0 else f"{100 * (1.0 - share):.3g} % of them would fit"
            best = f'In {_NAMES[unit]} {what}: declare unit = "{unit}" if that is it.'
            least = share
    if best:
        return best
    part, inside = _over_format(xy[:, ::-1], declared, cameras, camera)
    if inside.all() and _spread(part):
        return f"x and y look swapped: {_EXCHANGED} reads the one as the other."
    return best


def _spread(part: Floats) -> bool:
    """Whether points cover a tenth of the half format, and many of them more than one quarter of it."""
    if np.ptp(part, axis=0).max() <= 0.1:
        return False
    quarter = np.bincount(2 * (part[:, 0] > 0.0) + (part[:, 1] > 0.0), minlength=4)
    return len(part) < _MANY or bool(quarter.max() <= _MOST * len(part))
