"""Units of image points: conversion, and whether the declared one can be right.

A wrong unit is a factor of 1,000 or an origin in the corner instead of the middle, which shows in the range
of the coordinates against the format. A few points outside it are mismatches; more of them are an error,
whatever the reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from adjust.arrays import Bools, Floats
from adjust.camera.interior import FrameCamera
from tasks.errors import InputError
from tasks.files.in_turn import in_turn
from tasks.formats.records import ImagePointRecords

Unit = Literal["px", "mm", "um", "centred-px", "longer-side"]
_UNITS: tuple[Unit, ...] = ("px", "mm", "um", "centred-px", "longer-side")
_NAMES = {
    "px": "px (column, row)",
    "mm": "mm",
    "um": "µm",
    "centred-px": "pixels from the middle of the image (centred-px)",
    "longer-side": "fractions of the longer side of the image (longer-side)",
}
# Points that are looked at together, and how many of such blocks at a time.
_BLOCK, _THREADS = 250_000, 2
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
    """The image points of a file compared with the image format.

    Attributes
    ----------
    inside : (n,) whether they lie in their image; the others are to be left out.
    remarks : sentences for the user.
    """

    inside: Bools
    remarks: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """Points with the cameras that may have taken them.

    Attributes
    ----------
    xy : (n, 2) as they are in the file.
    cameras : of the project.
    camera_of_code : number of the camera, by code of the image.
    code : (n,) of the image of each point.
    """

    xy: Floats
    cameras: Sequence[FrameCamera]
    camera_of_code: NDArray[np.int64]
    code: NDArray[np.int32]

    def over_format(self, unit: Unit) -> Iterator[tuple[slice, Floats, Bools]]:
        """Block by block: position in the image as a part of the half format (m, 2), whether inside (m,)."""
        half = np.array([model.half_format for model in self.cameras]) * 1e3
        margin = _MARGIN_PX * np.array([model.pixel_size for model in self.cameras])[:, None] * 1e3

        def compared(begin: int) -> tuple[slice, Floats, Bools]:
            rows = slice(begin, begin + _BLOCK)
            camera = self.camera_of_code[self.code[rows]]
            # One camera needs no look-up for each point.
            which = camera if len(self.cameras) > 1 else slice(0, 1)
            millimetres = in_millimetres(self.xy[rows], unit, self.cameras, camera)
            inside = np.abs(millimetres) <= (half + margin)[which]
            return rows, millimetres / half[which], inside[:, 0] & inside[:, 1]

        return in_turn(compared, range(0, len(self.xy), _BLOCK), _THREADS)


@dataclass(frozen=True, slots=True)
class _Extent:
    """Where the points inside the format lie.

    Attributes
    ----------
    inside : (n,) whether each lies inside.
    least, most : of their positions along x and y, as parts of the half format.
    quarters : how many lie in each quarter of the image.
    """

    inside: Bools
    least: Floats
    most: Floats
    quarters: NDArray[np.int64]

    @classmethod
    def of(cls, points: _Measured, unit: Unit) -> _Extent:
        """The extent of points whose coordinates are in this unit."""
        every = np.empty(len(points.xy), dtype=bool)
        least, most, quarters = np.full(2, np.inf), np.full(2, -np.inf), np.zeros(4, dtype=np.int64)
        for rows, part, inside in points.over_format(unit):
            every[rows] = inside
            own = part if inside.all() else part[inside]
            for axis in range(2 if len(own) else 0):
                least[axis] = min(least[axis], own[:, axis].min())
                most[axis] = max(most[axis], own[:, axis].max())
            right, upper = own[:, 0] > 0.0, own[:, 1] > 0.0
            quarters += [np.count_nonzero(x & y) for x in (right, ~right) for y in (upper, ~upper)]
        return cls(every, least, most, quarters)

    @property
    def count(self) -> int:
        """Number of points inside."""
        return int(self.quarters.sum())

    @property
    def outside_share(self) -> float:
        """Share of the points that lie outside."""
        return 1.0 - self.count / len(self.inside)

    @property
    def is_spread(self) -> bool:
        """Whether they cover a tenth of the half format, and many of them more than one quarter of it."""
        if not (self.most - self.least).max() > 0.1:
            return False
        return self.count < _MANY or bool(self.quarters.max() <= _MOST * self.count)


def in_millimetres(
    xy: Floats, unit: Unit, cameras: Sequence[FrameCamera], camera: NDArray[np.int64]
) -> Floats:
    """Image coordinates (n, 2) in mm of coordinates in `unit`; `camera` (n,) is the camera of each row."""
    if unit != "px":
        return np.asarray(xy * unit_mm(unit, cameras)[camera][:, None])
    if len(cameras) == 1:
        return np.asarray(cameras[0].image_from_pixel(xy) * 1e3)
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


def in_format(
    records: ImagePointRecords,
    unit: Unit,
    cameras: Sequence[FrameCamera],
    camera_of_code: NDArray[np.int64],
    outside_share: float,
) -> InFormat:
    """Which points lie in their image; more than a share of them outside are an error.

    Parameters
    ----------
    camera_of_code : number of the camera, by code of the image in `records`.

    Raises
    ------
    InputError
        Naming the first point outside the image, and a unit in which fewer would lie outside.
    """
    points = _Measured(records.xy, cameras, camera_of_code, records.image.indices.to_numpy())
    extent = _Extent.of(points, unit)
    remarks = (
        () if extent.count == len(records.xy) else (_outside(records, unit, points, extent, outside_share),)
    )
    suspicion = _unlikely_unit(records, unit, points, extent)
    return InFormat(extent.inside, remarks if suspicion is None else (*remarks, suspicion))


def _outside(
    records: ImagePointRecords, unit: Unit, points: _Measured, extent: _Extent, outside_share: float
) -> str:
    """A sentence about the points outside the format.

    Raises
    ------
    InputError
        If they are more than the share.
    """
    row, rows = int(np.argmin(extent.inside)), len(extent.inside)
    count = rows - extent.count
    of_all = f"{count:,} of {rows:,} points"
    if count > outside_share * rows:
        x, y = records.xy[row]
        allowed = f", {100 * outside_share:g} % are allowed" if outside_share > 0.0 else ""
        hint = _hint(points, unit, extent.outside_share)
        raise InputError(
            f"The image point ({x:.10g}, {y:.10g}) {unit} in image '{records.image[row]}' lies outside "
            f"the image ({of_all} do{allowed}).",
            hint or "Check the camera, its size and the unit; delete wrong points.",
            file=records.file,
            line=int(records.line[row]),
            entity=str(records.point[row]),
            declare=_declared(hint),
        )
    return (
        f"{records.file.name}: {of_all} lie outside their image and are ignored; the first is "
        f"'{records.point[row]}' in '{records.image[row]}' (line {records.line[row]})."
    )


def _unlikely_unit(records: ImagePointRecords, unit: Unit, points: _Measured, extent: _Extent) -> str | None:
    """Raise if all points lie about the centre of the image; a sentence if all lie in one quarter."""
    if extent.count > 1 and max(extent.most.max(), -extent.least.min()) < _TINY:
        hint = _hint(points, unit, extent.outside_share)
        raise InputError(
            f"All {extent.count:,} image points lie within {100 * _TINY:g} % of the image about its centre.",
            hint or "Check the unit.",
            file=records.file,
            line=int(records.line[0]),
            entity=str(records.point[0]),
            declare=_declared(hint),
        )
    one_quarter = (extent.least > 0.0) | (extent.most < 0.0)
    if extent.count >= _MANY and one_quarter.all():
        hint = _hint(points, unit, extent.outside_share)
        return (
            f"{records.file.name}: all {extent.count:,} image points lie in one quarter of the image. "
            f"{hint or 'Check the unit and the origin of the coordinates.'}"
        )
    return None


def _declared(hint: str) -> str | None:
    """The line of the project file in a hint."""
    found = _LINE.search(hint)
    return None if found is None else found[0]


def _hint(points: _Measured, declared: Unit, outside_share: float) -> str:
    """Another unit in which the points fit better: fewer outside, most inside, spread over the image."""
    best, least = "", max(outside_share, 1e-12)
    for unit in _UNITS:
        if unit == declared:
            continue
        extent = _Extent.of(points, unit)
        share = extent.outside_share
        if share < min(least, 0.5) and extent.is_spread:
            what = "they would fit" if share == 0.0 else f"{100 * (1.0 - share):.3g} % of them would fit"
            best = f'In {_NAMES[unit]} {what}: declare unit = "{unit}" if that is correct.'
            least = share
    if best:
        return best
    exchanged = _Extent.of(replace(points, xy=points.xy[:, ::-1]), declared)
    if exchanged.count == len(points.xy) and exchanged.is_spread:
        return f"x and y look swapped: {_EXCHANGED} exchanges them."
    return best
