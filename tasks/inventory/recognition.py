"""The kind of a delivered file, found by trying every reader of the register.

A file is what its reader reads. Some formats have nothing but the order of their fields: they are believed
only where no reader of a more telling format accepts the file. Names and extensions of files say nothing.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from adjust.errors import ExtensionError
from tasks.errors import InputError
from tasks.files.delivered_file import opened
from tasks.formats.colmap_rigs import colmap_rig_files
from tasks.formats.meanings import WITHOUT_MARK
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.register import (
    ACCURACY_FORMATS,
    CAMERA_FORMATS,
    CONTROL_FORMATS,
    DISTANCE_FORMATS,
    EVENT_FORMATS,
    EXPOSURE_FORMATS,
    IMAGE_POINT_FORMATS,
    TABLE,
    TRAJECTORY_FORMATS,
    read_cameras,
    read_control,
    read_events,
    read_exposures,
    read_image_points,
)
from tasks.formats.table_layout import TableLayout
from tasks.formats.trajectory_records import AccuracyRecords, Count, EventRecords, TrajectoryRecords
from tasks.inventory.foreign_tables import proposed_layouts
from tasks.inventory.known_files import crs_of_file, known_as

Kind: TypeAlias = Literal[
    "camera", "exposures", "image_points", "control", "distances", "trajectory", "accuracy", "events"
]
Records: TypeAlias = (
    ImagePointRecords
    | ExposureRecords
    | ControlRecords
    | DistanceRecords
    | TrajectoryRecords
    | AccuracyRecords
    | EventRecords
    | Mapping[str, CameraRecord | PixelCamera]
)

# A beginning of this size tells the format of a text; its own reader alone reads the rest.
_BEGINNING = 1 << 20
_IMAGES = {b"II*\0": "TIFF", b"MM\0*": "TIFF", b"\xff\xd8\xff": "JPEG", b"\x89PNG": "PNG"}
_WHOLE = (b"PK", b"SQLite", b"<", b"{", b"[")
# Lists of photos and points end with it; without it, any columns of numbers would be such lists.
_END_OF_LIST = re.compile(rb"^\s*-99\s*$", re.MULTILINE)
_LISTS_OF_CONTROL = 2
_OURS = TableLayout()
_LISTS = ("patb", "bingo", "pix4d")
_COUNTS: tuple[Count, ...] = ("week", "date")
_COORDINATES = {"x", "y", "z", "omega", "heading"}


@dataclass(frozen=True, eq=False)
class Content:
    """One kind of input that a file holds.

    Attributes
    ----------
    kind : the table of the project file.
    format : name in the register of readers.
    records : as read.
    order : of the angles, where the headings of a table tell headings from ω, φ, κ.
    layout : of a table; that of our own where nothing else is known.
    """

    kind: Kind
    format: str
    records: Records
    order: AngleOrder | None = None
    layout: TableLayout = _OURS


@dataclass(frozen=True, eq=False)
class FoundFile:
    """A file of the folder.

    Attributes
    ----------
    path : where it lies.
    contents : what it holds; empty if no reader can read it.
    remark : what is known of a file that is not read.
    crs : of a file that holds nothing but a CRS, as a project file takes it.
    """

    path: Path
    contents: tuple[Content, ...]
    remark: str = ""
    crs: str | None = None


def recognised(path: Path) -> FoundFile:
    """The kind of a file."""
    try:
        with opened(path, "table") as stream:
            beginning = stream.read(_BEGINNING)
    except InputError as error:
        return FoundFile(path, (), error.what)
    image = next((name for mark, name in _IMAGES.items() if beginning.startswith(mark)), None)
    if image is not None:
        return FoundFile(path, (), f"{image}: an image, or the grid of a geoid")
    if not beginning.strip():
        return FoundFile(path, (), "empty")
    with tempfile.TemporaryDirectory(prefix="aerocal-init-") as folder:
        tried = _shortened(path, beginning, Path(folder))
        found = _read_as_it_stands(tried, beginning) or _read_as_foreign_table(tried, beginning)
        if tried == path or not found:
            return _found(path, tuple(found), beginning)
    again = [_again(path, content) for content in found]
    contents = tuple(content for content in again if content is not None)
    return FoundFile(path, contents, "" if contents else "no reader can read it to the end")


def _found(path: Path, contents: tuple[Content, ...], beginning: bytes) -> FoundFile:
    """A file that was read, or what is known of one that was not."""
    if contents:
        return FoundFile(path, contents)
    crs = crs_of_file(beginning)
    if crs is not None:
        return FoundFile(path, (), f"a CRS: {crs}", crs)
    return FoundFile(path, (), known_as(path, beginning) or "no reader can read it")


def _shortened(path: Path, beginning: bytes, folder: Path) -> Path:
    """The file itself, or the first lines of a large text."""
    if len(beginning) < _BEGINNING or b"\0" in beginning or beginning.lstrip().startswith(_WHOLE):
        return path
    short = folder / path.name
    short.write_bytes(beginning[: beginning.rfind(b"\n") + 1] or beginning)
    return short


def _trials() -> Iterator[tuple[Kind, str, AngleOrder | None]]:
    """Every reader of the register; tables with either kind of angles."""
    yield from (("camera", name, None) for name in CAMERA_FORMATS)
    yield from (("exposures", name, "omega-phi-kappa") for name in EXPOSURE_FORMATS)
    yield ("exposures", TABLE, "heading-pitch-roll")
    yield from (("image_points", name, None) for name in IMAGE_POINT_FORMATS)
    yield from (("control", name, None) for name in CONTROL_FORMATS)
    yield from (("distances", name, None) for name in DISTANCE_FORMATS)
    yield from (("trajectory", name, None) for name in TRAJECTORY_FORMATS)
    yield from (("accuracy", name, None) for name in ACCURACY_FORMATS)
    yield from (("events", name, None) for name in EVENT_FORMATS)


def _read_as_it_stands(path: Path, beginning: bytes) -> list[Content]:
    ends = len(_END_OF_LIST.findall(beginning))
    found: list[Content] = []
    for kind, name, order in _trials():
        # Photos are many lists; control points two, plan and height.
        if (kind == "image_points" and name in _LISTS and ends == 0) or (
            kind == "control" and name == "patb" and ends > _LISTS_OF_CONTROL
        ):
            continue
        # Exposures and points may have times, too.
        if kind == "events" and name == TABLE and found:
            continue
        records = _read(path, kind, name, order, _OURS)
        if records is not None:
            found.append(Content(kind, name, records, order if name == TABLE else None))
    return _most_telling(found)


def _read(path: Path, kind: Kind, name: str, order: AngleOrder | None, layout: TableLayout) -> Records | None:
    """What a reader reads; None if it refuses the file or finds nothing in it."""
    records: Records
    try:
        if kind == "camera":
            records = read_cameras(name, path, layout)
        elif kind == "exposures":
            rigs = colmap_rig_files(path) if name == "colmap" else None
            records = read_exposures(name, path, order or "omega-phi-kappa", layout, rigs)
        elif kind == "image_points":
            records = read_image_points(name, path, layout)
        elif kind == "control":
            records = read_control(name, path, layout)
            if name in _LISTS and not np.isfinite(records.position[:, :2]).any():
                # Any words with a number would be points known in height only.
                return None
        elif kind == "distances":
            records = DISTANCE_FORMATS[name](path)
        elif kind == "trajectory":
            records = TRAJECTORY_FORMATS[name](path)
        elif kind == "accuracy":
            records = ACCURACY_FORMATS[name](path)
        else:
            return _events(path, name, layout)
    except (InputError, ExtensionError):
        return None
    return records if rows_of(records) else None


def _events(path: Path, name: str, layout: TableLayout) -> EventRecords | None:
    """Events with seconds or dates; a table with coordinates is another kind that its reader refused."""
    for count in _COUNTS:
        try:
            events = read_events(name, path, count, layout)
        except InputError:
            continue
        return events if len(events.line) and not _COORDINATES & set(events.extra) else None
    return None


def rows_of(records: Records) -> int:
    """Number of cameras, samples or rows."""
    if isinstance(records, Mapping):
        return len(records)
    return len(records.time_s if isinstance(records, TrajectoryRecords | AccuracyRecords) else records.line)


def _most_telling(found: list[Content]) -> list[Content]:
    """The best format of each kind; those without a marker are dropped if another one reads the file."""
    telling = [content for content in found if _rank(content) < 0]
    if not telling and found:
        best = min(map(_rank, found))
        telling = [content for content in found if _rank(content) == best]
    kinds: dict[Kind, Content] = {}
    for content in telling:
        kinds.setdefault(content.kind, content)
    return list(kinds.values())


def _rank(content: Content) -> int:
    """Rank of a reading: below zero if the format has markers; the larger, the less informative."""
    if content.kind == "camera" or content.format not in WITHOUT_MARK:
        return -1
    if content.kind == "exposures" and content.format in _LISTS:
        return -1
    if content.kind == "control" and content.format == "bingo":
        return -1
    if content.format in _LISTS and content.kind == "image_points":
        return len(WITHOUT_MARK)
    return WITHOUT_MARK.index(content.format)


def _read_as_foreign_table(path: Path, beginning: bytes) -> list[Content]:
    """A table whose headings or separators are not ours, read with the layout that they suggest."""
    for proposed in proposed_layouts(beginning):
        records = _read(path, proposed.kind, TABLE, proposed.order, proposed.layout)
        if records is not None:
            return [Content(proposed.kind, TABLE, records, proposed.order, proposed.layout)]
    return []


def _again(path: Path, content: Content) -> Content | None:
    """The whole of a file whose beginning was read; None if it cannot be."""
    records = _read(path, content.kind, content.format, content.order, content.layout)
    return None if records is None else replace(content, records=records)
