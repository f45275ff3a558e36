"""What is added and approved stands in the registry as it was, in the order and state it should."""

from __future__ import annotations

from datetime import date

import numpy as np
import pytest
from sqlalchemy import select, update

from tasks.errors import InputError
from tasks.registry.approval import approval_of
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.history import Validity
from tasks.registry.registry import Registry, Signature
from tasks.registry.tables import COVARIANCES, PARAMETERS, SCHEMA
from tasks.settings.camera_identity import CameraIdentity
from tests.tasks.registry.records import (
    ENGINEER,
    NAMES,
    SIGMAS,
    VALUES,
    add,
    approve,
    changed,
    covariance,
    record,
)

SPRING, SUMMER, AUTUMN = date(2024, 3, 1), date(2024, 6, 1), date(2024, 9, 1)


def test_a_record_comes_back_with_its_content_to_the_byte(registry: Registry) -> None:
    sealed = SealedRecord.of(record())
    added = registry.add(sealed, ENGINEER)
    found = registry.calibration(str(added.id))
    assert found.sealed.content == sealed.content
    assert found.record == record()
    assert found.sealed.digest == record().digest
    assert (found.state, found.version, found.validity) == ("draft", 1, None)
    assert (found.events[0].person, found.events[0].note) == ("ann", ENGINEER.note)
    assert registry.calibration(record().digest[:10]).id == added.id
    assert not registry.verified().findings


def test_parameters_and_full_covariance_can_be_queried(registry: Registry) -> None:
    number = add(registry, record()).id
    with registry.database.reading() as connection:
        rows = connection.execute(select(PARAMETERS).where(PARAMETERS.c.calibration == number)).all()
        pairs = connection.execute(select(COVARIANCES)).all()
    by_name = {row.parameter: row for row in rows}
    assert [by_name[name].value for name in NAMES] == VALUES.tolist()
    assert [by_name[name].sigma for name in NAMES] == SIGMAS.tolist()
    assert by_name["lever_arm_x"].sigma is None
    matrix = np.full((5, 5), np.nan)
    for row in pairs:
        if {row.parameter_a, row.parameter_b} <= set(NAMES):
            i, j = NAMES.index(row.parameter_a), NAMES.index(row.parameter_b)
            matrix[i, j] = matrix[j, i] = row.covariance
    np.testing.assert_array_equal(matrix, covariance())


def test_versions_are_counted_for_each_camera(registry: Registry) -> None:
    head = CameraIdentity(body="UC-E-1", imu="I-7", product="camera_head")
    versions = [
        add(registry, item).version
        for item in (
            record(),
            record(changed(1), name="another name of the same body"),
            record(identity=CameraIdentity(body="UC-E-2")),
            record(identity=head),
            record(name="A", identity=CameraIdentity()),
            record(name="B", identity=CameraIdentity()),
            record(changed(2), identity=CameraIdentity(body="UC-E-1", imu="I-8")),
        )
    ]
    assert versions == [1, 2, 1, 1, 1, 1, 3]


def test_the_same_calibration_is_added_once(registry: Registry) -> None:
    add(registry, record())
    with pytest.raises(InputError, match=r"already in the registry: it is calibration 1 .*added by ann"):
        add(registry, record())
    assert len(registry.contents().calibrations) == 1


def test_an_approval_supersedes_what_held_from_its_first_day_on(registry: Registry) -> None:
    for number in range(2):
        add(registry, record(changed(number)))
    assert approve(registry, 1, SPRING).validity == Validity(SPRING)
    assert approve(registry, 2, AUTUMN).state == "approved"
    old = registry.calibration("1")
    assert old.state == "superseded"
    assert old.validity == Validity(SPRING, date(2024, 8, 31))
    assert old.events[-1].successor == 2
    assert [event.state for event in old.events] == ["draft", "approved", "superseded"]
    assert not registry.verified().findings


def test_what_is_left_of_a_validity_can_be_taken_too(registry: Registry) -> None:
    for number in range(3):
        add(registry, record(changed(number)))
    approve(registry, 1, SPRING)
    approve(registry, 2, AUTUMN)
    approve(registry, 3, SUMMER, date(2024, 8, 31))
    assert registry.calibration("1").validity == Validity(SPRING, date(2024, 5, 31))
    assert registry.calibration("2").validity == Validity(AUTUMN)
    assert not registry.verified().findings


