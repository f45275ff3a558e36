"""Which cameras are due on a day, on SQLite and PostgreSQL: validity, age, mounting, drift."""

from __future__ import annotations

import json
from datetime import date, timedelta

import pytest
from sqlalchemy import text

from tasks.errors import InputError
from tasks.files.json_text import json_text
from tasks.registry.contents import Contents
from tasks.registry.due import CameraDue, DueLimits, due_of
from tasks.registry.registry import Registry
from tasks.registry.watch import as_json, watch_of
from tasks.settings.camera_identity import CameraIdentity
from tests.tasks.registry.records import SIGMAS, VALUES, add, approve, changed, parameter, record, stored

SPRING, SUMMER, AUTUMN = date(2024, 3, 1), date(2024, 6, 1), date(2024, 9, 1)
FLOWN = date(2024, 5, 2)  # of every record, unless it says otherwise
OTHER_MOUNTING = CameraIdentity(body="UC-E-1", imu="I-8")


def due(registry: Registry, today: date, **limits: object) -> tuple[CameraDue, ...]:
    return due_of(registry.contents(), today, DueLimits(**limits))  # type: ignore[arg-type]


def kinds(registry: Registry, today: date, **limits: object) -> list[str]:
    (one,) = due(registry, today, **limits)
    assert one.is_due is bool(one.reasons)
    return [reason.kind for reason in one.reasons]


def test_a_calibration_in_force_is_not_due_and_says_its_age_and_end(registry: Registry) -> None:
    add(registry, record())
    approve(registry, 1, SPRING)
    (one,) = due(registry, SUMMER, max_age_days=365)
    assert (one.is_due, one.in_use) == (False, True)
    assert one.in_force is not None
    assert (one.in_force.id, one.age_days) == (1, (SUMMER - FLOWN).days)
    assert one.ends == FLOWN + timedelta(days=365)
    assert due(registry, SUMMER, max_age_days=None)[0].ends is None


def test_an_age_counts_from_the_flight_and_the_last_day_still_serves(registry: Registry) -> None:
    add(registry, record())
    approve(registry, 1, SPRING)
    last = FLOWN + timedelta(days=365)
    assert kinds(registry, last - timedelta(days=31), max_age_days=365) == []
    assert kinds(registry, last - timedelta(days=30), max_age_days=365) == ["expires"]
    assert kinds(registry, last, max_age_days=365) == ["expires"]
    assert kinds(registry, last + timedelta(days=1), max_age_days=365) == ["too_old"]
    # Two years, unless something else is asked for.
    assert kinds(registry, FLOWN + timedelta(days=730)) == ["expires"]
    assert kinds(registry, FLOWN + timedelta(days=731)) == ["too_old"]
    (one,) = due(registry, last + timedelta(days=1), max_age_days=365)
    (sentence,) = one.sentences
    assert sentence == (
        "UCE (body UC-E-1), virtual image: Calibration 1 is 366 days old, more than 365: it is of 2024-05-02."
    )


def test_without_a_date_of_the_flight_the_age_counts_from_the_approval(registry: Registry) -> None:
    add(registry, record(flown=None))
    approve(registry, 1, SPRING)
    approval = registry.calibration("1").approval
    assert approval is not None
    approved = date.fromisoformat(approval.at[:10])
    (one,) = due(registry, approved + timedelta(days=100), max_age_days=365)
    assert (one.age_days, one.ends) == (100, approved + timedelta(days=365))
    # Added the day before.
    known = stored(1, record(flown=None))
    assert [event.at for event in known.events] == ["2026-01-01", "2026-01-02"]
    (one,) = due_of(Contents((known,), (), known.events), date(2026, 1, 12), DueLimits())
    assert one.age_days == 10


def test_an_end_of_the_validity_is_announced_and_then_said(registry: Registry) -> None:
    add(registry, record())
    approve(registry, 1, SPRING, AUTUMN)
    assert kinds(registry, AUTUMN - timedelta(days=31)) == []
    assert kinds(registry, AUTUMN - timedelta(days=30)) == ["expires"]
    assert kinds(registry, AUTUMN - timedelta(days=31), within_days=31) == ["expires"]
    assert kinds(registry, AUTUMN + timedelta(days=1)) == ["expired"]
    (one,) = due(registry, AUTUMN + timedelta(days=1))
    assert (one.in_force, one.age_days, one.ends) == (None, None, None)
    assert one.reasons[0].sentence == "The last approved calibration ended on 2024-09-01."
    (one,) = due(registry, AUTUMN)
    assert one.reasons[0].sentence == "The approved calibration is valid until 2024-09-01, today."
    # What is in force does not wait.
    (one,) = due(registry, SPRING, within_days=184)
    assert one.reasons[0].sentence == "The approved calibration is valid until 2024-09-01, in 184 days."


