"""The right calibration is chosen by camera and date, or the nearest ones are named and nothing is chosen."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.registry.choice import chosen_calibration
from tasks.registry.identity import CameraBody
from tasks.registry.registry import Registry
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.registry import registry_address
from tests.tasks.registry.records import add, approve, changed, record

CAMERA = CameraBody.of_record(record().camera)
SPRING, SUMMER, AUTUMN = date(2024, 3, 1), date(2024, 6, 1), date(2024, 9, 1)


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Registry:
    """1 held in spring, 2 from autumn on, 3 a draft, 4 a camera head, 5 another IMU, 6 by its name alone."""
    registry = Registry.at(registry_address(str(tmp_path_factory.mktemp("registry") / "r.sqlite")))
    head = CameraIdentity(body="UC-E-1", imu="I-7", product="camera_head")
    for item in (
        record(),
        record(changed(1)),
        record(changed(2)),
        record(identity=head),
        record(identity=CameraIdentity(body="UC-E-1", imu="I-8")),
        record(name="nameless", identity=CameraIdentity()),
    ):
        add(registry, item)
    approve(registry, 1, SPRING)
    approve(registry, 2, AUTUMN)
    for number in (4, 5, 6):
        approve(registry, number, SPRING)
    return registry


def chosen(registry: Registry, flown: date, **changes: object) -> int:
    return chosen_calibration(registry.contents(), replace(CAMERA, **changes), flown).id  # type: ignore[arg-type]


def refusal(registry: Registry, flown: date, **changes: object) -> InputError:
    with pytest.raises(InputError) as error:
        chosen(registry, flown, **changes)
    return error.value


def test_the_date_of_the_flight_decides(filled: Registry) -> None:
    assert chosen(filled, SPRING) == 1
    assert chosen(filled, date(2024, 8, 31)) == 1  # superseded since, but right on that day
    assert chosen(filled, AUTUMN) == 2
    assert chosen(filled, date(2030, 1, 1)) == 2


def test_before_the_first_one_nothing_holds_and_the_near_ones_are_named(filled: Registry) -> None:
    error = refusal(filled, date(2024, 2, 29))
    assert "1 (UCE (body UC-E-1)): valid from 2024-03-01 to 2024-08-31" in error.what
    assert "2 (UCE (body UC-E-1)): valid from 2024-09-01" in error.what
    assert "3 (UCE (body UC-E-1)): not approved yet" in error.what
    assert error.entity == "cameras.UCE"
    assert "\n" not in str(error)


def test_a_camera_head_and_a_virtual_image_never_serve_each_other(filled: Registry) -> None:
    head = CameraIdentity(body="UC-E-1", imu="I-7", product="camera_head")
    assert chosen(filled, AUTUMN, identity=head) == 4
    assert chosen(filled, AUTUMN) == 2
    nameless_head = CameraIdentity(product="camera_head")
    error = refusal(filled, SPRING, name="nameless", identity=nameless_head)
    assert "of a virtual image, and this is a camera head" in error.what


def test_the_mounting_decides(filled: Registry) -> None:
    assert chosen(filled, AUTUMN, identity=CameraIdentity(body="UC-E-1", imu="I-8")) == 5
    error = refusal(filled, AUTUMN, identity=CameraIdentity(body="UC-E-1", imu="I-9"))
    assert "of another mounting (IMU I-8)" in error.what
    assert "another mounting" in refusal(filled, AUTUMN, mount_deg=90).what


def test_a_number_only_one_side_gives_is_a_difference(filled: Registry) -> None:
    assert "of another mounting" in refusal(filled, AUTUMN, identity=CameraIdentity(body="UC-E-1")).what
    lens = CameraIdentity(body="UC-E-1", lens="L-1", imu="I-7")
    assert "of another camera (body UC-E-1 there, body UC-E-1, lens L-1 here)" in (
        refusal(filled, AUTUMN, identity=lens).what
    )
    assert "(body UC-E-1 there, none here)" in refusal(filled, AUTUMN, identity=CameraIdentity()).what


def test_without_numbers_the_name_decides(filled: Registry) -> None:
    assert chosen(filled, AUTUMN, name="nameless", identity=CameraIdentity()) == 6
    assert "none for such a camera" in refusal(filled, AUTUMN, name="other", identity=CameraIdentity()).what


@pytest.mark.parametrize(
    "change", [{"columns": 13000}, {"rows": 20000}, {"pixel_um": 4.0}, {"calibration_axes_deg": 90}]
)
def test_another_image_is_another_camera(filled: Registry, change: dict[str, object]) -> None:
    assert "2 (UCE (body UC-E-1)): of another image (13080 × 20010 px of 5.2 µm" in (
        refusal(filled, AUTUMN, **change).what
    )


def test_what_holds_for_a_time_only_holds_for_that_time_only(tmp_path: Path) -> None:
    registry = Registry.at(registry_address(str(tmp_path / "r.sqlite")))
    add(registry, record())
    approve(registry, 1, SPRING, SUMMER)
    assert chosen(registry, SUMMER) == 1
    assert "valid from 2024-03-01 to 2024-06-01" in refusal(registry, date(2024, 6, 2)).what
