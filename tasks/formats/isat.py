"""ImageStation (ISAT): the files ``photo``, ``camera`` and ``control``.

Each entry stands between ``begin KIND NAME`` and ``end KIND``; a line is a keyword (with or without a colon)
and its values. Orientations are X, Y, Z, ω, φ, κ in metres and degrees; other entries and keywords of
``photo`` are named. A camera with ``photo_coord_sys_orientation`` is refused, as its codes are not published.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tasks.errors import Location
from tasks.formats.long_columns import LongRows
from tasks.formats.named_entries import NotTaken, take_camera
from tasks.formats.plain_records import number_of, numbers_of
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    ExposureRecords,
    FileStatement,
)
from tasks.formats.text_lines import numbered_lines

_POINTS = "control_points"
# Of a photo, what is read or changes nothing.
_READ = ("eo_parameters", "camera_name", "computed_std_devs", "image_id", "key")
# Rows of control points that are in memory together.
_TOGETHER = 10_000


@dataclass
class _Entry:
    """The content between begin and end."""

    kind: str
    title: list[str]
    line: int
    values: dict[str, tuple[int, list[str]]] = field(default_factory=dict)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    def numbers(self, path: Path, key: str, count: int, what: str) -> list[float]:
        """The first numbers of a keyword."""
        if key not in self.values:
            raise Location(path, self.line, " ".join(self.title)).error(
                f"The entry lacks {key}.", "Deliver the file again."
            )
        number, words = self.values[key]
        return numbers_of(path, words, count, number, what)


def _entries(path: Path, kind: str, others: NotTaken | None = None) -> Iterator[_Entry]:
    """The entries of a kind; those of other kinds are counted."""
    entry: _Entry | None = None
    for number, line in numbered_lines(path):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        first = words[0].lower().rstrip(":")
        if first == "begin" and len(words) > 1:
            if entry is None and words[1].lower() == kind:
                entry = _Entry(kind, words[2:], number)
            elif others is not None:
                others.add([words[1].lower()])
        elif first == "end" and len(words) > 1:
            if entry is not None and words[1].lower() == kind:
                yield entry
                entry = None
        elif entry is not None:
            entry.rows.append((number, words))
            if kind == _POINTS:
                # Of a list there are rows only, and it may be long.
                if len(entry.rows) >= _TOGETHER:
                    yield entry
                    entry = _Entry(kind, entry.title, entry.line)
                continue
            values = words[1:]
            if values and values[0] == ":":
                values = values[1:]
            entry.values[first] = (number, values)
    if entry is not None:
        raise Location(path, entry.line).error(
            f"The entry 'begin {kind}' does not end.", "The file may have been cut off: deliver it again."
        )


def read_isat_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read orientations, with standard deviations where they are given.

    Raises
    ------
    InputError
        With file and line: no photo, numbers missing.
    """
    rows, strip, rest = LongRows("position", "angles", "sigma_position", "sigma_angles"), [], NotTaken()
    for entry in _entries(path, "photo_parameters", rest):
        rest.add(key for key in entry.values if key not in _READ)
        title = entry.title
        if not title:
            raise Location(path, entry.line).error("The photo has no name.", "Give it a name.")
        # The makers describe the word without "_", files have it with.
        strip.append(title[2] if len(title) > 2 and title[1].lower() in ("strip_id", "stripid") else None)
        camera = " ".join(entry.values.get("camera_name", (0, []))[1]) or None
        values = entry.numbers(path, "eo_parameters", 6, "X, Y, Z, ω, φ, κ")
        known = "computed_std_devs" in entry.values
        sigma = entry.numbers(path, "computed_std_devs", 6, "six σ") if known else 6 * [0.0]
        # A photo that was not adjusted has zeros there.
        sigma = [value if value > 0.0 else float("nan") for value in sigma]
        rows.append(title[0], values[:3], values[3:], sigma[:3], sigma[3:], text=camera, line=entry.line)
    states = FileStatement(order="omega-phi-kappa")
    return rows.exposures(path, states, strip=strip, unit="deg", remarks=rest.remarks(path))


def read_isat_control(path: Path) -> ControlRecords:
    """Read control points: name X Y Z and what else is in the line.

    Raises
    ------
    InputError
        With file and line: no points, numbers missing.
    """
    points, rest = LongRows("position"), NotTaken()
    for entry in _entries(path, _POINTS):
        for number, words in entry.rows:
            rest.add(["fields behind X, Y, Z"] if words[4:] else [])
            points.append(words[0], numbers_of(path, words[1:], 3, number, "X, Y, Z"), line=number)
    return points.control(path, remarks=rest.remarks(path))


def read_isat_cameras(path: Path) -> Mapping[str, CameraRecord]:
    """Read the cameras by their names.

    Raises
    ------
    InputError
        With file and line: no camera, numbers missing, distortion.
    """
    found: dict[str, CameraRecord] = {}
    for entry in _entries(path, "camera_parameters"):
        _refuse_distortion(path, entry)
        _refuse_turned(path, entry)
        (c,) = entry.numbers(path, "focal_length", 1, "the focal length")
        x0, y0 = entry.numbers(path, "ppac", 2, "the principal point")
        (pixel,) = entry.numbers(path, "pixel_size", 1, "the side of a pixel")
        columns, rows = entry.numbers(path, "image_size_in_pixels", 2, "columns and rows")
        if not (columns.is_integer() and rows.is_integer()):
            raise Location(path, entry.line).error("The image has no whole number of pixels.", "Correct it.")
        camera = CameraRecord(int(columns), int(rows), pixel, c, (x0, y0))
        take_camera(path, found, " ".join(entry.title), camera)
    if not found:
        raise Location(path).error("There is no camera in the file.", "Declare it in the project file.")
    return found


def _refuse_distortion(path: Path, entry: _Entry) -> None:
    flag = entry.values.get("lens_distortion_flag", (0, ["off"]))[1]
    number, given = entry.values.get("distortions", (entry.line, []))
    on = bool(flag) and flag[0].lower() not in ("off", "0", "false", "no")
    if on and any(number_of(path, text, number, "a distortion") for text in given):
        raise Location(path, number, " ".join(entry.title)).error(
            "The camera has a table of radial distortion, which is not read.",
            "Declare the camera in the project file, with cameras.NAME.additional_parameters.",
        )


def _refuse_turned(path: Path, entry: _Entry) -> None:
    """Refuse a camera that names its axes by a code, as Pix4D does: rows then come before columns."""
    code = "photo_coord_sys_orientation"
    if code in entry.values:
        number, words = entry.values[code]
        size = " and ".join(entry.values.get("image_size_in_pixels", (0, []))[1])
        raise Location(path, number, " ".join(entry.title)).error(
            f"The axes of the camera are those of {code} {' '.join(words)}, which is not read: its image has "
            f"{size} pixels, in Pix4D's files rows and columns, and ppac may be turned.",
            "Declare the camera in the project file, or read Pix4D's …_calibrated_camera_parameters.txt.",
        )