def test_what_follows_without_a_gap_is_counted(registry: Registry) -> None:
    for number in (1, 2, 3):
        add(registry, record(changed(number), flown=FLOWN + timedelta(days=number)))
    approve(registry, 1, SPRING, SUMMER)
    approve(registry, 2, SUMMER + timedelta(days=1), AUTUMN)
    assert due(registry, SUMMER)[0].ends == AUTUMN
    assert kinds(registry, SUMMER) == []
    assert "ended on 2024-09-01" in due(registry, AUTUMN + timedelta(days=1))[0].reasons[0].sentence
    approve(registry, 3, AUTUMN + timedelta(days=2))
    # A day without a calibration.
    assert due(registry, SUMMER)[0].ends == AUTUMN
    (one,) = due(registry, AUTUMN + timedelta(days=1))
    assert one.reasons[0].kind == "expired"
    assert "Calibration 3 is approved from 2024-09-03." in one.reasons[0].sentence


def test_an_approved_calibration_that_is_too_old_itself_follows_nothing(registry: Registry) -> None:
    add(registry, record(flown=date(2022, 5, 1)))
    add(registry, record(changed(1)))
    approve(registry, 2, SPRING, SUMMER)
    approve(registry, 1, SUMMER + timedelta(days=1))
    assert due(registry, SPRING, max_age_days=365)[0].ends == SUMMER
    assert kinds(registry, SUMMER + timedelta(days=1), max_age_days=365) == ["too_old"]


def test_a_draft_alone_is_none_in_force_and_is_named(registry: Registry) -> None:
    add(registry, record())
    (one,) = due(registry, SUMMER)
    assert [reason.kind for reason in one.reasons] == ["none_in_force"]
    assert "Calibration 1 is a draft" in one.reasons[0].sentence


def test_the_mounting_of_the_newest_calibration_counts(registry: Registry) -> None:
    add(registry, record())
    approve(registry, 1, SPRING, SUMMER)
    add(registry, record(changed(1), identity=OTHER_MOUNTING, flown=FLOWN + timedelta(days=20)))
    new, old = due(registry, AUTUMN)
    assert (new.in_use, new.mounting, old.in_use, old.mounting) == (True, "IMU I-8", False, "IMU I-7")
    assert [reason.kind for reason in new.reasons] == ["none_in_force"]
    assert not old.is_due
    approve(registry, 2, SPRING)
    assert not any(one.is_due for one in due(registry, AUTUMN))


def test_cameras_are_told_apart_and_can_be_left_out(registry: Registry) -> None:
    head = CameraIdentity(body="UC-E-2", product="camera_head")
    add(registry, record())
    add(registry, record(name="Z", identity=head))
    assert [(one.camera, one.product) for one in due(registry, SUMMER)] == [
        ("UCE (body UC-E-1)", "virtual image"),
        ("Z (body UC-E-2)", "camera head"),
    ]
    assert [one.camera for one in due(registry, SUMMER, without=("UC-E-2",))] == ["UCE (body UC-E-1)"]
    with pytest.raises(InputError, match="Did you mean 'UC-E-2'"):
        due(registry, SUMMER, without=("UC-E-3",))


def test_a_drifted_camera_is_due_until_somebody_says_why(registry: Registry) -> None:
    add(registry, record())
    approve(registry, 1, SPRING)
    add(registry, record(VALUES + 9 * SIGMAS, flown=FLOWN + timedelta(days=30)))
    assert kinds(registry, SUMMER) == ["drifted"]
    (one,) = due(registry, SUMMER)
    assert "focal length +10.8 µm (σ 1.7 µm, limit" in one.sentences[0]
    approve(registry, 2, SUMMER, although="new shutter")
    assert kinds(registry, SUMMER) == []


def test_an_edited_registry_has_no_answer(registry: Registry) -> None:
    add(registry, record())
    with registry.database.writing() as connection:
        connection.execute(text("UPDATE calibration_events SET person = 'eve'"))
    with pytest.raises(InputError, match="was edited"):
        due(registry, SUMMER)


