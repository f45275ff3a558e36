"""OPF 1.0, Pix4D's open photogrammetry format: the folder of a project, packed into one zip file.

| item | read |
|---|---|
| ``calibrated_cameras`` | positions and ω, φ, κ in the CRS of the scene, base_to_canonical undone; cameras in pixels from the corner |
| ``input_cameras`` | sizes and names of the sensors; where nothing is calibrated, positions of the captures and their ω, φ, κ |
| ``projected_input_cameras`` | instead of these, where it is there: both in the CRS of the scene, with σ |
| ``input_control_points`` | control and check points; marks of these and of manual tie points (pixel_origin = "corner") |
| ``constraints`` | distances between control or tie points (``scale_constraints``) |
| ``gps_bias`` | reported: calibrated positions do not have it |
| sparse cloud of ``calibration`` | tie points with their matches, called tie1, tie2, … in its order |

Images go by their file names. Yaw, pitch and roll of captures are not read: how the axes of the body lie is
not in the file. Captures of several calibrated cameras are events of a rig (``opf_rigs``).
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import Location
from tasks.formats.json_value import JsonValue
from tasks.formats.long_columns import LongPoints, LongRows
from tasks.formats.opf_captures import captures_of, opf_rigs, projected_captures_of
from tasks.formats.opf_project import OpfProject, canonical_shift, crs_of, east_north, name_of, named
from tasks.formats.plain_records import (
    CV_AXES,
    degrees_of_rotations,
    distances_of,
    pieces_of,
)
from tasks.formats.records import (
    AngleOrder,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    FileStatement,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.rigs import with_rigs

_IN_MAP = (
    "The orientations of this OPF project were adjusted in map coordinates treated as Cartesian: they "
    "are not true camera positions."
)


def read_opf_exposures(path: Path, _order: AngleOrder) -> ExposureRecords:
    """Read the calibrated cameras, or the captures of a project without any.

    Raises
    ------
    InputError
        If the project is damaged, or its scene is scaled.
    """
    project = OpfProject(path)
    names, sensors = project.images(), project.sensor_names()
    calibrated = project.optional("calibration", "calibrated-cameras")
    if calibrated is None:
        projected = project.optional("projected_input_cameras", "projected-input-cameras")
        if projected is None:
            return captures_of(path, project, names, sensors)
        return projected_captures_of(path, project, projected, names, sensors)
    rows = LongRows("position", "angles")
    for one in calibrated["cameras"].taken():
        name, camera = named(one["id"], names), named(one["sensor_id"], sensors)
        rows.append(name, one["position"].numbers(3), one["orientation_deg"].numbers(3), text=camera)
    scene = project.one("scene_reference_frame", "scene-reference-frame")
    shift = canonical_shift(scene)
    rigs = opf_rigs(path, project, calibrated, names, sensors)
    del calibrated
    crs = crs_of(scene["crs"])
    local = crs.is_engineering
    states = FileStatement(crs="local" if local else crs.to_wkt(), order="omega-phi-kappa")
    # Angles as they are derived from a rotation: ω and κ within half a turn.
    degrees, stated = np.empty_like(rows["angles"]), rows["angles"]
    for piece in pieces_of(len(degrees)):
        turn = from_omega_phi_kappa(np.radians(stated[piece]))
        degrees[piece] = degrees_of_rotations(path, turn, rows.names[piece], rows.line[piece])
    remarks = (*(() if local else (_IN_MAP,)), *_gps_bias(project))
    centre = rows["position"] - shift
    records = rows.exposures(path, states, unit="deg", remarks=remarks, position=centre, angles=degrees)
    if not (rigs.heads or rigs.remarks):
        return records
    return with_rigs(records, rigs, centre, from_omega_phi_kappa(np.radians(stated)) @ CV_AXES)


def read_opf_cameras(path: Path) -> Mapping[str, PixelCamera]:
    """Read the sensors, as calibrated where they are.

    Raises
    ------
    InputError
        If the project is damaged, or a sensor is not a perspective camera.
    """
    project = OpfProject(path)
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
            raise Location(path, entity=names[number]).error(
                "Only perspective cameras are read.", "Leave it out."
            )
        c = internals["focal_length_px"].number()
        column, row = internals["principal_point_px"].numbers(2)
        if c <= 0.0 or columns == 0 or rows == 0:
            raise Location(path, entity=names[number]).error(
                "A focal length or size is not positive.", "Correct it."
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
        raise Location(path).error("There is no sensor in the project.", "Also export the input cameras.")
    return found


def read_opf_control(path: Path) -> ControlRecords:
    """Read the control and check points.

    Raises
    ------
    InputError
        If the project is damaged, or its points are in several CRSs.
    """
    points = OpfProject(path).optional("input_control_points", "input-control-points")
    gcps = points["gcps"].items() if points is not None and points.has("gcps") else []
    rows, definitions = LongRows("position", "sigma"), {}
    for one in gcps:
        place = one["geolocation"]
        definitions[place["crs"]["definition"].text()] = place["crs"]
        sigma = [abs(value) or float("nan") for value in place["sigmas"].numbers(3)]
        is_check = one.has("is_checkpoint") and one["is_checkpoint"].value is True
        role = "check" if is_check else "control"
        rows.append(one["id"].text(), place["coordinates"].numbers(3), sigma, text=role)
    if len(definitions) > 1:
        raise Location(path).error("Control points are in several CRSs.", "Export them in one.")
    if not definitions:
        return rows.control(path)
    crs = crs_of(next(iter(definitions.values())))
    states = FileStatement(crs="local" if crs.is_engineering else crs.to_wkt())
    parts: dict[str, Any] = {part: east_north(crs, rows[part]) for part in ("position", "sigma")}
    return rows.control(path, states, **parts)


def read_opf_distances(path: Path) -> DistanceRecords:
    """Read the scale constraints, metres.

    Raises
    ------
    InputError
        If the project is damaged, or has none.
    """
    given = OpfProject(path).optional("constraints", "constraints")
    found = given["scale_constraints"].items() if given is not None and given.has("scale_constraints") else []
    numbers = np.array([[one["distance"].number(), one["sigma"].number()] for one in found]).reshape(-1, 2)
    ends = [[one[key].text() for one in found] for key in ("id_from", "id_to")]
    return distances_of(path, ends[0], ends[1], numbers[:, 0], numbers[:, 1])


def read_opf_image_points(path: Path) -> ImagePointRecords:
    """Read the marks of control, check and manual tie points, and the matches of the sparse cloud.

    Raises
    ------
    InputError
        If the project is damaged, or has no mark.
    """
    project = OpfProject(path)
    names = project.images()
    given = project.optional("input_control_points", "input-control-points")
    points = LongPoints()
    for kind in ("gcps", "mtps"):
        for one in given[kind].items() if given is not None and given.has(kind) else []:
            for mark in one["marks"].items():
                image = named(mark["camera_id"], names)
                points.append(image, one["id"].text(), mark["position_px"].numbers(2))
    tracks = project.tracks()
    if tracks is not None:
        for number, tie, xy in zip(tracks.camera, tracks.point.tolist(), tracks.xy, strict=True):
            points.append(name_of(number, names, path), f"tie{tie + 1}", xy)
    return points.records(path)


def _pair(value: JsonValue) -> list[JsonValue]:
    value.numbers(2)
    return value.items()


def _gps_bias(project: OpfProject) -> tuple[str, ...]:
    """The stated offset of GNSS positions from the calibrated ones."""
    bias = project.optional("calibration", "gps-bias")
    if bias is None:
        return ()
    east, north, up = bias["transform"]["translation"].numbers(3)
    turn = bias["transform"]["rotation_deg"].numbers(3)
    return (
        f"This OPF project has a bias of its GNSS positions: shift {east:g}, {north:g}, {up:g} m, rotation "
        f"{turn[0]:g}, {turn[1]:g}, {turn[2]:g}°, scale {bias['transform']['scale'].number():g}. The "
        "positions read here are calibrated ones, without it.",
    )
