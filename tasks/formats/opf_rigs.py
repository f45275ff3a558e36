"""Rigs of an OPF project: captures of several cameras are events, ``rig_relatives`` of their sensors mount the heads.

The relatives lead from the secondary camera to the reference camera of its capture: T_s = T_r + R_r T_rel, R_s = R_r R_rel with
R_rel = R_x R_y R_z of its angles, axes right, down, front. Calibrated ones come before those of the input. Source: OPF
specification 1.0, "Rig relatives".
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.errors import InputError
from tasks.formats.json_value import JsonValue
from tasks.formats.opf_project import OpfProject, name_of
from tasks.formats.rigs import GivenEvent, GivenHead, Rigs, rigs_of


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
            raise InputError(
                f"Its reference camera {first} is not among its cameras.",
                "Export the project again.",
                path,
                entity=f"capture {capture['id'].whole()}",
            )
        # A camera alone in its capture is its own reference there, whatever rig it belongs to.
        for sensor in cameras.values() if len(cameras) > 1 else ():
            if reference.setdefault(sensor, cameras[first]) != cameras[first]:
                raise InputError(
                    "The sensor has different reference sensors in different captures.",
                    "Export the captures of one rig, with one reference camera.",
                    path,
                    entity=name_of(sensor, sensors, path),
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
