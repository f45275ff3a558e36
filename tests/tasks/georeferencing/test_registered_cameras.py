"""Cameras of a project that take their calibration from the registry."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path

import pytest

from tasks.calibration.record import CalibratedCamera, CalibrationRecord
from tasks.deliveries.cameras import taken_from_registry
from tasks.errors import InputError
from tasks.georeferencing.registered_cameras import with_registered_cameras
from tasks.registry.registry import Registry
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tasks.settings.registry import REGISTRY_VARIABLE, registry_address
from tests.tasks.registry.records import VALUES, add, approve, changed, parameter, record

Write = Callable[..., Path]
WANTED = ("cameras.C.calibration=registry", "project.flown=2024-06-01")
#: The camera of the small project.
CAMERA = CalibratedCamera(
    name="recorded so", identity=CameraIdentity(body="B"), columns=100, rows=80, pixel_um=5.0, mount_deg=0
)
BODY = 'cameras.C.identity={body="B"}'


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Registry:
    place = tmp_path / "registry.sqlite"
    monkeypatch.setenv(REGISTRY_VARIABLE, str(place))
    found = Registry.at(registry_address(str(place)))
    add(found, record(name=CAMERA.name, camera=CAMERA))
    approve(found, 1, date(2024, 5, 2))
    return found


def project(write_project: Write, tmp_path: Path, *overrides: str) -> Project:
    return load_project(write_project(tmp_path / "project"), overrides)


def test_a_camera_gets_the_values_of_its_record(
    registry: Registry, write_project: Write, tmp_path: Path
) -> None:
    given = project(write_project, tmp_path, *WANTED, BODY, "cameras.C.lever_arm_m=[0.1, 0.2, 0.4]")
    camera = with_registered_cameras(given).cameras["C"]
    assert camera.focal_length_mm == VALUES[0]
    assert camera.principal_point_mm == (VALUES[1], VALUES[2])
    assert camera.boresight_deg == (VALUES[3], 0.0, 0.0)
    assert camera.additional_parameters == {"bluh:9": VALUES[4]}
    assert camera.lever_arm_m == (0.3, 0.2, 0.4)  # held at 0.3 there, and not spoken of
    assert (camera.columns, camera.pixel_origin, camera.identity.body) == (100, "corner", "B")
    stored = registry.contents().calibrations[0]
    assert camera.calibration == f"registry, {stored.label}, {stored.standing}, {stored.sealed.digest}"
    # The keys of the stages, and with them the results, change with the record.
    assert camera.key_content() != given.cameras["C"].key_content()
    assert with_registered_cameras(given).key_content() == with_registered_cameras(given).key_content()


def test_what_was_taken_is_said_with_who_approved_it_and_what_was_not(
    registry: Registry, write_project: Write, tmp_path: Path
) -> None:
    given = project(write_project, tmp_path, *WANTED, BODY)
    assert taken_from_registry(given.cameras) == ()
    (said,) = taken_from_registry(with_registered_cameras(given).cameras)
    stored = registry.contents().calibrations[0]
    assert said.startswith(f"Camera C has {stored.label}, valid ")
    assert ", approved by ben on " in said
    assert f"c {VALUES[0]:.4f} mm" in said
    assert "A GNSS shift applies only to its own flight" in said
    assert stored.sealed.digest not in said
    assert "as given in the project" not in said


@pytest.mark.usefixtures("registry")
def test_additional_parameters_that_a_record_replaces_are_named(write_project: Write, tmp_path: Path) -> None:
    """They had disappeared, and the documentation said that they remain."""
    both = 'cameras.C.additional_parameters={"brown:K1"=0.1, "bluh:9"=1e-9, "brown:P1"=0.2}'
    camera = with_registered_cameras(project(write_project, tmp_path, *WANTED, BODY, both)).cameras["C"]
    assert camera.additional_parameters == {"bluh:9": VALUES[4]}
    (said,) = taken_from_registry({"C": camera})
    assert ", in place of brown:K1, brown:P1 as given in the project (from the registry): c " in said


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"verdict": "refused", "reasons": ("One height.",)},
            "approved with the reason: the only flight there is",
        ),
        (
            {"verdict": "restricted", "restrictions": ("Strip 3 is off.",)},
            "with restrictions: Strip 3 is off.",
        ),
    ],
)
def test_what_speaks_against_a_calibration_is_said_wherever_it_is_used(
    registry: Registry, changes: dict[str, object], words: str
) -> None:
    given = record(changed(1), name=CAMERA.name, camera=CAMERA)
    add(registry, CalibrationRecord.model_validate({**given.model_dump(), **changes}))
    stored = approve(registry, 2, date(2024, 5, 25), although="the only flight there is")
    assert words in stored.standing


def test_another_approved_calibration_is_another_key(
    registry: Registry, write_project: Write, tmp_path: Path
) -> None:
    given = project(write_project, tmp_path, *WANTED, BODY)
    before = with_registered_cameras(given).key_content()
    add(registry, record(changed(1), name=CAMERA.name, camera=CAMERA))
    assert with_registered_cameras(given).key_content() == before
    approve(registry, 2, date(2024, 5, 20))
    assert with_registered_cameras(given).key_content() != before


def test_without_the_wish_no_registry_is_asked(
    write_project: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(REGISTRY_VARIABLE, str(tmp_path / "nowhere" / "registry.sqlite"))
    given = project(write_project, tmp_path)
    assert with_registered_cameras(given) is given


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ((WANTED[0], BODY), "does not say when it was flown"),
        ((*WANTED, BODY, "project.flown=2024-01-01"), "valid from 2024-05-02"),
        (WANTED, "none for such a camera"),
    ],
)
def test_without_a_fitting_calibration_the_project_is_refused(
    registry: Registry, write_project: Write, tmp_path: Path, overrides: tuple[str, ...], words: str
) -> None:
    assert registry.contents().calibrations
    with pytest.raises(InputError) as error:
        with_registered_cameras(project(write_project, tmp_path, *overrides))
    assert words in error.value.what


def test_another_source_is_an_error_that_names_the_known_ones(write_project: Write, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Did you mean 'registry'"):
        project(write_project, tmp_path, "cameras.C.calibration=regstry")


def test_additional_parameters_of_one_flight_hold_for_no_other(
    registry: Registry, write_project: Write, tmp_path: Path
) -> None:
    one = parameter("bluh:9", "1/mm²", 1e-9, None, f"{CAMERA.name} in 1")
    add(registry, record(name=CAMERA.name, camera=CAMERA, parameters=(one,), covariance=()))
    approve(registry, 2, date(2024, 5, 20))
    with pytest.raises(InputError, match="are valid for that flight only"):
        with_registered_cameras(project(write_project, tmp_path, *WANTED, BODY))
