"""OPF 1.0, Pix4D's open photogrammetry format: the folder of a project, packed into one zip file.

| item | read |
|---|---|
| ``calibrated_cameras`` | positions and ω, φ, κ in the CRS of the scene, base_to_canonical undone; cameras in pixels from the corner |
| ``input_cameras`` | sizes and names of the sensors; where nothing is calibrated, positions of the captures and their ω, φ, κ |
| ``input_control_points`` | control and check points; marks of these and of manual tie points (pixel_origin = "corner") |
| sparse cloud of ``calibration`` | tie points with their matches, called tie1, tie2, … in its order |

Images go by their file names. Yaw, pitch and roll of captures are not read: how the axes of the body lie does not stand in the file.
Cameras of a rig are read as they are calibrated, each for itself.
"""  # noqa: E501

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PureWindowsPath

import numpy as np
import pyproj

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats.crs_definition import known_crs
from tasks.formats.json_value import JsonValue, json_value
from tasks.formats.long_columns import LongNames, table_of
from tasks.formats.opf_tracks import Tracks, tracks_of
from tasks.formats.packed_folder import PackedFolder, packed_folder
from tasks.formats.plain_records import control_of, degrees_of_rotations, exposures_of, image_points_of
from tasks.formats.records import (
    AngleOrder,
    ControlRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
    PixelCamera,
)

_KIND, _GLTF = "application/opf-{}+json", "model/gltf+json"
_IN_MAP = (
    "The orientations of this OPF project were adjusted in a map frame taken as Cartesian: they are no "
    "positions of the camera."
)


def read_opf_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the calibrated cameras, or the captures of a project without any.

    Raises
    ------
    InputError
        If the project is damaged, or its scene is scaled.
    """
    project = _Project(path)
    names, sensors = project.images(), project.sensor_names()
    calibrated = project.optional("calibration", "calibrated-cameras")
    if calibrated is None:
        return _captures(path, project, names, sensors)
    image, camera, position, angles = [], [], [], []
    for one in calibrated["cameras"].items():
        image.append(_named(one["id"], names))
        camera.append(_named(one["sensor_id"], sensors))
        position.append(one["position"].numbers(3))
        angles.append(one["orientation_deg"].numbers(3))
    at = list(range(1, len(image) + 1))
    scene = project.one("scene_reference_frame", "scene-reference-frame")
    shift = _shift(scene)
    crs = _crs(scene["crs"])
    local = crs.is_engineering
    states = FileStatement(crs="local" if local else crs.to_wkt(), order="omega-phi-kappa")
    centre = np.array(position).reshape(-1, 3) - shift
    turn = from_omega_phi_kappa(np.radians(np.array(angles).reshape(-1, 3)))
    degrees = degrees_of_rotations(path, turn, image, at)
    remarks = () if local else (_IN_MAP,)
    return exposures_of(
        path, image, centre, degrees, at, camera=camera, unit="deg", states=states, remarks=remarks
    )


def read_opf_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the sensors, as calibrated where they are.

    Raises
    ------
    InputError
        If the project is damaged, or a sensor is no perspective camera.
    """
    project = _Project(path)
    names = project.sensor_names()
    given = {
        one["id"].whole(): one for one in project.one("input_cameras", "input-cameras")["sensors"].items()
    }
    calibrated = project.optional("calibration", "calibrated-cameras")
    adjusted = {} if calibrated is None else {one["id"].whole(): one for one in calibrated["sensors"].items()}
    found = {}
    for number, sensor in given.items():
        columns, rows = (one.whole() for one in _pair(sensor["image_size_px"]))
        internals = adjusted.get(number, sensor)["internals"]
        if internals["type"].text() != "perspective":
            raise InputError(
                "Only perspective cameras are read.", "Leave it out.", path, entity=names[number]
            )
        c = internals["focal_length_px"].number()
        column, row = internals["principal_point_px"].numbers(2)
        if c <= 0.0 or columns == 0 or rows == 0:
            raise InputError(
                "A focal length or size is not positive.", "Correct it.", path, entity=names[number]
            )
        radial, tangential = (
            internals["radial_distortion"].numbers(3),
            internals["tangential_distortion"].numbers(2),
        )
        values = dict(zip(("k1", "k2", "k3", "p1", "p2"), (*radial, *tangential), strict=True))
        known = {f"brown-forward:{key}": value for key, value in values.items() if value}
        centre = (column - 0.5 * columns, 0.5 * rows - row)
        found[names[number]] = PixelCamera(columns, rows, c, centre, known)
    if not found:
        raise InputError("There is no sensor in the project.", "Export the input cameras, too.", path)
    return found


def read_opf_control(path: Path) -> ControlRecords:
    """Read the control and check points.

    Raises
    ------
    InputError
        If the project is damaged, or its points are in several CRSs.
    """
    points = _Project(path).optional("input_control_points", "input-control-points")
    gcps = points["gcps"].items() if points is not None and points.has("gcps") else []
    point, position, sigma, role = [], [], [], []
    definitions = {}
    for one in gcps:
        place = one["geolocation"]
        definitions[place["crs"]["definition"].text()] = place["crs"]
        point.append(one["id"].text())
        position.append(place["coordinates"].numbers(3))
        sigma.append([abs(value) or float("nan") for value in place["sigmas"].numbers(3)])
        role.append("check" if one.has("is_checkpoint") and one["is_checkpoint"].value is True else "control")
    if len(definitions) > 1:
        raise InputError("Control points are in several CRSs.", "Export them in one.", file=path)
    at, crs = list(range(1, len(point) + 1)), None
    values, sigmas = np.array(position).reshape(-1, 3), np.array(sigma).reshape(-1, 3)
    for stated in definitions.values():
        crs = _crs(stated)
        values, sigmas = _east_north(crs, values), _east_north(crs, sigmas)
    states = FileStatement(crs=None if crs is None else "local" if crs.is_engineering else crs.to_wkt())
    return control_of(path, point, values, at, role=role, sigma=sigmas.tolist(), states=states)


