"""The cameras of a folder of deliveries: those that the exposures name, with their camera files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from tasks.formats.meanings import IMAGE_POINT_MEANINGS
from tasks.formats.records import CameraRecord, ExposureRecords, HeadRecord, PixelCamera
from tasks.formats.rigs import declared_head
from tasks.formats.trajectory_records import EventRecords
from tasks.inventory.recognition import FoundFile
from tasks.settings.declare import open_value

_NO_NAME = "CAMERA"
_MOST_LISTED = 20


@dataclass(frozen=True)
class CameraSection:
    """The table of one camera.

    Attributes
    ----------
    name : as the exposures call it.
    values : its keys.
    remarks : sentences above them.
    """

    name: str
    values: Mapping[str, object]
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Delivered:
    """A camera of a camera file; `number` of them are in it."""

    file: Path
    format: str
    name: str
    camera: CameraRecord | PixelCamera
    number: int


def camera_sections(files: Sequence[FoundFile], folder: Path) -> tuple[CameraSection, ...]:
    """A table for each camera that the exposures name, or, if they name none, for each in a camera file."""
    delivered = list(_delivered(files))
    names = list(dict.fromkeys(name for file in files for name in _named(file)))
    if not names:
        names = list(dict.fromkeys(one.name or _NO_NAME for one in delivered)) or [_NO_NAME]
    heads = {
        name: one for file in files for records in _exposures(file) for name, one in records.heads.items()
    }
    return tuple(_in_rig(_section(name, names, delivered, folder, _origin(files)), heads) for name in names)


def _in_rig(section: CameraSection, heads: Mapping[str, HeadRecord]) -> CameraSection:
    """The same with what the file says of a head, and the mounting for which this holds."""
    if section.name not in heads and all(one.reference != section.name for one in heads.values()):
        return section
    values = {**section.values, "mount_deg": 0}
    remarks = section.remarks
    if section.name in heads:
        values["head"] = declared_head(heads[section.name])
        remarks = (*remarks, "The head is as the file has it; it holds with mount_deg = 0 of both cameras.")
    return CameraSection(section.name, values, remarks)


def _exposures(file: FoundFile) -> list[ExposureRecords]:
    records = (content.records for content in file.contents)
    return [one for one in records if isinstance(one, ExposureRecords)]


def _delivered(files: Sequence[FoundFile]) -> list[_Delivered]:
    return [
        _Delivered(file.path, content.format, name, camera, len(content.records))
        for file in files
        for content in file.contents
        if isinstance(content.records, Mapping)
        for name, camera in content.records.items()
    ]


def _named(file: FoundFile) -> list[str]:
    """Names of cameras in the exposures or events of a file."""
    contents = (content.records for content in file.contents)
    records = [one for one in contents if isinstance(one, ExposureRecords | EventRecords)]
    return [
        cast(str, name) for one in records for name in one.camera.unique().to_pylist() if name is not None
    ]


def _origin(files: Sequence[FoundFile]) -> str:
    """Where pixels are counted from, if the formats of the image points agree."""
    contents = [content for file in files for content in file.contents if content.kind == "image_points"]
    meanings = [IMAGE_POINT_MEANINGS.get(content.format) for content in contents]
    # Formats that count no pixels have no origin of theirs.
    origins = {None if one is None else one.origin for one in meanings if one is None or one.unit == "px"}
    only = next(iter(origins)) if len(origins) == 1 else None
    return only or open_value("corner or centre: which point of the first pixel has coordinates (0, 0)")


def _section(
    name: str, names: Sequence[str], delivered: Sequence[_Delivered], folder: Path, origin: str
) -> CameraSection:
    mounting = {
        "pixel_origin": origin,
        "mount_deg": open_value(
            "0, 90, 180 or 270: 0 if the columns run forward, 90 if forward is down the rows"
        ),
    }
    found = [one for one in delivered if one.name == name]
    if not found and len(names) == 1:
        found = list(delivered)
    if not found:
        values: dict[str, object] = {
            "columns": open_value("width of the image, px"),
            "rows": open_value("height of the image, px"),
            "pixel_um": open_value("pixel size, µm"),
            "focal_length_mm": open_value("principal distance, mm"),
            "principal_point_mm": open_value("[x, y] from the centre of the image, mm"),
        }
        none = f"No file has a camera of this name; found: {_listed(delivered)}."
        remark = none if delivered else "No camera file was found."
        return CameraSection(name, {**values, **mounting}, (remark,))
    one = found[0]
    values = {"file": one.file.relative_to(folder).as_posix(), "format": one.format}
    if one.number > 1:
        values["name_in_file"] = one.name
    remarks = [_described(one.camera)]
    if isinstance(one.camera, PixelCamera):
        values["pixel_um"] = open_value("pixel size, µm; the file gives the camera in pixels")
    if len(found) > 1:
        remarks.append(f"Also found: {_listed(found[1:])}.")
    return CameraSection(name, {**values, **mounting}, tuple(remarks))


def _listed(delivered: Sequence[_Delivered]) -> str:
    """The first cameras with their files."""
    return ", ".join(f"{one.file.name} ({one.name})" for one in delivered[:_MOST_LISTED])


def _described(camera: CameraRecord | PixelCamera) -> str:
    size = f"{camera.columns} x {camera.rows} px"
    if isinstance(camera, PixelCamera):
        return f"{size}, focal length {camera.focal_length_px:.8g} px"
    return f"{size} of {camera.pixel_um:g} µm, focal length {camera.focal_length_mm:.8g} mm"
