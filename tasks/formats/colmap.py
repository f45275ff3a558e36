"""COLMAP models: ``images`` (orientations and image points), ``cameras``, rigs and frames, text or binary.

The world is Cartesian: declare crs = "local". Camera axes are x right, y down, z forward; X_camera = R X + t.
Image points are pixels from the corner of the first one; only those of a 3D point are read, under its number.
Cameras go by their numbers, and know pixels only.

Binary files are little-endian: counts of 8 bytes; a camera is id, model, width, height and its parameters; an
image is id, quaternion w x y z, translation, camera, name up to a zero byte, and its points x, y, 3D point.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from adjust.arrays import Floats
from tasks.errors import InputError, Location
from tasks.files.delivered_file import file_limits
from tasks.formats.colmap_rigs import colmap_events, colmap_heads
from tasks.formats.long_columns import LongRows
from tasks.formats.plain_records import (
    CV_AXES,
    LOCAL,
    image_points_of,
    names_of_numbers,
    number_of,
    numbers_of,
)
from tasks.formats.quaternions import rotations_of_quaternions
from tasks.formats.records import AngleOrder, ExposureRecords, ImagePointRecords, PixelCamera
from tasks.formats.rigs import rigs_of, with_rigs
from tasks.formats.text_table import read_bytes

_NONE = 2**64 - 1
#: Model → its parameters; two focal lengths or one, then the principal point, then distortion.
_MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "OPENCV_FISHEYE": "",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
_NUMBERS = list(_MODELS)
#: Number, model, width, height, parameters, line.
_CameraRow: TypeAlias = tuple[str, str, float, float, list[float], int]
_POINT = np.dtype([("x", "<f8"), ("y", "<f8"), ("point", "<u8")])


@dataclass(frozen=True, eq=False)
class _Image:
    """An oriented image with its points."""

    number: int
    name: str
    camera: str
    pose: list[float]
    line: int
    xy: Floats
    point: NDArray[np.uint64]


def read_colmap_exposures(
    path: Path, _order: AngleOrder, rigs: tuple[Path, Path] | None = None
) -> ExposureRecords:
    """Read the orientations of a file ``images.txt`` or ``images.bin``.

    Parameters
    ----------
    rigs : files ``rigs`` and ``frames`` of the same model.

    Raises
    ------
    InputError
        If the file is damaged, or a quaternion is none; as of `tasks.formats.rigs`.
    """
    rows, numbers = LongRows("quaternion", "shift"), list[int]()
    for one in _images(path):
        numbers.append(one.number)
        rows.append(one.name, one.pose[:4], one.pose[4:], text=sys.intern(one.camera), line=one.line)
    name = rows.names
    world_from_camera = np.swapaxes(rotations_of_quaternions(path, rows["quaternion"], name, rows.line), 1, 2)
    centre = -np.einsum("nij,nj->ni", world_from_camera, rows["shift"])
    records = rows.exposures(path, LOCAL, position=centre, rotation=world_from_camera @ CV_AXES)
    if rigs is None:
        return records
    of_images = {image: camera or "" for image, camera in zip(name, rows.texts, strict=True)}
    events = colmap_events(rigs[1], dict(zip(numbers, name, strict=True)), of_images)
    found = rigs_of(rigs[1], colmap_heads(rigs[0]), events, set(name))
    return with_rigs(records, found, centre, world_from_camera)


def read_colmap_image_points(path: Path) -> ImagePointRecords:
    """Read the image points of 3D points of a file ``images.txt`` or ``images.bin``.

    A 3D point that has two points in one image is none of them: neither is read.

    Raises
    ------
    InputError
        If the file is damaged, or no image has such a point.
    """
    names: list[str] = []
    line: list[int] = []
    rows: list[int] = []
    point: list[NDArray[np.uint64]] = []
    xy: list[Floats] = []
    for one in _images(path):
        numbers, count = np.unique(one.point, return_counts=True)
        seen = (one.point != _NONE) & ~np.isin(one.point, numbers[count > 1])
        names.append(one.name)
        line.append(one.line)
        rows.append(int(np.count_nonzero(seen)))
        point.append(one.point[seen])
        xy.append(one.xy[seen])
    known = pa.array(names, pa.string()).dictionary_encode()
    image = pa.DictionaryArray.from_arrays(np.repeat(known.indices.to_numpy(), rows), known.dictionary)
    points = names_of_numbers(np.concatenate([np.zeros(0, dtype=np.uint64), *point]))
    every = np.concatenate([np.zeros((0, 2)), *xy])
    return image_points_of(path, image, points, every, np.repeat(np.array(line, dtype=np.int64), rows))


def read_colmap_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the cameras of a file ``cameras.txt`` or ``cameras.bin`` by their numbers.

    Raises
    ------
    InputError
        If the file is damaged, or a model is not a frame camera with Brown's distortion.
    """
    content = read_bytes(path, "document")
    rows = _camera_rows_text(path, content) if _is_text(content) else _camera_rows_binary(path, content)
    found = {row[0]: camera_of_colmap(path, *row) for row in rows}
    if not found:
        raise Location(path).error("There is no camera in the file.", "Check that it is the file of cameras.")
    return found


