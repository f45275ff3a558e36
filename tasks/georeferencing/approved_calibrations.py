"""The approved calibrations of the registry for the cameras and the date of a project.

This is not a stored stage: the registry may say something else the next time. What was chosen goes into the
key of the stage that applies it.
"""

from __future__ import annotations

from collections.abc import Mapping

from tasks.errors import InputError
from tasks.georeferencing.registered_calibration import RegisteredCalibration
from tasks.registry.contents import StoredCalibration
from tasks.settings.cameras import RIG_REGISTRY, CameraInput
from tasks.settings.inputs import ControlInput
from tasks.settings.project import ProjectSettings
from tasks.store.artifact import Artifact, digest_of_file
from tasks.tables.parquet import read_table


def choose_calibrations(
    *,
    exposures: Artifact,
    cameras: Mapping[str, CameraInput],
    control: tuple[ControlInput, ...],
    project: ProjectSettings,
) -> tuple[RegisteredCalibration, ...]:
    """The calibration that applies to each camera of the exposures on the day of the flight.

    Raises
    ------
    InputError
        If the project has no date, or the registry no calibration for a camera: it names the near ones.
    InstallationError
        If the registry cannot be reached.
    """
    own_control = {digest_of_file(item.file) for item in control}
    used = sorted(set(read_table(exposures)["camera"]))
    chosen = []
    for name, found in approved_calibrations({name: cameras[name] for name in used}, project).items():
        sentence = f"The camera {name} has {found.label} of the registry, {found.standing}."
        shares = bool(own_control & set(found.record.inputs.values()))
        chosen.append(
            RegisteredCalibration(name, found.sealed.content, found.sealed.digest, sentence, shares)
        )
    return tuple(chosen)


def approved_calibrations(
    cameras: Mapping[str, CameraInput],
    project: ProjectSettings,
    rigs: Mapping[str, CameraInput] | None = None,
) -> dict[str, StoredCalibration]:
    """For each camera, the calibration approved in the registry for the day of the flight.

    Parameters
    ----------
    rigs : all cameras of the project, if some of `cameras` have the calibration of their rig.

    The registry is the one that AEROCAL_REGISTRY names, else that of this user.

    Raises
    ------
    InputError
        If the project has no date, or the registry no calibration for a camera: it names the near ones.
    InstallationError
        If the registry cannot be reached.
    """
    # Nobody else needs a database.
    from tasks.registry.choice import chosen_calibration
    from tasks.registry.identity import CameraBody
    from tasks.registry.registry import Registry
    from tasks.settings.registry import registry_address

    if project.flown is None:
        raise InputError(
            "The calibration is to come from the registry, and the project does not say when it was flown.",
            "Give the date, e.g. flown = 2026-05-24.",
            entity="project.flown",
        )
    contents = Registry.at(registry_address()).contents()
    bodies = {
        name: CameraBody.of_rig(name, rigs or {})
        if camera.calibration == RIG_REGISTRY
        else CameraBody.of_project(name, camera)
        for name, camera in cameras.items()
    }
    return {name: chosen_calibration(contents, body, project.flown) for name, body in bodies.items()}
