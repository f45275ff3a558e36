"""Units of image points: conversion, and whether the declared one can be right.

A wrong unit is a factor of 1,000 or an origin in the corner instead of the middle, which shows in the range
of the coordinates against the format.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from tasks.formats.records import ImagePointRecords
from tasks.importing.source_rows import Places

Unit = Literal["px", "mm", "um"]
_UNITS: tuple[Unit, ...] = ("px", "mm", "um")
_NAMES = {"px": "px (column, row)", "mm": "mm", "um": "µm"}
# A measurement on the border of the image may stand a pixel outside it.
_MARGIN_PX = 1.0
# If all points lie within this part of the half format, the unit is too large by orders of magnitude.
_TINY = 0.01
# From this number of points on, all in one quarter of the image is no accident.
_MANY = 50


def in_millimetres(
    xy: Floats, unit: Unit, cameras: Sequence[FrameCamera], camera: NDArray[np.int64]
) -> Floats:
    """Image coordinates (n, 2) in mm of coordinates in `unit`; `camera` (n,) is the camera of each row."""
    if unit == "mm":
        return xy
    if unit == "um":
        return xy * 1e-3
    result = np.empty_like(xy)
    for number, model in enumerate(cameras):
        rows = camera == number
        if rows.any():
            result[rows] = model.image_from_pixel(xy[rows]) * 1e3
    return result


def _over_format(
    xy: Floats, unit: Unit, cameras: Sequence[FrameCamera], camera: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Position in the image as a part of the half format (n, 2), and whether it lies inside (n,)."""
    half = np.array([model.half_format for model in cameras])[camera] * 1e3
    margin = _MARGIN_PX * np.array([model.pixel_size for model in cameras])[camera][:, None] * 1e3
    millimetres = in_millimetres(xy, unit, cameras, camera)
    return millimetres / half, np.asarray((np.abs(millimetres) <= half + margin).all(axis=1))


def refuse_wrong_unit(
    records: ImagePointRecords,
    unit: Unit,
    cameras: Sequence[FrameCamera],
    camera: NDArray[np.int64],
    places: Places,
) -> str | None:
    """Raise if the coordinates cannot be in the declared unit; return a sentence if they hardly can.

    Raises
    ------
    InputError
        Naming the first point outside the image and the unit in which all would lie inside.
    """
    part, inside = _over_format(records.xy, unit, cameras, camera)
    fitting = _fitting_unit(records.xy, unit, cameras, camera)
    hint = ""
    if fitting is not None:
        hint = f'In {_NAMES[fitting]} they would fit: declare unit = "{fitting}" if that is it.'
    outside = ~inside
    if outside.any():
        row = int(np.argmax(outside))
        x, y = records.xy[row]
        raise places.error(
            row,
            f"The image point ({x:.10g}, {y:.10g}) {unit} in image '{records.image[row]}' lies outside "
            f"the image ({int(outside.sum()):,} of {len(outside):,} points do).",
            hint or "Check the unit and the camera; delete the point if it is a mistake.",
            str(records.point[row]),
        )
    if len(part) > 1 and np.abs(part).max() < _TINY:
        row = int(np.argmax(np.abs(part).max(axis=1)))
        raise places.error(
            row,
            f"All {len(part):,} image points lie within {100 * _TINY:g} % of the image about its centre.",
            hint or "Check the unit.",
            str(records.point[row]),
        )
    one_quarter = (part > 0.0).all(axis=0) | (part < 0.0).all(axis=0)
    if len(part) >= _MANY and one_quarter.all():
        return (
            f"{records.file.name}: all {len(part):,} image points lie in one quarter of the image. "
            f"{hint or 'Check the unit and the origin of the coordinates.'}"
        )
    return None


def _fitting_unit(
    xy: Floats, declared: Unit, cameras: Sequence[FrameCamera], camera: NDArray[np.int64]
) -> Unit | None:
    """Another unit in which all points lie inside the image and are spread over it."""
    for unit in _UNITS:
        if unit == declared:
            continue
        part, inside = _over_format(xy, unit, cameras, camera)
        if inside.all() and np.ptp(part, axis=0).max() > 0.1:
            return unit
    return None