def test_the_plain_data_hold_every_series_with_the_limits_of_the_newest(registry: Registry) -> None:
    for year, factor in ((0, 0.0), (1, 1.0), (2, 9.0)):
        add(registry, record(VALUES + factor * SIGMAS, flown=FLOWN.replace(year=2021 + year)))
        approve(registry, year + 1, SPRING.replace(year=2021 + year))
    watch = watch_of(registry.contents(), date(2023, 6, 1), DueLimits())
    plain = json.loads(json_text(as_json(watch)))
    assert plain["due"] == ["UCE (body UC-E-1)"]
    (camera,) = plain["cameras"]
    assert (camera["in_force"], camera["age_days"], camera["due"]) == (3, 30, True)
    assert [(one["old"], one["against"], one["drifted"]) for one in camera["drifts"]] == [
        (2, "before", True),
        (1, "first", True),
    ]
    by_name = {one["parameter"]: one for one in plain["series"]}
    assert list(by_name)[:3] == ["focal_length", "principal_point_x", "principal_point_y"]
    focal = by_name["focal_length"]
    assert [point["value"] for point in focal["points"]] == [
        VALUES[0] + k * SIGMAS[0] for k in (0.0, 1.0, 9.0)
    ]
    assert [point["valid_to"] for point in focal["points"]] == ["2022-02-28", "2023-02-28", None]
    before = focal["bands"][0]
    limit = next(
        one["limit"] for one in camera["drifts"][0]["parameters"] if one["parameter"] == "focal_length"
    )
    assert before["exceeded"] is True
    assert before["upper"] - VALUES[0] - SIGMAS[0] == pytest.approx(limit)
    assert before["upper"] - before["lower"] == pytest.approx(2 * limit)


def test_the_limits_of_a_head_are_its_own(registry: Registry) -> None:
    """The heads look 30° to the left and right: the limits of one say nothing about the other."""
    pitch, sigma = {"left": 30.0, "right": -30.0}, 0.001
    camera = record().camera
    for year in (2021, 2022):
        rig = record(
            flown=FLOWN.replace(year=year),
            heads=tuple(camera.model_copy(update={"name": name}) for name in pitch),
            parameters=tuple(
                parameter("relative_rotation_pitch", "deg", value, sigma, name)
                for name, value in pitch.items()
            ),
            covariance=((sigma**2, 0.0), (0.0, sigma**2)),
        )
        add(registry, rig)
    plain = json.loads(json_text(as_json(watch_of(registry.contents(), SUMMER, DueLimits()))))
    of_head = {one["head"]: one["bands"] for one in plain["series"]}
    assert of_head.keys() == {"left", "right"}
    for head, bands in of_head.items():
        (band,) = bands
        assert band["lower"] < pitch[head] < band["upper"]


def test_heads_are_the_same_whatever_a_project_calls_them(registry: Registry) -> None:
    """Heads that changed their names were compared with the other one, or with none."""
    pitch, sigma = {"L-1": 30.0, "L-2": -30.0}, 0.001
    camera = record().camera
    for year, names in ((2020, ("left", "right")), (2021, ("right", "left")), (2022, ("port", "starboard"))):
        heads = dict(zip(names, pitch, strict=True))
        turned = 10.0 * sigma * (year == 2022)
        rig = record(
            flown=FLOWN.replace(year=year),
            heads=tuple(
                camera.model_copy(update={"name": name, "identity": CameraIdentity(lens=lens)})
                for name, lens in heads.items()
            ),
            parameters=tuple(
                parameter(
                    "relative_rotation_pitch", "deg", pitch[lens] + turned * (lens == "L-2"), sigma, name
                )
                for name, lens in heads.items()
            ),
            covariance=((sigma**2, 0.0), (0.0, sigma**2)),
        )
        add(registry, rig)
        (found,) = due_of(registry.contents(), SUMMER, DueLimits())
        for drift in found.drifts:
            assert [one.change.head for one in drift.parameters] == list(names)
            assert [one.old for one in drift.parameters] == list(pitch.values())
            assert [one.change.head for one in drift.parameters if one.exceeds] == ["starboard"] * (
                year == 2022
            )
    assert len(found.drifts) == 2
    watched = watch_of(registry.contents(), SUMMER, DueLimits()).series
    assert {one.series.head: len(one.series.points) for one in watched} == {"port": 3, "starboard": 3}
    assert [len(one.bands) for one in watched] == [2, 2]


def test_nothing_due_is_said_in_one_sentence(registry: Registry) -> None:
    add(registry, record())
    approve(registry, 1, SPRING)
    watch = watch_of(registry.contents(), SUMMER, DueLimits())
    assert watch.sentences == ("No calibration is due: 1 camera checked.",)
