"""Items of an OPF project, the names of its images and sensors, its coordinate systems and tie points.

Tie points are the matches of its sparse cloud (glTF with ``OPF_mesh_primitive_matches``):

| accessor | read |
|---|---|
| ``pointIndexRanges`` | one 64-bit number for each point: number of its matches × 2⁴⁰ + place of the first |
| ``cameraIds``, ``cameraUids`` | camera of each match, as a place in the list of identifiers |
| ``imagePoints.pixelCoordinates`` | column and row, float32: 0.001 px at 20,000 |
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyproj

from adjust.arrays import Floats, Ints
from tasks.errors import InputError, Location
from tasks.formats.crs_definition import known_crs
from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.named_entries import ImagesByName, file_of_uri
from tasks.formats.packed_folder import PackedFolder, packed_folder

_EXTENSION = "OPF_mesh_primitive_matches"
_OFFSET_BITS = 40
_OFFSETS = np.uint64((1 << _OFFSET_BITS) - 1)
_UINT32, _FLOAT32 = np.dtype("<u4"), np.dtype("<f4")
#: Component type of an accessor, and values of an element.
_COMPONENTS, _WIDTHS = {5125: _UINT32, 5126: _FLOAT32}, {"SCALAR": 1, "VEC2": 2}


@dataclass(frozen=True, eq=False)
class Tracks:
    """Matches of tie points: camera identifier and number of the point (m,), column and row (m, 2)."""

    camera: list[int]
    point: Ints
    xy: Floats


def tracks_of(gltf: JsonValue, beside: Callable[[str], bytes]) -> Tracks:
    """The matches of a glTF file.

    Parameters
    ----------
    beside : content of a buffer by its relative address.

    Raises
    ------
    InputError
        If it is damaged.
    """
    camera: list[int] = []
    point, xy, points = [np.zeros(0, np.int64)], [np.zeros((0, 2))], 0
    for mesh in gltf["meshes"].items():
        for primitive in mesh["primitives"].items():
            if not primitive.has("extensions") or not primitive["extensions"].has(_EXTENSION):
                continue
            matches = primitive["extensions"][_EXTENSION]
            known = [one.whole() for one in matches["cameraUids"].items()]
            ids = _accessor(gltf, matches["cameraIds"], beside, _UINT32, 1)[:, 0]
            ranges = _accessor(gltf, matches["pointIndexRanges"], beside, _UINT32, 2)
            packed = np.ascontiguousarray(ranges).view("<u8")[:, 0]
            seen = matches["imagePoints"]["pixelCoordinates"]
            pixel = _accessor(gltf, seen, beside, _FLOAT32, 2).astype(np.float64)
            first, count = packed & _OFFSETS, packed >> np.uint64(_OFFSET_BITS)
            ends = first + count
            if len(ids) != len(pixel) or (ends > len(ids)).any() or (ids >= len(known)).any():
                raise _damaged(matches)
            rows = [np.arange(begin, end) for begin, end in zip(first.tolist(), ends.tolist(), strict=True)]
            taken = np.concatenate([np.zeros(0, np.int64), *rows]).astype(np.int64)
            camera += [known[k] for k in ids[taken]]
            point.append(np.repeat(np.arange(points, points + len(packed)), count.astype(np.int64)))
            xy.append(pixel[taken])
            points += len(packed)
    return Tracks(camera, np.concatenate(point), np.concatenate(xy))


def _accessor(
    gltf: JsonValue, number: JsonValue, beside: Callable[[str], bytes], kind: np.dtype, width: int
) -> np.ndarray:
    """Values (n, width) of an accessor of this component type."""
    accessors, views, buffers = (gltf[name].items() for name in ("accessors", "bufferViews", "buffers"))
    accessor = _chosen(accessors, number)
    if (
        _COMPONENTS.get(accessor["componentType"].whole()) != kind
        or _WIDTHS.get(accessor["type"].text()) != width
    ):
        raise _damaged(accessor)
    view = _chosen(views, accessor["bufferView"])
    begin = sum(one["byteOffset"].whole() for one in (view, accessor) if one.has("byteOffset"))
    size = accessor["count"].whole() * width * kind.itemsize
    content = beside(_chosen(buffers, view["buffer"])["uri"].text())[begin : begin + size]
    if len(content) != size or (
        view.has("byteStride") and view["byteStride"].whole() != width * kind.itemsize
    ):
        raise _damaged(accessor)
    return np.frombuffer(content, kind).reshape(-1, width)


def _chosen(entries: list[JsonValue], number: JsonValue) -> JsonValue:
    place = number.whole()
    if place >= len(entries):
        raise _damaged(number)
    return entries[place]


def _damaged(value: JsonValue) -> InputError:
    return Location(value.file, entity=value.where[-80:]).error(
        "The tie points of the sparse cloud are inconsistent.", "Export the project again."
    )


_KIND, _GLTF = "application/opf-{}+json", "model/gltf+json"


class OpfProject:
    """Items of a project by their types."""

    def __init__(self, path: Path) -> None:
        self._folder: PackedFolder = packed_folder(path)
        found = [name for name in self._folder.members if name.lower().endswith(".opf")]
        if len(found) != 1:
            raise Location(path).error(
                f"The packed folder has {len(found)} files *.opf, but must have one.",
                "Pack the folder of one project, with its project.opf.",
            )
        self._name = found[0]
        self._items = json_value(path, self._folder.read(self._name), self._name)["items"].items()

    def optional(self, item: str, kind: str) -> JsonValue | None:
        """The file of a kind that belongs to an item; None without."""
        for one in self._items:
            for resource in one["resources"].items() if one["type"].text() == item else []:
                if resource["format"].text() == _KIND.format(kind):
                    name = self._folder.beside(self._name, resource["uri"].text())
                    return json_value(self._folder.file, self._folder.read(name), name)
        return None

    def tracks(self) -> Tracks | None:
        """The matches of the sparse cloud of the calibration; None without."""
        for one in self._items:
            for resource in one["resources"].items() if one["type"].text() == "calibration" else []:
                if resource["format"].text() == _GLTF:
                    folder, name = self._folder, self._folder.beside(self._name, resource["uri"].text())
                    cloud = json_value(folder.file, folder.read(name), name)
                    return tracks_of(cloud, lambda uri: folder.read(folder.beside(name, uri)))  # noqa: B023
        return None

    def one(self, item: str, kind: str) -> JsonValue:
        """The file of a kind that belongs to an item."""
        found = self.optional(item, kind)
        if found is None:
            raise Location(self._folder.file, entity=self._name).error(
                f"The project has no {item} ({kind}).", "Export it as well."
            )
        return found

    def images(self) -> dict[int, str]:
        """Identifier → file name, with the page of a file that has several images."""
        cameras = self.one("camera_list", "camera-list")["cameras"].items()
        images = ImagesByName(self._folder.file)
        listed = ((one["id"].whole(), file_of_uri(one["uri"].text())) for one in cameras)
        return {number: images.named(name, number) for number, name in listed}

    def sensor_names(self) -> dict[int, str]:
        """Identifier → name, with the identifier where several have the same."""
        sensors = self.one("input_cameras", "input-cameras")["sensors"].items()
        names = {one["id"].whole(): one["name"].text() for one in sensors}
        listed = Counter(names.values())
        return {number: name if listed[name] == 1 else f"{name} {number}" for number, name in names.items()}


def named(number: JsonValue, names: Mapping[int, str]) -> str:
    """The name of an identifier; refused where the lists of the project do not have it."""
    return name_of(number.whole(), names, number.file, number.where)


def name_of(number: int, names: Mapping[int, str], file: Path, where: str | None = None) -> str:
    """As `named`, for a number."""
    found = names.get(number)
    if found is None:
        raise Location(file, entity=where).error(
            f"There is no camera or sensor {number} in the lists of the project.", "Export the project again."
        )
    return found


def canonical_shift(scene: JsonValue) -> Floats:
    """Canonical − (east, north, up): canonical axes are right-handed, whatever the axes of the CRS."""
    frame = scene["base_to_canonical"]
    swapped = frame.has("swap_xy") and frame["swap_xy"].value is True
    if swapped != (_directions(crs_of(scene["crs"])) == ["north", "east"]):
        raise Location(scene.file, entity=frame.where).error(
            "swap_xy is true where the axes of the CRS are x north, y east, and only there; here it is not.",
            "Export the project again: it does not state which coordinate is east.",
        )
    if any(abs(value - 1.0) > 1e-12 for value in frame["scale"].numbers(3)):
        raise Location(scene.file, entity=frame.where).error(
            "The unit of the scene is not metres.", "Export it in a metric CRS."
        )
    return np.array(frame["shift"].numbers(3))


def crs_of(stated: JsonValue) -> pyproj.CRS:
    """The CRS of a definition."""
    try:
        return known_crs(stated["definition"].text())
    except InputError as error:
        raise replace(error, file=stated.file) from error


def east_north(crs: pyproj.CRS, values: Floats) -> Floats:
    """Coordinates (n, 3) in the order of the CRS's own axes as x (east), y (north), z."""
    return values[:, [1, 0, 2]] if _directions(crs) == ["north", "east"] else values


def _directions(crs: pyproj.CRS) -> list[str]:
    """Where the first two axes point to."""
    return [axis.direction.lower() for axis in crs.axis_info[:2]]
