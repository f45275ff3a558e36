"""What an OPF project was given: positions and orientations of its captures, before any calibration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tasks.errors import InputError
from tasks.formats.json_value import JsonValue
from tasks.formats.opf_project import OpfProject, canonical_shift, crs_of, east_north, named
from tasks.formats.plain_records import exposures_of
from tasks.formats.records import ExposureRecords, FileStatement

_GIVEN = "No camera of this OPF project is calibrated: the values given for its captures are used."


def captures_of(
    path: Path, project: OpfProject, names: Mapping[int, str], sensors: Mapping[int, str]
) -> ExposureRecords:
    """Positions of captures of one camera, and ω, φ, κ where they are given."""
    image, camera, position, angles, sigma, definitions = [], [], [], [], [], {}
    nothing = [float("nan")] * 3
    for capture in project.one("input_cameras", "input-cameras")["captures"].items():
        if not capture.has("geolocation") or len(capture["cameras"].items()) != 1:
            continue
        place, one = capture["geolocation"], capture["cameras"].items()[0]
        definitions[place["crs"]["definition"].text()] = place["crs"]
        image.append(named(one["id"], names))
        camera.append(named(one["sensor_id"], sensors))
        position.append(place["coordinates"].numbers(3))
        sigma.append(place["sigmas"].numbers(3))
        turn = capture["orientation"] if capture.has("orientation") else None
        is_opk = turn is not None and turn["type"].text() == "omega_phi_kappa"
        angles.append(turn["angles_deg"].numbers(3) if turn is not None and is_opk else nothing)
    if len(definitions) != 1:
        raise InputError(
            f"No camera is calibrated, but the captures are in {len(definitions)} CRSs.",
            "Export the calibrated cameras, or captures of single cameras with positions in one CRS.",
            file=path,
        )
    crs = crs_of(next(iter(definitions.values())))
    states = FileStatement(crs="local" if crs.is_engineering else crs.to_wkt(), order="omega-phi-kappa")
    return exposures_of(
        path,
        image,
        east_north(crs, np.array(position)),
        angles,
        list(range(1, len(image) + 1)),
        camera=camera,
        sigma_position=east_north(crs, np.array(sigma)).tolist(),
        unit="deg",
        states=states,
        remarks=(_GIVEN,),
    )


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
    image, camera, values = [], [], []
    for capture in projected["captures"].items():
        cameras = given.get(capture["id"].whole(), [])
        if len(cameras) == 1:
            image.append(named(cameras[0]["id"], names))
            camera.append(named(cameras[0]["sensor_id"], sensors))
            values.append(
                [
                    *_numbers(capture, "geolocation", "position"),
                    *_numbers(capture, "geolocation", "sigmas"),
                    *_numbers(capture, "orientation", "angles_deg"),
                    *_numbers(capture, "orientation", "sigmas_deg"),
                ]
            )
    position, sigma, angles, sigma_angles = np.hsplit(np.array(values).reshape(-1, 12), 4)
    local = crs.is_engineering
    states = FileStatement(
        crs="local" if local else crs.to_wkt(),
        order="omega-phi-kappa",
        reference="local" if local else "grid",
    )
    return exposures_of(
        path,
        image,
        position - shift,
        angles,
        list(range(1, len(image) + 1)),
        camera=camera,
        sigma_position=sigma,
        sigma_angles=sigma_angles,
        unit="deg",
        states=states,
        remarks=(_GIVEN,),
    )


def _numbers(capture: JsonValue, kind: str, key: str) -> list[float]:
    """Three numbers; NaN where the capture has none of this kind."""
    return capture[kind][key].numbers(3) if capture.has(kind) else [float("nan")] * 3