def _is_text(content: bytes) -> bool:
    """Binary files begin with a count of eight bytes, of which the last are zero."""
    return b"\0" not in content[:8]


def model_of_number(number: int) -> str:
    """The name of a model; the number if it is unknown."""
    return _NUMBERS[number] if 0 <= number < len(_NUMBERS) else f"{number}"


def camera_of_colmap(
    path: Path, number: str, model: str, columns: float, rows: float, parameters: list[float], line: int
) -> PixelCamera:
    """A camera of its model and parameters.

    Raises
    ------
    InputError
        If the model is none that is read, or the values are none of a camera.
    """
    names = _MODELS.get(model, "").split()
    if not names or len(parameters) < len(names) or not all(abs(value) < 1e9 for value in parameters):
        raise Location(path, line, f"camera {number}").error(
            f"The camera model {model} is not supported, or its parameters are incomplete.",
            "Declare the camera in the project file. Supported models: "
            f"{', '.join(name for name, parameters in _MODELS.items() if parameters)}.",
        )
    values = dict(zip(names, parameters, strict=False))
    c = values.pop("fy", 0.0) or values.get("f", 0.0)
    if c <= 0.0 or any(values.get(name) for name in ("k4", "k5", "k6")):
        raise Location(path, line, f"camera {number}").error(
            "The focal length is not positive, or distortion is a fraction (k4 to k6), which is not read.",
            "Declare the camera in the project file.",
        )
    distortion = {key: values[key] for key in ("k1", "k2", "k3", "p1", "p2") if values.get(key)}
    if "fx" in values and values["fx"] != c:
        distortion["b1"] = values["fx"] / c - 1.0
    centre = (values["cx"] - 0.5 * columns, 0.5 * rows - values["cy"])
    known = {f"brown-forward:{key}": value for key, value in distortion.items()}
    return PixelCamera(int(columns), int(rows), c, centre, known)


def _camera_rows_text(path: Path, content: bytes) -> Iterator[_CameraRow]:
    for line, text in _text_lines(content):
        if text.strip() and not text.startswith("#"):
            words = text.split()
            size = numbers_of(path, words[2:], 2, line, "width and height of a camera")
            parameters = [number_of(path, word, line, "a parameter") for word in words[4:]]
            yield words[0], words[1], size[0], size[1], parameters, line


def _camera_rows_binary(path: Path, content: bytes) -> Iterator[_CameraRow]:
    count, at = _unpacked(path, "<Q", content, 0)
    for entry in range(1, int(count) + 1):
        number, model, columns, rows, at = _unpacked(path, "<IiQQ", content, at)
        name = model_of_number(model)
        # Of a model that is not read it is not known where it ends, and it is refused.
        *parameters, at = _unpacked(path, f"<{len(_MODELS.get(name, '').split())}d", content, at)
        yield str(number), name, float(columns), float(rows), list(parameters), entry


