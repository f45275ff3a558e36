"""OpenMVG ``sfm_data.json`` 0.3: views, intrinsics, extrinsics, structure; local, X_camera = R (X − C).

| entry | read |
|---|---|
| ``extrinsics`` | centre and rotation of the pose of each view; views without one are left out |
| ``intrinsics`` | pinhole, pinhole_radial_k1, pinhole_radial_k3, pinhole_brown_t2; by their numbers |
| ``structure``, ``control_points`` | image points, pixels (pixel_origin = "corner"); points by their numbers, ``cp`` before those of control points |

Tangential terms t1, t2 are p1, p2.
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tasks.errors import Location
from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.long_columns import LongPoints, LongRows
from tasks.formats.named_entries import ImagesByName
from tasks.formats.plain_records import (
    CV_AXES,
    LOCAL,
)
from tasks.formats.records import (
    AngleOrder,
    ExposureRecords,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.text_table import read_bytes

#: Intrinsic → where its distortion stands, and the names of its terms.
_DISTORTION = {
    "pinhole": ("", ()),
    "pinhole_radial_k1": ("disto_k1", ("k1",)),
    "pinhole_radial_k3": ("disto_k3", ("k1", "k2", "k3")),
    "pinhole_brown_t2": ("disto_t2", ("k1", "k2", "k3", "p1", "p2")),
}
_ENTRY = "ptr_wrapper"


def read_openmvg_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the oriented views.

    Raises
    ------
    InputError
        If the file is damaged, or a rotation is none.
    """
    file = _opened(path)
    # The value itself: with its place it would take more memory than its file.
    poses = {one["key"].whole(): one["value"].value for one in file["extrinsics"].each()}
    images = LongRows("position", "rotation")
    for number, view in enumerate(_views(file), start=1):
        found = poses.get(view["id_pose"].whole())
        if found is None:
            continue
        pose = JsonValue(path, f"pose {view['id_pose'].whole()}", found)
        rows = pose["rotation"].items()
        if len(rows) != 3:
            raise Location(path, entity=pose.where).error(
                "The rotation does not have three rows.", "Deliver it again."
            )
        rotation = [value for row in rows for value in row.numbers(3)]
        name, camera = view["filename"].text(), str(view["id_intrinsic"].whole())
        images.append(name, pose["center"].numbers(3), rotation, text=camera, line=number)
    world_from_camera = np.swapaxes(images["rotation"], 1, 2)
    return images.exposures(path, LOCAL, rotation=world_from_camera @ CV_AXES)


def read_openmvg_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the intrinsics by their numbers.

    Raises
    ------
    InputError
        If the file is damaged, or one is no pinhole camera.
    """
    found = {}
    # cereal writes the name of a class once; its later objects have the number without its highest bit.
    kinds: dict[int, str] = {}
    for one in _opened(path)["intrinsics"].items():
        name, value = str(one["key"].whole()), one["value"]
        number = value["polymorphic_id"].whole() & 0x7FFFFFFF
        if value.has("polymorphic_name"):
            kinds[number] = value["polymorphic_name"].text()
        kind = kinds.get(number, "")
        if kind not in _DISTORTION:
            raise Location(path, entity=name).error(
                f"The intrinsic is '{kind}', but only {', '.join(_DISTORTION)} are supported.",
                "Declare the camera in the project file.",
            )
        data = value[_ENTRY]["data"]
        columns, rows, c = data["width"].whole(), data["height"].whole(), data["focal_length"].number()
        column, row = data["principal_point"].numbers(2)
        if not (0 < columns < 10**6 and 0 < rows < 10**6 and c > 0.0):
            raise Location(path, entity=name).error("A focal length or size is not positive.", "Correct it.")
        key, terms = _DISTORTION[kind]
        values = dict(zip(terms, data[key].numbers(len(terms)), strict=True)) if terms else {}
        known = {f"brown-forward:{term}": number for term, number in values.items() if number}
        found[name] = PixelCamera(columns, rows, c, (column - 0.5 * columns, 0.5 * rows - row), known)
    if not found:
        raise Location(path).error("There is no intrinsic in the file.", "Export sfm_data with intrinsics.")
    return found


def read_openmvg_image_points(path: Path) -> ImagePointRecords:
    """Read the observations of the structure and of control points.

    Raises
    ------
    InputError
        If the file is damaged, or has none.
    """
    file = _opened(path)
    images = ImagesByName(path)
    listed = ((view["id_view"].whole(), view["filename"].text()) for view in _views(file))
    names = {number: images.named(name, number) for number, name in listed}
    points = LongPoints()
    for key, prefix in (("structure", ""), ("control_points", "cp")):
        for one in file[key].taken() if file.has(key) else []:
            name = f"{prefix}{one['key'].whole()}"
            for seen in one["value"]["observations"].each():
                view = names.get(seen["key"].whole())
                if view is None:
                    raise Location(path, entity=seen.where).error(
                        "An observation does not belong to a view.", "Deliver it again."
                    )
                points.append(view, name, seen["value"]["x"].numbers(2))
    return points.records(path)


def _opened(path: Path) -> JsonValue:
    found = json_value(path, read_bytes(path, "document"))
    if not found.has("sfm_data_version"):
        raise Location(path).error(
            "This is not an sfm_data.json file.", "Check that it is the file of OpenMVG."
        )
    return found


def _views(file: JsonValue) -> Iterator[JsonValue]:
    return (one["value"][_ENTRY]["data"] for one in file["views"].each())
