"""Items of an OPF project, the names of its images and sensors, and its coordinate systems."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PureWindowsPath

import numpy as np
import pyproj

from adjust.arrays import Floats
from tasks.errors import InputError
from tasks.formats.crs_definition import known_crs
from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.opf_tracks import Tracks, tracks_of
from tasks.formats.packed_folder import PackedFolder, packed_folder

_KIND, _GLTF = "application/opf-{}+json", "model/gltf+json"


class OpfProject:
    """Items of a project by their types."""

    def __init__(self, path: Path) -> None:
        self._folder: PackedFolder = packed_folder(path)
        found = [name for name in self._folder.members if name.lower().endswith(".opf")]
        if len(found) != 1:
            raise InputError(
                f"The packed folder has {len(found)} files *.opf, but must have one.",
                "Pack the folder of one project, with its project.opf.",
                file=path,
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
            raise InputError(
                f"The project has no {item} ({kind}).",
                "Export it as well.",
                self._folder.file,
                entity=self._name,
            )
        return found

    def images(self) -> dict[int, str]:
        """Identifier → file name."""
        cameras = self.one("camera_list", "camera-list")["cameras"].items()
        return {one["id"].whole(): PureWindowsPath(one["uri"].text()).name for one in cameras}

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
        raise InputError(
            f"There is no camera or sensor {number} in the lists of the project.",
            "Export the project again.",
            file=file,
            entity=where,
        )
    return found


def canonical_shift(scene: JsonValue) -> Floats:
    """Canonical − (east, north, up): canonical axes are right-handed, whatever the axes of the CRS."""
    frame = scene["base_to_canonical"]
    swapped = frame.has("swap_xy") and frame["swap_xy"].value is True
    if swapped != (_directions(crs_of(scene["crs"])) == ["north", "east"]):
        raise InputError(
            "swap_xy is true where the axes of the CRS are x north, y east, and only there; here it is not.",
            "Export the project again: it does not state which coordinate is east.",
            scene.file,
            entity=frame.where,
        )
    if any(abs(value - 1.0) > 1e-12 for value in frame["scale"].numbers(3)):
        raise InputError(
            "The unit of the scene is not metres.",
            "Export it in a metric CRS.",
            scene.file,
            entity=frame.where,
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
