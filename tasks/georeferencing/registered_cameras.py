"""Cameras of a project with the values of the approved calibrations of the registry in place of their own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tasks.calibration.record import CalibrationRecord
from tasks.deliveries.cameras import camera_record
from tasks.errors import InputError
from tasks.georeferencing.approved_calibrations import approved_calibrations
from tasks.quantities import entity_kind, is_additional
from tasks.settings.cameras import REGISTRY, CalibrationCovariance, CameraInput
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
    wanting = {name: camera for name, camera in project.cameras.items() if camera.calibration == REGISTRY}
    if not wanting:
        return project
    filled = {
        name: _filled(
            name,
            wanting[name],
            found.record,
            f"{REGISTRY}, {found.label}, {found.standing}, {found.sealed.digest}",
        )
        for name, found in approved_calibrations(wanting, project.project).items()
    }
    return project.model_copy(update={"cameras": {**project.cameras, **filled}})


def _filled(name: str, camera: CameraInput, record: CalibrationRecord, source: str) -> CameraInput:
    """A camera with the values of a record; what the record does not refer to stays."""
    image, recorded = camera_record(camera), record.camera.name
    values = {item.parameter: item.value for item in record.parameters if item.entity == recorded}
    if any(map(record.holds_in_one_flight, record.parameters)):
        raise InputError(
            "The calibration from the registry has separate additional parameters for each flight, which "
            "are valid for that flight only.",
            'Calibrate with adjustment.self_calibration.per = "camera".',
            entity=f"cameras.{name}",
        )
    given = image.principal_point_mm
    filled = camera.model_copy(
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
            "boresight_deg": _triple(values, "boresight", _ANGLES, camera.boresight_deg),
            "lever_arm_m": _triple(values, "lever_arm", tuple("xyz"), camera.lever_arm_m),
            "reduced_by_m": camera.lever_arm_m if camera.reduced_by_m is None else camera.reduced_by_m,
            "calibration": source,
        }
    )
    return filled.known_with(_covariance(record))


def _covariance(record: CalibrationRecord) -> CalibrationCovariance:
    """What the record knows of the camera and its mounting; shifts and times belong to its flight."""
    own = [
        k
        for k, item in enumerate(record.estimated)
        if item.entity == record.camera.name and entity_kind(item.parameter) == "camera"
    ]
    matrix = record.covariance_matrix[np.ix_(own, own)]
    return CalibrationCovariance(
        tuple(record.estimated[k].parameter for k in own), tuple(tuple(row) for row in matrix.tolist())
    )


def with_initial_calibrations(project: Project) -> Project:
    """The project as a calibration flight uses it: the registry only says where to begin.

    A calibration that took over what the registry knows would confirm itself.
    """
    cameras = {
        name: camera.model_copy(update={"calibration_use": "held"})
        if camera.covariance is not None
        else camera
        for name, camera in project.cameras.items()
    }
    return project.model_copy(update={"cameras": cameras})


def _triple(
    values: Mapping[str, float], name: str, parts: tuple[str, ...], given: tuple[float, float, float]
) -> tuple[float, ...]:
    return tuple(values.get(f"{name}_{part}", given[k]) for k, part in enumerate(parts))
