"""In which order the parameters of a calibration are released, and what is held of those not determined."""

from __future__ import annotations

from tasks.calibration.release import ADDITIONAL, Undetermined, releases
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.calibration import CalibrationSettings


def test_interior_orientation_follows_mounting_and_additional_parameters_come_last() -> None:
    adjustment = AdjustmentSettings.model_validate({"self_calibration": {"parameters": "bluh:1-12"}})
    stages = releases(CalibrationSettings(), adjustment)
    assert [stage.new for stage in stages] == [
        ("boresight", "gnss_shift", "gnss_strip_bias"),
        ("focal_length", "principal_point"),
        (),
    ]
    assert [stage.additional for stage in stages] == ["none", "none", "bluh:1-12"]
    assert stages[2].free == CalibrationSettings().free
    assert stages[2].newly_released == (ADDITIONAL,)


def test_without_interior_orientation_there_is_one_stage() -> None:
    (only,) = releases(CalibrationSettings(free=("boresight", "lever_arm")), AdjustmentSettings())
    assert only.free == ("boresight", "lever_arm")


def test_what_is_held_stays_held() -> None:
    wanted = releases(CalibrationSettings(), AdjustmentSettings())[-1]
    left = wanted.without({"focal_length": "", "gnss_shift": ""})
    assert left.before == ("boresight", "gnss_strip_bias")
    assert left.new == ("principal_point",)
    extended = AdjustmentSettings.model_validate({"self_calibration": {"parameters": "bluh:1-12"}})
    last = releases(CalibrationSettings(), extended)[-1]
    assert last.without({ADDITIONAL: ""}).additional == "none"


FIRST, INTERIOR = releases(CalibrationSettings(), AdjustmentSettings())


def test_weak_mounting_stays_free_and_what_cannot_be_separated_is_held() -> None:
    weak = Undetermined({"gnss_shift": "σ 9 cm."})
    assert weak.to_be_held(FIRST) == {}
    silent = Undetermined({"gnss_shift": "no control.", "boresight": "σ 1°."}, frozenset({"gnss_shift"}))
    assert silent.to_be_held(FIRST) == {"gnss_shift": "no control."}


def test_of_what_is_undetermined_the_newly_released_is_held() -> None:
    found = Undetermined({"gnss_shift": "σ 9 cm.", "focal_length": "σ 9 µm."})
    assert found.to_be_held(INTERIOR) == {"focal_length": "σ 9 µm."}


def test_what_spoils_others_is_held_itself() -> None:
    held = Undetermined({"gnss_shift": "σ 9 cm."}).to_be_held(INTERIOR)
    assert list(held) == ["focal_length", "principal_point"]
    assert "σ 9 cm." in held["principal_point"]


def test_what_was_weak_before_is_no_reason_to_hold_anything() -> None:
    found = Undetermined({"lever_arm": "σ 13 cm."}, before=frozenset({"lever_arm"}))
    assert found.to_be_held(INTERIOR) == {}
    assert Undetermined({}).to_be_held(INTERIOR) == {}


def test_additional_parameters_that_spoil_others_are_held_together() -> None:
    extended = AdjustmentSettings.model_validate({"self_calibration": {"parameters": "bluh:1-12"}})
    last = releases(CalibrationSettings(), extended)[-1]
    assert list(Undetermined({"focal_length": "σ 9 µm."}).to_be_held(last)) == [ADDITIONAL]
