"""Tables of text: without any declaration UTF-8, a header line, comma, decimal point, columns in any order.

| file | columns |
|---|---|
| image points | image, point, x, y [, sx, sy] |
| exposures | image, camera, strip, x, y, z, omega, phi, kappa (or heading, pitch, roll) [, time, flight, event, sx, sy, sz, somega, sphi, skappa (or sheading, spitch, sroll), rate_roll, rate_pitch, rate_yaw] |
| control | point, x, y, z [, sx, sy, sz, role]; an empty coordinate is not known |
| distances | point, other_point, distance [, sigma, role] |
| events | image, time [, camera, strip, flight] |
| cameras | camera, columns, rows, pixel_um, focal_length_mm, x0_mm, y0_mm [, width_mm, height_mm] |

Images of the heads of a rig that belong to one event may have its name in `event`. `head` is another heading of
`camera`. The three angles of an exposure may be left empty together: it has no attitude then; likewise its position.

Names are text and are kept verbatim. Headings may have upper case and be written as others do (``sigma_x``,
``std x``); one that is nearly one of these columns is an error. Further columns are kept as text and
reported.

Tables of others are read as they stand where their layout is declared (`tasks.formats.table_layout`): separator,
decimal comma, headings of the columns, values of columns that are missing.
"""  # noqa: E501

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.formats.calendar_time import seconds_of_date
from tasks.formats.csv_table import read_table
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    ImagePointRecords,
)
from tasks.formats.table_layout import TableLayout
from tasks.formats.text_table import TextTable
from tasks.formats.trajectory_records import Count, EventRecords
from tasks.magnitude import MOST_PIXELS

_XYZ = ("x", "y", "z")
_SIGMA_XYZ = ("sx", "sy", "sz")
_RATES = ("rate_roll", "rate_pitch", "rate_yaw")
_OURS = TableLayout()
_SIZE, _LENGTHS = ("columns", "rows"), ("pixel_um", "focal_length_mm")
# More than any block has.
_MOST_CAMERAS = 100_000
_DISTORTION = re.compile(r"[kpb]_?\d", re.IGNORECASE)
_PRINCIPAL_POINT, _CERTIFIED = ("x0_mm", "y0_mm"), ("width_mm", "height_mm")


def read_csv_image_points(path: Path, layout: TableLayout = _OURS) -> ImagePointRecords:
    """Read image points.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    table, extra = read_table(
        path, ("image", "point", "x", "y"), ("sx", "sy"), ("x", "y", "sx", "sy"), layout
    )
    return ImagePointRecords(
        file=path,
        image=table.names("image"),
        point=table.names("point"),
        xy=table.numbers(("x", "y")),
        sigma=table.numbers(("sx", "sy"), may_be_empty=True),
        line=table.line,
        extra=extra,
    )


def read_csv_exposures(path: Path, order: AngleOrder, layout: TableLayout = _OURS) -> ExposureRecords:
    """Read exposures whose angles are ω, φ, κ or heading, pitch, roll.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns; some of angles or coordinates.
    """
    angles = ("heading", "pitch", "roll") if order == "heading-pitch-roll" else ("omega", "phi", "kappa")
    sigmas = tuple(f"s{name}" for name in angles)
    required = ("image", "camera", "strip", *_XYZ, *angles)
    optional = ("time", "flight", "event", *_SIGMA_XYZ, *sigmas, *_RATES)
    numeric = (*_XYZ, *angles, "time", *_SIGMA_XYZ, *sigmas, *_RATES)
    table, extra = read_table(path, required, optional, numeric, layout)
    return ExposureRecords(
        file=path,
        image=table.text("image"),
        camera=table.text("camera") if table.has("camera") else pa.nulls(len(table), pa.string()),
        strip=_optional_text(table, "strip"),
        flight=_optional_text(table, "flight"),
        time_s=table.numbers(("time",), may_be_empty=True)[:, 0],
        position=table.all_or_none(_XYZ),
        angles=table.all_or_none(angles),
        sigma_position=table.numbers(_SIGMA_XYZ, may_be_empty=True),
        sigma_angles=table.numbers(sigmas, may_be_empty=True),
        line=table.line,
        rates=table.all_or_none(_RATES),
        event=table.text("event", may_be_empty=True) if table.has("event") else None,
        extra=extra,
    )


def read_csv_control(path: Path, layout: TableLayout = _OURS) -> ControlRecords:
    """Read control and check points.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    table, extra = read_table(path, ("point", *_XYZ), (*_SIGMA_XYZ, "role"), (*_XYZ, *_SIGMA_XYZ), layout)
    return ControlRecords(
        file=path,
        point=table.text("point"),
        position=table.numbers(_XYZ, may_be_empty=True),
        sigma=table.numbers(_SIGMA_XYZ, may_be_empty=True),
        role=_optional_text(table, "role"),
        line=table.line,
        extra=extra,
    )