def read_opf_image_points(path: Path) -> ImagePointRecords:
    """Read the marks of control, check and manual tie points, and the matches of the sparse cloud.

    Raises
    ------
    InputError
        If the project is damaged, or has no mark.
    """
    project = _Project(path)
    names = project.images()
    points = project.optional("input_control_points", "input-control-points")
    image, point, xy = LongNames(), LongNames(), array("d")
    for kind in ("gcps", "mtps"):
        for one in points[kind].items() if points is not None and points.has(kind) else []:
            for mark in one["marks"].items():
                image.append(_named(mark["camera_id"], names))
                point.append(one["id"].text())
                xy.extend(mark["position_px"].numbers(2))
    tracks = project.tracks()
    if tracks is not None:
        for number, tie in zip(tracks.camera, tracks.point.tolist(), strict=True):
            image.append(_name_of(number, names, path))
            point.append(f"tie{tie + 1}")
        xy.frombytes(tracks.xy.tobytes())
    table = table_of(xy, 2)
    return image_points_of(path, image.column(), point.column(), table, range(1, len(table) + 1))


class _Project:
    """Items of a project by their types."""

    def __init__(self, path: Path) -> None:
        self._folder: PackedFolder = packed_folder(path)
        found = [name for name in self._folder.members if name.lower().endswith(".opf")]
        if len(found) != 1:
            raise InputError(
                f"The packed folder has {len(found)} files *.opf, and one is read.",
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
                "Export it, too.",
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
        listed = list(names.values())
        return {
            number: name if listed.count(name) == 1 else f"{name} {number}" for number, name in names.items()
        }


def _captures(
    path: Path, project: _Project, names: Mapping[int, str], sensors: Mapping[int, str]
) -> ExposureRecords:
    """Positions of captures of one camera, and ω, φ, κ where they are given."""
    image, camera, position, angles, sigma, definitions = [], [], [], [], [], {}
    nothing = [float("nan")] * 3
    for capture in project.one("input_cameras", "input-cameras")["captures"].items():
        if not capture.has("geolocation") or len(capture["cameras"].items()) != 1:
            continue
        place, one = capture["geolocation"], capture["cameras"].items()[0]
        definitions[place["crs"]["definition"].text()] = place["crs"]
        image.append(_named(one["id"], names))
        camera.append(_named(one["sensor_id"], sensors))
        position.append(place["coordinates"].numbers(3))
        sigma.append(place["sigmas"].numbers(3))
        turn = capture["orientation"] if capture.has("orientation") else None
        is_opk = turn is not None and turn["type"].text() == "omega_phi_kappa"
        angles.append(turn["angles_deg"].numbers(3) if turn is not None and is_opk else nothing)
    if len(definitions) != 1:
        raise InputError(
            f"No camera is calibrated, and the captures are in {len(definitions)} CRSs.",
            "Export the calibrated cameras, or captures of single cameras with positions in one CRS.",
            file=path,
        )
    crs = _crs(next(iter(definitions.values())))
    states = FileStatement(crs="local" if crs.is_engineering else crs.to_wkt(), order="omega-phi-kappa")
    return exposures_of(
        path,
        image,
        _east_north(crs, np.array(position)),
        angles,
        list(range(1, len(image) + 1)),
        camera=camera,
        sigma_position=_east_north(crs, np.array(sigma)).tolist(),
        unit="deg",
        states=states,
        remarks=("No camera of this OPF project is calibrated: what its captures were given is read.",),
    )


def _named(number: JsonValue, names: Mapping[int, str]) -> str:
    return _name_of(number.whole(), names, number.file, number.where)


def _name_of(number: int, names: Mapping[int, str], file: Path, where: str | None = None) -> str:
    found = names.get(number)
    if found is None:
        raise InputError(
            f"There is no camera or sensor {number} in the lists of the project.",
            "Export the project again.",
            file=file,
            entity=where,
        )
    return found


def _pair(value: JsonValue) -> list[JsonValue]:
    value.numbers(2)
    return value.items()


def _shift(scene: JsonValue) -> Floats:
    """Canonical − (east, north, up): canonical axes are right-handed, whatever those of the CRS are."""
    frame = scene["base_to_canonical"]
    if any(abs(value - 1.0) > 1e-12 for value in frame["scale"].numbers(3)):
        raise InputError(
            "The scene has another unit than metres.",
            "Export it in a metric CRS.",
            scene.file,
            entity=frame.where,
        )
    return np.array(frame["shift"].numbers(3))


def _crs(stated: JsonValue) -> pyproj.CRS:
    try:
        return known_crs(stated["definition"].text())
    except InputError as error:
        raise replace(error, file=stated.file) from error


def _east_north(crs: pyproj.CRS, values: Floats) -> Floats:
    """Coordinates (n, 3) in the order of the CRS's own axes as x (east), y (north), z."""
    directions = [axis.direction.lower() for axis in crs.axis_info[:2]]
    return values[:, [1, 0, 2]] if directions == ["north", "east"] else values
