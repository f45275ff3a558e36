"""Cameras of a project with the values of the approved calibrations of the registry in place of their own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from adjust.rig import RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from tasks.calibration.head_boresight import OF_REFERENCE
from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.deliveries.cameras import camera_record
from tasks.georeferencing.approved_calibrations import approved_calibrations
from tasks.georeferencing.calibrated_cameras import of_one_flight
from tasks.quantities import entity_kind, is_additional, kind_of
from tasks.registry.identity import CameraBody
from tasks.settings.cameras import REGISTRY, RIG_REGISTRY, CalibrationCovariance, CameraInput
from tasks.settings.project import Project

_ANGLES = ("roll", "pitch", "yaw")


def with_registered_cameras(project: Project) -> Project:
    """The project, its cameras with `calibration = "registry"` filled from the registry.

    The settings of such a camera then name the record by its digest, so that everything that depends on the
    camera is computed again when another calibration holds, and reports show which one it was.

    Raises
    ------
    InputError
        If the project has no date, or the registry no calibration for a camera: it names the near ones.
    InstallationError
        If the registry cannot be reached.
    """
    wanting = {
        name: camera
        for name, camera in project.cameras.items()
        if camera.calibration in (REGISTRY, RIG_REGISTRY)
    }
    if not wanting:
        return project
    cameras = dict(project.cameras)
    for name, found in approved_calibrations(wanting, project.project, project.cameras).items():
        source = (f"{REGISTRY}, {found.label}, {found.standing}", found.sealed.digest)
        one = next(filter(found.record.holds_in_one_flight, found.record.parameters), None)
        if one is not None:
            raise of_one_flight(name, one.entity)
        recorded = {name: found.record.camera.name}
        if wanting[name].calibration == RIG_REGISTRY:
            body, rig = CameraBody.of_calibration(found.record), CameraBody.of_rig(name, project.cameras)
            own = rig.heads_by_key
            recorded |= {own[key].name: head.name for key, head in body.heads_by_key.items()}
        for camera, entity in recorded.items():
            cameras[camera] = _filled(cameras[camera], found.record, entity, source)
        known = _covariance(found.record, {entity: camera for camera, entity in recorded.items()})
        if wanting[name].head is not None:
            kept = [k for k, item in enumerate(known.parameters) if kind_of(item) not in OF_REFERENCE]
            known = known.only(kept)
        cameras[name] = cameras[name].known_with(known)
    return project.model_copy(update={"cameras": cameras})


def _filled(
    camera: CameraInput, record: CalibrationRecord, entity: str, source: tuple[str, str]
) -> CameraInput:
    """A camera with the values of a camera of a record; others are left unchanged.

    Additional parameters are one function: those of the record replace all that were given. Boresight and
    lever arm of a head follow from those of its reference head.

    Parameters
    ----------
    source : where the values come from, and the digest of the record.
    """
    image = camera_record(camera)
    values = {item.parameter: item.value for item in record.parameters if item.entity == entity}
    lost = sorted({**image.additional_parameters, **camera.additional_parameters}.keys() - values.keys())
    replaced = (f"in place of {', '.join(lost)} as given in the project",) if lost else ()
    given = image.principal_point_mm
    mounting: dict[str, object] = {
        "boresight_deg": _triple(values, "boresight", _ANGLES, camera.boresight_deg),
        "lever_arm_m": _triple(values, "lever_arm", tuple("xyz"), camera.lever_arm_m),
        "reduced_by_m": camera.lever_arm_m if camera.reduced_by_m is None else camera.reduced_by_m,
    }
    if camera.head is not None:
        head = camera.head
        offset = values.get(SYNCHRONISATION_OFFSET, head.synchronisation_offset_s)
        relative = {
            "rotation_deg": _triple(values, RELATIVE_ROTATION, _ANGLES, head.rotation_deg),
            "position_m": _triple(values, RELATIVE_POSITION, tuple("xyz"), head.position_m),
            "synchronisation_offset_s": offset,
        }
        mounting = {"head": head.model_copy(update=relative)}
    return camera.model_copy(
        update={
            "file": None,
            "format": None,
            "columns": image.columns,
            "rows": image.rows,
            "pixel_um": image.pixel_um,
            "focal_length_mm": values.get("focal_length", image.focal_length_mm),
            "principal_point_mm": tuple(
                values.get(f"principal_point_{axis}", given[k]) for k, axis in enumerate("xy")
            ),
            "additional_parameters": {key: value for key, value in values.items() if is_additional(key)},
            **mounting,
            "calibration": ", ".join((source[0], *replaced, source[1])),
        }
    )


def _covariance(record: CalibrationRecord, named: Mapping[str, str]) -> CalibrationCovariance:
    """The record's covariance of cameras and their mounting; shifts and times belong to its flight.

    Parameters
    ----------
    named : entity of the record → camera of the project.
    """
    own = [k for k, item in enumerate(record.estimated) if item.entity in named and _is_of_camera(item)]
    matrix = record.covariance_matrix[np.ix_(own, own)]
    items = [record.estimated[k] for k in own]
    cameras = tuple(named[item.entity] for item in items) if len(named) > 1 else ()
    return CalibrationCovariance(
        tuple(item.parameter for item in items), tuple(tuple(row) for row in matrix.tolist()), cameras
    )


def _is_of_camera(item: CalibratedParameter) -> bool:
    return entity_kind(item.parameter) == "camera"


def with_initial_calibrations(project: Project) -> Project:
    """The project as a calibration flight uses it: the registry only provides initial values.

    A calibration that took over what the registry knows would confirm itself. What a rig does not estimate,
    such as the interior orientation of heads that were calibrated before, is considered.
    """
    cameras = {
        name: _initial(camera, project) if camera.covariance is not None else camera
        for name, camera in project.cameras.items()
    }
    return project.model_copy(update={"cameras": cameras})


def _initial(camera: CameraInput, project: Project) -> CameraInput:
    known, free = camera.covariance, {*project.calibration.free, *project.adjustment.free}
    offered = bool(project.adjustment.self_calibration.parameters)
    kept = []
    if project.has_heads and known is not None:
        names = enumerate(known.parameters)
        kept = [k for k, one in names if not (offered if is_additional(one) else kind_of(one) in free)]
    if not kept or known is None:
        return camera.model_copy(update={"calibration_use": "held"})
    return camera.model_copy(update={"calibration_use": "consider"}).known_with(known.only(kept))


def _triple(
    values: Mapping[str, float], name: str, parts: tuple[str, ...], given: tuple[float, float, float]
) -> tuple[float, ...]:
    return tuple(values.get(f"{name}_{part}", given[k]) for k, part in enumerate(parts))
