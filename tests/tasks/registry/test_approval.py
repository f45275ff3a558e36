"""What an approval is compared with, and which records are one camera, one mounting, one number."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta

import pytest

from tasks.errors import InputError
from tasks.registry.approval import approval_of
from tasks.registry.contents import Contents, StoredCalibration
from tasks.registry.history import Validity
from tasks.registry.identity import CameraBody
from tasks.registry.series import series_of
from tasks.settings.camera_identity import CameraIdentity
from tests.tasks.registry.records import SIGMAS, VALUES, changed, record, stored

FIRST = date(2020, 6, 1)  # from when on every stored calibration is approved
OTHER_MOUNTING = CameraIdentity(body="UC-E-1", imu="I-8")


def contents(*items: StoredCalibration) -> Contents:
    return Contents(items, (), tuple(event for item in items for event in item.events))


def draft(number: int, **changes: object) -> StoredCalibration:
    return stored(number, record(changed(number), **changes), approved=False)  # type: ignore[arg-type]


def predecessor(known: Contents, number: int, start: date, end: date | None = None) -> int | None:
    before = approval_of(known, str(number), Validity(start, end)).predecessor
    return None if before is None else before.id


def test_one_that_holds_from_the_same_day_on_is_the_one_before() -> None:
    known = contents(stored(1, record()), draft(2))
    assert predecessor(known, 2, FIRST) == 1
    assert predecessor(known, 2, FIRST, FIRST) == 1


def test_of_another_mounting_one_is_compared_only_where_there_is_none_of_the_same() -> None:
    later = stored(2, record(changed(2), identity=OTHER_MOUNTING))
    (added, approved) = later.events
    later = replace(later, events=(added, replace(approved, valid_from="2021-06-01")))
    known = contents(stored(1, record()), later, draft(3))
    assert predecessor(known, 3, date(2022, 1, 1)) == 1
    assert predecessor(contents(later, draft(3)), 3, date(2022, 1, 1)) == 2


def test_a_validity_may_be_one_day_and_not_less() -> None:
    known = contents(draft(1))
    assert approval_of(known, "1", Validity(FIRST, FIRST)).validity.end == FIRST
    with pytest.raises(InputError, match="before it begins"):
        approval_of(known, "1", Validity(FIRST, FIRST - timedelta(days=1)))


def test_eight_digits_of_a_digest_name_a_record_and_seven_do_not() -> None:
    known = contents(draft(1), draft(2))
    digest = known.calibrations[1].sealed.digest
    assert known.calibration(digest[:8]).id == 2
    with pytest.raises(InputError, match="There is no calibration"):
        known.calibration(digest[:7])


def test_band_and_angle_of_the_mount_tell_cameras_and_mountings_apart() -> None:
    camera = CameraBody.of_record(record().camera)
    assert replace(camera, mount_deg=90).mounting_key != camera.mounting_key
    infrared = CameraIdentity(body="UC-E-1", imu="I-7", band="nir")
    assert replace(camera, identity=infrared).camera_key != camera.camera_key


def test_a_change_is_new_less_old_with_the_sigma_of_both_and_none_of_another_mounting() -> None:
    moved = VALUES + SIGMAS
    items = [
        stored(1, record(flown=date(2020, 5, 1))),
        stored(2, record(moved, flown=date(2021, 5, 1), scale=2.0)),
        stored(3, record(flown=date(2022, 5, 1), identity=OTHER_MOUNTING)),
    ]
    series = {one.parameter: one for one in series_of(items)}
    change = series["focal_length"].change(1)
    assert change == pytest.approx((SIGMAS[0], SIGMAS[0] * 5.0**0.5))
    assert series["focal_length"].change(0) is None
    assert series["boresight_roll"].change(1) is not None
    assert series["boresight_roll"].change(2) is None