def read_csv_distances(path: Path) -> DistanceRecords:
    """Read distances between object points.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns.
    """
    numeric = ("distance", "sigma")
    table, extra = read_table(path, ("point", "other_point", "distance"), ("sigma", "role"), numeric, _OURS)
    return DistanceRecords(
        file=path,
        point=table.text("point"),
        other_point=table.text("other_point"),
        distance=table.numbers(("distance",))[:, 0],
        sigma=table.numbers(("sigma",), may_be_empty=True)[:, 0],
        role=_optional_text(table, "role"),
        line=table.line,
        extra=extra,
    )


def read_csv_events(path: Path, count: Count, layout: TableLayout = _OURS) -> EventRecords:
    """Read times of exposures, in seconds or as dates with a time.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns; a text that is not a date.
    """
    numeric = () if count == "date" else ("time",)
    table, extra = read_table(path, ("image", "time"), ("camera", "strip", "flight"), numeric, layout)
    if count == "date":
        texts = table.text("time").to_pylist()
        time = np.array(
            [seconds_of_date(path, text, int(line)) for text, line in zip(texts, table.line, strict=True)]
        )
    else:
        time = table.numbers(("time",))[:, 0]
    camera, strip, flight = (_optional_text(table, name) for name in ("camera", "strip", "flight"))
    return EventRecords(path, None, table.text("image"), camera, strip, flight, time, table.line, extra=extra)


def _optional_text(table: TextTable, name: str) -> pa.Array:
    return table.text(name, may_be_empty=True) if table.has(name) else pa.nulls(len(table), pa.string())


def read_csv_cameras(path: Path, layout: TableLayout = _OURS) -> Mapping[str, CameraRecord]:
    """Read cameras by their names; the principal point is NaN if the layout declares it elsewhere.

    Raises
    ------
    InputError
        With file and line: see `tasks.formats.text_table`; missing columns; a camera that exists twice, no
        whole number of pixels, or pixels that do not make the image of the stated size.
    """
    required = ("camera", *_SIZE, *_LENGTHS, *_PRINCIPAL_POINT)
    table, extra = read_table(path, required, _CERTIFIED, (*required[1:], *_CERTIFIED), layout)
    if len(table) > _MOST_CAMERAS:
        raise Location(path).error(f"There are {len(table):,} cameras.", "Deliver those of the block.")
    _refuse_distortion(table, extra)
    found: dict[str, CameraRecord] = {}
    sizes = table.numbers(_SIZE)
    lengths, principal_point = table.numbers(_LENGTHS), table.numbers(_PRINCIPAL_POINT, may_be_empty=True)
    stated = table.numbers(_CERTIFIED, may_be_empty=True)
    for row, name in enumerate(table.text("camera").to_pylist()):
        size, (pixel_um, focal_mm) = sizes[row], lengths[row]
        trouble = _trouble_of_camera(size, pixel_um, focal_mm, stated[row])
        if name in found:
            trouble = "The camera exists twice."
        if trouble is not None:
            raise Location(path, int(table.line[row]), name).error(trouble, "Correct it.")
        x0, y0 = principal_point[row].tolist()
        columns, rows = map(int, size)
        found[name] = CameraRecord(columns, rows, float(pixel_um), float(focal_mm), (x0, y0))
    return found


def _refuse_distortion(table: TextTable, extra: Mapping[str, pa.Array]) -> None:
    """Refuse columns of distortion (K1, p2, b1 and the like) that are not empty or zero, as none is read."""
    for name, column in extra.items():
        given = [bool((text or "").strip("+-0.eE ")) for text in column.to_pylist()]
        if _DISTORTION.fullmatch(name) and any(given):
            line = int(table.line[given.index(True)])
            raise Location(table.layout.file, line, name).error(
                f"The table has distortion in the column '{name}', which is not read.",
                f'Declare it in cameras.NAME.additional_parameters, and unused = ["{name}"] for the table.',
            )


def _trouble_of_camera(size: Floats, pixel_um: float, focal_mm: float, stated_mm: Floats) -> str | None:
    """What is wrong with a row; misread certificates have other pixels than their image has room for."""
    if (size != np.floor(size)).any() or (size <= 0.0).any() or (size > MOST_PIXELS).any():
        return "The size of the image is not a number of pixels."
    if pixel_um <= 0.0 or focal_mm <= 0.0:
        return "The pixel or the focal length is not positive."
    away = np.abs(size * pixel_um * 1e-3 - stated_mm)
    if (away > 0.5e-3 * pixel_um).any():
        side = int(np.argmax(away))
        return (
            f"{size[side]:g} pixels of {pixel_um:g} µm are {size[side] * pixel_um * 1e-3:.4f} mm, and "
            f"{_CERTIFIED[side]} is {stated_mm[side]:.4f}."
        )
    return None