def _images(path: Path) -> Iterator[_Image]:
    content = read_bytes(path)
    yield from _images_text(path, content) if _is_text(content) else _images_binary(path, content)


def _images_text(path: Path, content: bytes) -> Iterator[_Image]:
    waiting: tuple[int, list[str]] | None = None
    for line, text in _text_lines(content):
        if text.startswith("#") or (waiting is None and not text.strip()):
            continue
        if waiting is None:
            # COLMAP reads numbers followed by a comma, too, and programs write such files.
            words = text.split(maxsplit=9)
            waiting = line, [*(word.removesuffix(",") for word in words[:9]), *words[9:]]
            continue
        number, words = waiting
        pose = numbers_of(path, words[1:], 7, number, "quaternion and translation")
        if len(words) < 10:
            raise Location(path, number).error("The image has no name.", "Deliver the file again.")
        xy, point = _points_of_line(path, text, line)
        image = number_of(path, words[0], number, "the number of the image")
        yield _Image(int(image), words[9].strip(), words[8], pose, number, xy, point)
        waiting = None
    if waiting is not None:
        raise Location(path, waiting[0]).error(
            "The line of image points of the last image is missing.",
            "The file may have been cut off: deliver it again.",
        )


def _points_of_line(path: Path, text: str, line: int) -> tuple[Floats, NDArray[np.uint64]]:
    try:
        values = np.array(text.split(), dtype=np.float64).reshape(-1, 3)
        numbers = values[:, 2]
        if not (np.abs(values) < 1e15).all() or (numbers != np.round(numbers)).any() or (numbers < -1).any():
            raise ValueError
    except ValueError as error:
        raise Location(path, line).error(
            "The line of image points is not x, y and the number of a 3D point each.",
            "Every image has two lines, of which the second may be empty: deliver the file again.",
        ) from error
    point = np.where(numbers < 0, 0, numbers).astype(np.uint64)
    return values[:, :2], np.where(numbers < 0, np.uint64(_NONE), point)


def _images_binary(path: Path, content: bytes) -> Iterator[_Image]:
    count, at = _unpacked(path, "<Q", content, 0)
    for entry in range(1, int(count) + 1):
        number, *pose, camera, at = _unpacked(path, "<I7dI", content, at)
        end = content.find(b"\0", at)
        if end < 0:
            raise _cut_off(path, entry)
        try:
            name = content[at:end].decode("utf-8")
        except UnicodeDecodeError as error:
            raise _cut_off(path, entry) from error
        points, at = _unpacked(path, "<Q", content, end + 1)
        if points * _POINT.itemsize > len(content) - at:
            raise _cut_off(path, entry)
        table = np.frombuffer(content, _POINT, int(points), at)
        at += table.nbytes
        xy = np.column_stack([table["x"], table["y"]])
        if not (np.isfinite(pose).all() and (np.abs(xy) < 1e15).all()):
            raise _cut_off(path, entry)
        yield _Image(number, name, str(camera), list(pose), entry, xy, table["point"])
    file_limits().require_rows(path, int(count))


def _unpacked(path: Path, layout: str, content: bytes, at: int) -> tuple[Any, ...]:
    """Values at a place of a binary file, and the place behind them."""
    try:
        return *struct.unpack_from(layout, content, at), at + struct.calcsize(layout)
    except struct.error as error:
        raise _cut_off(path, None) from error


def _cut_off(path: Path, entry: int | None) -> InputError:
    return Location(path, entry).error(
        "The file ends in the middle of an entry, or is not a binary file of COLMAP.", "Deliver it again."
    )


def _text_lines(content: bytes) -> Iterator[tuple[int, str]]:
    """Lines of any length: one of them holds all points of an image."""
    text = content.decode("utf-8", errors="replace")
    yield from enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
