"""OpenSfM's ``ground_control_points.json``: surveyed points and where they are seen.

Positions are longitude, latitude (WGS 84) and altitude, which may be missing; a point without a position is
a tie point. Measurements are those of ``tracks.csv``: from the middle of the image, in parts of its longer
side, y downwards; unit = "longer-side". Source: OpenSfM's documentation, "Ground Control Points".
"""

from __future__ import annotations

from pathlib import Path

from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.long_columns import LongPoints, LongRows
from tasks.formats.records import ControlRecords, FileStatement, ImagePointRecords
from tasks.formats.text_table import read_bytes

_WGS84 = "+proj=longlat +datum=WGS84"


def read_opensfm_control(path: Path) -> ControlRecords:
    """Read the points that have a position.

    Raises
    ------
    InputError
        If the file is another one, or a number is missing.
    """
    points = LongRows("position")
    for number, one in enumerate(_points(path), start=1):
        if one.has("position"):
            place = one["position"]
            height = place["altitude"].number() if place.has("altitude") else float("nan")
            position = (place["longitude"].number(), place["latitude"].number(), height)
            points.append(one["id"].text(), position, line=number)
    return points.control(path, FileStatement(crs=_WGS84))


def read_opensfm_measurements(path: Path) -> ImagePointRecords:
    """Read where the points are seen.

    Raises
    ------
    InputError
        If the file is another one, or a number is missing.
    """
    points = LongPoints()
    for number, one in enumerate(_points(path), start=1):
        for seen in one["observations"].items():
            x, y = seen["projection"].numbers(2)
            points.append(seen["shot_id"].text(), one["id"].text(), (x, 0.0 - y), number)
    return points.records(path)


def _points(path: Path) -> list[JsonValue]:
    return json_value(path, read_bytes(path, "document"))["points"].items()
