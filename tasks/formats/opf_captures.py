"""What an OPF project was given: positions and orientations of its captures, before any calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import Location
from tasks.formats.json_value import JsonValue
from tasks.formats.long_columns import LongRows
from tasks.formats.opf_project import OpfProject, canonical_shift, crs_of, east_north, name_of, named
from tasks.formats.records import ExposureRecords, FileStatement
from tasks.formats.rigs import GivenEvent, GivenHead, Rigs, rigs_of

_GIVEN = "No camera of this OPF project is calibrated: the values given for its captures are used."


def captures_of(
    path: Path, project: OpfProject, names: Mapping[int, str], sensors: Mapping[int, str]
) -> ExposureRecords:
    """Positions of captures of one camera, and ω, φ, κ where they are given."""
    rows, definitions = LongRows("position", "sigma_position", "angles"), {}
    nothing = [float("nan")] * 3
    for capture in project.one("input_cameras", "input-cameras")["captures"].items():
        if not capture.has("geolocation") or len(capture["cameras"].items()) != 1:
            continue
        place, one = capture["geolocation"], capture["cameras"].items()[0]
        definitions[place["crs"]["definition"].text()] = place["crs"]
        name, camera = named(one["id"], names), named(one["sensor_id"], sensors)
        position, sigma = place["coordinates"].numbers(3), place["sigmas"].numbers(3)
        turn = capture["orientation"] if capture.has("orientation") else None
        is_opk = turn is not None and turn["type"].text() == "omega_phi_kappa"
        angles = turn["angles_deg"].numbers(3) if turn is not None and is_opk else nothing
        rows.append(name, position, sigma, angles, text=camera)
    if len(definitions) != 1:
        raise Location(path).error(
            f"No camera is calibrated, but the captures are in {len(definitions)} CRSs.",
            "Export the calibrated cameras, or captures of single cameras with positions in one CRS.",
        )
    crs = crs_of(next(iter(definitions.values())))
    states = FileStatement(crs="local" if crs.is_engineering else crs.to_wkt(), order="omega-phi-kappa")
    parts: dict[str, Any] = {part: east_north(crs, rows[part]) for part in ("position", "sigma_position")}
    return rows.exposures(path, states, unit="deg", remarks=(_GIVEN,), **parts)


def projected_captures_of(
    path: Path,
    project: OpfProject,
    projected: JsonValue,
    names: Mapping[int, str],
    sensors: Mapping[int, str],
) -> ExposureRecords:
    """Positions and ω, φ, κ of captures of one camera in the CRS of the scene, with their σ."""
    scene = project.one("scene_reference_frame", "scene-reference-frame")
    crs, shift = crs_of(scene["crs"]), canonical_shift(scene)
    captures = project.one("input_cameras", "input-cameras")["captures"].items()
    given = {one["id"].whole(): one["cameras"].items() for one in captures}
    rows = LongRows("position", "sigma_position", "angles", "sigma_angles")
    for capture in projected["captures"].items():
        cameras = given.get(capture["id"].whole(), [])
        if len(cameras) == 1:
            rows.append(
                named(cameras[0]["id"], names),
                _numbers(capture, "geolocation", "position"),
                _numbers(capture, "geolocation", "sigmas"),
                _numbers(capture, "orientation", "angles_deg"),
                _numbers(capture, "orientation", "sigmas_deg"),
                text=named(cameras[0]["sensor_id"], sensors),
            )
    local = crs.is_engineering
    states = FileStatement(
        crs="local" if local else crs.to_wkt(),
        order="omega-phi-kappa",
        reference="local" if local else "grid",
    )
    centre = rows["position"] - shift
    return rows.exposures(path, states, unit="deg", remarks=(_GIVEN,), position=centre)


def _numbers(capture: JsonValue, kind: str, key: str) -> list[float]:
    """Three numbers; NaN where the capture has none of this kind."""
    return capture[kind][key].numbers(3) if capture.has(kind) else [float("nan")] * 3


def opf_rigs(
    path: Path,
    project: OpfProject,
    calibrated: JsonValue,
    names: Mapping[int, str],
    sensors: Mapping[int, str],
) -> Rigs:
    """The rigs of a project whose captures have several cameras.

    Parameters
    ----------
    calibrated : its calibrated cameras.
    names, sensors : identifiers of cameras and sensors → names.

    Raises
    ------
    InputError
        If a capture has no reference camera, or an identifier is unknown; as of `tasks.formats.rigs`.
    """
    given = project.one("input_cameras", "input-cameras")
    if all(len(one["cameras"].items()) < 2 for one in given["captures"].each()):
        return Rigs()
    captures = [(one, _cameras(one)) for one in given["captures"].each()]
    reference: dict[int, int] = {}
    for capture, cameras in captures:
        first = capture["reference_camera_id"].whole()
        if first not in cameras:
            raise Location(path, entity=f"capture {capture['id'].whole()}").error(
                f"Its reference camera {first} is not among its cameras.", "Export the project again."
            )
        # A camera alone in its capture is its own reference there, whatever rig it belongs to.
        for sensor in cameras.values() if len(cameras) > 1 else ():
            if reference.setdefault(sensor, cameras[first]) != cameras[first]:
                raise Location(path, entity=name_of(sensor, sensors, path)).error(
                    "The sensor has different reference sensors in different captures.",
                    "Export the captures of one rig, with one reference camera.",
                )
    events = [
        GivenEvent(
            f"capture {capture['id'].whole()}",
            str(reference.get(sensor, sensor)),
            # A camera that is not in the list is refused under its number.
            tuple(
                (names.get(camera, f"{camera}"), name_of(of, sensors, path)) for camera, of in cameras.items()
            ),
        )
        for capture, cameras in captures
        for sensor in list(cameras.values())[:1]
    ]
    mounted = {**dict(_mountings(given["sensors"])), **dict(_mountings(calibrated["sensors"]))}
    heads = [
        GivenHead(
            name_of(number, sensors, path),
            str(reference.get(number, number)),
            mounted.get(number) if reference.get(number, number) != number else (np.eye(3), np.zeros(3)),
            is_reference=reference.get(number, number) == number,
        )
        for number in (one["id"].whole() for one in given["sensors"].each())
    ]
    return rigs_of(path, heads, events, set(names.values()))


def _cameras(capture: JsonValue) -> dict[int, int]:
    """Identifier of every camera of a capture → that of its sensor."""
    return {one["id"].whole(): one["sensor_id"].whole() for one in capture["cameras"].each()}


def _mountings(sensors: JsonValue) -> Iterator[tuple[int, tuple[Floats, Floats]]]:
    """Identifier of a sensor, and its rotation and place; of input or calibrated sensors."""
    for sensor in sensors.each():
        if not sensor.has("rig_relatives"):
            continue
        one = sensor["rig_relatives"]
        if one.has("rotation_angles_deg"):
            angles, place = one["rotation_angles_deg"].numbers(3), one["translation"].numbers(3)
        else:
            angles = one["rotation"]["angles_deg"].numbers(3)
            place = one["translation"]["values_m"].numbers(3)
        yield sensor["id"].whole(), (from_omega_phi_kappa(np.radians(angles)), np.array(place))