def test_a_new_evaluation_from_the_same_day_leaves_nothing_of_the_old_one(registry: Registry) -> None:
    for number in range(2):
        add(registry, record(changed(number)))
    approve(registry, 1, SPRING)
    approve(registry, 2, SPRING)
    assert registry.calibration("1").validity is None


def test_another_mounting_supersedes_nothing(registry: Registry) -> None:
    add(registry, record())
    add(registry, record(identity=CameraIdentity(body="UC-E-1", imu="I-8")))
    approve(registry, 1, SPRING)
    approve(registry, 2, SUMMER)
    assert registry.calibration("1").validity == Validity(SPRING)


def test_an_approval_that_would_begin_before_another_is_refused(registry: Registry) -> None:
    for number in range(2):
        add(registry, record(changed(number)))
    approve(registry, 1, AUTUMN)
    with pytest.raises(InputError, match="later than 2024-03-01") as error:
        approve(registry, 2, SPRING)
    assert "--from 2024-09-01" in error.value.remedy
    approve(registry, 2, SPRING, date(2024, 8, 31))
    assert registry.calibration("1").state == "approved"


def test_nobody_approves_twice_or_against_the_verdict_without_a_reason(registry: Registry) -> None:
    add(registry, record(verdict="refused", reasons=("One height only.",)))
    with pytest.raises(InputError, match="refused by the acceptance test: One height only"):
        approve(registry, 1, SPRING)
    approve(registry, 1, SPRING, although="the test field is closed")
    assert registry.calibration("1").events[-1].although == "the test field is closed"
    with pytest.raises(InputError, match="approved already, by ben on"):
        approve(registry, 1, SUMMER)


def test_two_who_approve_different_successors_get_a_conflict(registry: Registry) -> None:
    for number in range(3):
        add(registry, record(changed(number)))
    approve(registry, 1, SPRING)
    seen = registry.contents()
    mine, yours = (approval_of(seen, number, Validity(SUMMER)) for number in "23")
    registry.approve(mine, Signature("cid"))
    with pytest.raises(
        InputError, match=r"In the meantime, cid has approved calibration 2 .* nothing was changed"
    ):
        registry.approve(yours, Signature("dot"))
    assert [registry.calibration(number).state for number in "123"] == ["superseded", "approved", "draft"]
    # Having looked at it, the second one may decide otherwise.
    approve(registry, 3, SUMMER)
    assert [registry.calibration(number).state for number in "123"] == [
        "superseded",
        "superseded",
        "approved",
    ]


def test_tables_of_another_version_are_refused(registry: Registry) -> None:
    add(registry, record())
    with registry.database.writing() as connection:
        connection.execute(update(SCHEMA).values(version=2))
    for action in (registry.contents, lambda: add(registry, record(changed(1)))):
        with pytest.raises(
            InputError, match="tables of version 2, but this version of aerocal uses version 1"
        ):
            action()


def test_a_registry_that_does_not_exist_is_not_made_by_reading(registry: Registry) -> None:
    with pytest.raises(InputError, match="There is no registry at"):
        registry.contents()
    file = registry.database.address.file
    assert file is None or not file.exists()


def test_records_are_found_by_number_digest_and_camera_or_the_nearest_is_named(registry: Registry) -> None:
    add(registry, record())
    add(registry, record(identity=CameraIdentity(body="UC-E-2", lens="L-9")))
    contents = registry.contents()
    assert [item.id for item in contents.of_camera("UC-E-1")] == [1]
    assert [item.id for item in contents.of_camera("L-9")] == [2]
    with pytest.raises(InputError, match="'UCE' matches 2 cameras") as error:
        contents.of_camera("UCE")
    assert "UC-E-2" in error.value.remedy
    with pytest.raises(InputError, match="no calibration of a camera 'UC-E-11'") as error:
        contents.of_camera("UC-E-11")
    assert "Did you mean 'UC-E-1'?" in error.value.remedy
    with pytest.raises(InputError, match="no calibration '7'"):
        contents.calibration("7")
