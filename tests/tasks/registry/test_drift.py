"""Drift of a camera: closed forms, absolute limits, what is compared with what, false alarms."""

from __future__ import annotations

from datetime import date, timedelta

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from tasks.calibration.record import CalibrationRecord
from tasks.registry.contents import StoredCalibration
from tasks.registry.drift import DRIFT_PROBABILITY, Drift, DriftLimits, by_day, drifts_of
from tasks.settings.camera_identity import CameraIdentity
from tests.tasks.registry.records import NAMES, SIGMAS, VALUES, covariance, parameter, record, stored

FIRST_DAY = date(2020, 5, 1)
NO_LIMITS = DriftLimits()
OTHER_MOUNTING = CameraIdentity(body="UC-E-1", imu="I-8")


def flown(year: int, values: Floats = VALUES, **changes: object) -> CalibrationRecord:
    return record(values, flown=FIRST_DAY.replace(year=FIRST_DAY.year + year), **changes)  # type: ignore[arg-type]


def moved(**sigmas: float) -> Floats:
    """The values with some parameters moved by multiples of the σ of a difference of two calibrations."""
    steps = np.array([sigmas.get(name, 0.0) for name in NAMES])
    return VALUES + np.sqrt(2.0) * steps * SIGMAS


def drift(*items: StoredCalibration, limits: DriftLimits = NO_LIMITS) -> list[Drift]:
    return list(drifts_of(by_day(items), limits))


def one_parameter(year: int, value: float, sigma: float) -> CalibrationRecord:
    own = (parameter("focal_length", "mm", value, sigma, "UCE"),)
    return flown(year, parameters=own, covariance=((sigma**2,),))


def test_one_parameter_drifts_beyond_3_29_sigma_of_the_change() -> None:
    """χ² of one degree of freedom at 0.1 % is the square of the two-sided limit of the normal test."""
    sigma = float(np.hypot(0.0010, 0.0008))
    limit = stats.norm.isf(DRIFT_PROBABILITY / 2)
    for factor, drifted in ((0.999, False), (1.001, True)):
        old, new = one_parameter(0, 79.992, 0.0008), one_parameter(1, 79.992 + factor * limit * sigma, 0.0010)
        (found,) = drift(stored(1, old), stored(2, new))
        assert found.parameters[0].limit == pytest.approx(limit * sigma)
        assert found.chi2_limit == pytest.approx(limit**2)
        assert found.has_drifted is drifted


def test_many_small_changes_of_correlated_parameters_drift_together() -> None:
    """None of the five is beyond its own limit, but together they are none of chance."""
    values = moved(focal_length=2.8, principal_point_y=2.8, **{"bluh:9": -2.8})
    (found,) = drift(stored(1, flown(0)), stored(2, flown(1, values)))
    t = (values - VALUES) / np.sqrt(2.0) / SIGMAS
    correlations = covariance() / np.outer(SIGMAS, SIGMAS)
    assert found.test.chi2 == pytest.approx(float(t @ np.linalg.solve(correlations, t)))
    assert found.chi2_limit == pytest.approx(stats.chi2.isf(DRIFT_PROBABILITY, 5))
    assert not any(one.exceeds for one in found.parameters)
    assert found.has_drifted
    assert found.sentence.startswith("Calibration 2 has drifted from calibration 1, the one before: χ² ")


def test_number_sigma_and_limit_are_said_in_the_units_people_use() -> None:
    values = VALUES + np.array([0.0100, 0.0, 0.0, 0.0, 0.0])
    (found,) = drift(stored(1, flown(0)), stored(2, flown(1, values)))
    # σ of the change √2 · 1.2 µm, limit of the largest of five at 0.1 %.
    limit = stats.norm.isf((1 - 0.999 ** (1 / 5)) / 2) * np.sqrt(2.0) * 1.2
    assert f"focal length +10.0 µm (σ 1.7 µm, limit {limit:.1f} µm)" in found.sentence


@pytest.mark.parametrize(
    ("limits", "change", "exceeding"),
    [
        ({"focal_length_um": 5.0}, (0.0051, 0, 0, 0, 0), ["focal_length"]),
        ({"focal_length_um": 5.0}, (-0.0049, 0, 0, 0, 0), []),
        ({"principal_point_um": 1.0}, (0, 0.0011, -0.0011, 0, 0), ["principal_point_x", "principal_point_y"]),
        ({"boresight_deg": 0.001}, (0, 0, 0, 0.0011, 0), ["boresight_roll"]),
        ({"lever_arm_mm": 1.0}, (0.001, 0, 0, 0, 0), []),
        ({"sigma": 2.0}, (0.0035, 0, 0, 0, 0), ["focal_length"]),
        ({"sigma": 2.0}, (0.0033, 0, 0, 0, 0), []),
    ],
)
def test_a_limit_in_the_unit_of_the_field_counts_whatever_the_sigma(
    limits: dict[str, float], change: tuple[float, ...], exceeding: list[str]
) -> None:
    items = stored(1, flown(0)), stored(2, flown(1, VALUES + np.array(change)))
    (found,) = drift(*items, limits=DriftLimits(**limits))
    assert [one.change.parameter for one in found.parameters if one.exceeds] == exceeding
    assert found.has_drifted is bool(exceeding)


def test_a_limit_of_the_lever_arm_is_in_millimetres_of_its_metres() -> None:
    old, new = (
        flown(
            year,
            parameters=(parameter("lever_arm_x", "m", value, 0.01, "UCE"),),
            covariance=((1e-4,),),
        )
        for year, value in ((0, 0.300), (1, 0.312))
    )
    (found,) = drift(stored(1, old), stored(2, new), limits=DriftLimits(lever_arm_mm=11.0))
    assert found.parameters[0].limit == pytest.approx(0.011)
    assert found.has_drifted


def test_a_slow_drift_shows_against_the_first_calibration_only() -> None:
    items = [stored(year, flown(year, moved(focal_length=1.5 * year))) for year in range(1, 5)]
    before, first = drift(*items)
    assert (before.against, before.old.id, before.has_drifted) == ("before", 3, False)
    assert (first.against, first.old.id, first.has_drifted) == ("first", 1, True)


def test_the_first_one_is_that_of_the_same_mounting() -> None:
    """Before the change of the IMU the roll was another one; that is no drift."""
    old = [stored(k, flown(k, moved(boresight_roll=50.0))) for k in (1, 2)]
    new = [stored(k, flown(k, identity=OTHER_MOUNTING)) for k in (3, 4, 5)]
    assert [(one.old.id, one.has_drifted) for one in drift(*old, *new)] == [(4, False), (3, False)]
    # The first one of its mounting is compared with the camera of the one before, without the roll.
    (found,) = drift(*old, new[0])
    assert found.old.id == 2
    assert "boresight_roll" not in [one.change.parameter for one in found.parameters]
    assert not found.has_drifted


def test_a_draft_takes_part_and_a_refused_one_does_not() -> None:
    changed = moved(focal_length=9.0)
    approved = stored(1, flown(0))
    assert drift(approved, stored(2, flown(1, changed), approved=False))[0].has_drifted
    refused = flown(1, changed, verdict="refused", reasons=("One height only.",))
    assert drift(approved, stored(2, refused, approved=False)) == []
    assert drift(approved, stored(2, refused, although="no other flight"))[0].has_drifted


def test_the_order_is_that_of_the_flights() -> None:
    late, early = stored(1, flown(3, moved(focal_length=9.0))), stored(2, flown(1))
    (found,) = drift(late, early)
    assert (found.new.id, found.old.id) == (1, 2)


def test_another_computation_of_the_same_flight_does_not_silence_its_drift() -> None:
    """It shares all errors of the flight and agrees with it, whatever has happened to the camera."""
    changed, files = moved(focal_length=9.0), {"points.txt": "a" * 64}
    first, flight, again = (
        stored(k, flown(year, values, identity=mounting, inputs=files if year else {}))
        for k, year, values, mounting in (
            (1, 0, VALUES, None),
            (2, 1, changed, OTHER_MOUNTING),
            (3, 1, changed + 0.1 * SIGMAS, OTHER_MOUNTING),
        )
    )
    for items in ((first, flight), (first, flight, again)):
        (found,) = drift(*items)
        assert (found.old.id, found.has_drifted) == (1, True)
    # Two flights of one day are two flights.
    other = stored(4, flown(1, identity=OTHER_MOUNTING, inputs={"points.txt": "b" * 64}))
    assert [(one.old.id, one.has_drifted) for one in drift(flight, other)] == [(2, True)]
    # So are flights of two days with a file in common, such as the control points.
    later = stored(5, flown(2, identity=OTHER_MOUNTING, inputs=files))
    assert [(one.old.id, one.has_drifted) for one in drift(flight, later)] == [(2, True)]


def test_a_change_that_was_explained_at_the_approval_is_no_drift_any_more() -> None:
    repaired = moved(focal_length=9.0)
    items = [
        stored(1, flown(1)),
        stored(2, flown(2)),
        stored(3, flown(3, repaired), although="new shutter"),
    ]
    assert drift(*items) == []
    (found,) = drift(*items, stored(4, flown(4, repaired)))
    assert (found.old.id, found.has_drifted) == (3, False)
    again = drift(*items, stored(4, flown(4, repaired)), stored(5, flown(5)))
    assert [(one.old.id, one.has_drifted) for one in again] == [(4, True), (3, True)]


def test_one_calibration_cannot_drift() -> None:
    assert drift(stored(1, flown(0))) == []


@pytest.mark.parametrize("trials", [400, pytest.param(2_000, marks=pytest.mark.slow)])
def test_an_unchanged_camera_is_called_drifted_as_seldom_as_is_said(trials: int) -> None:
    """Cameras with three calibrations each: two comparisons of two tests at 0.1 %.

    Of 2,000 cameras three times as many alarms are noticed with a probability of 82 %; of 400 six times as
    many with 74 %.
    """
    random = np.random.default_rng(11)
    factor = np.linalg.cholesky(covariance() / np.outer(SIGMAS, SIGMAS))
    template = [record(flown=FIRST_DAY + timedelta(days=365 * year)) for year in range(3)]
    alarms, joint = 0, 0
    for _ in range(trials):
        items = [
            stored(number, _with_values(one, VALUES + SIGMAS * (factor @ random.standard_normal(5))))
            for number, one in enumerate(template)
        ]
        found = drift(*items)
        assert len(found) == 2
        alarms += any(one.has_drifted for one in found)
        joint += sum(one.test.chi2 > one.chi2_limit for one in found)
    low, high = stats.binom.interval(0.999, 2 * trials, DRIFT_PROBABILITY)
    assert low <= joint <= high
    # Bonferroni: four tests; each is held by the same three calibrations.
    assert alarms <= stats.binom.isf(0.0005, trials, 4 * DRIFT_PROBABILITY)


def _with_values(template: CalibrationRecord, values: Floats) -> CalibrationRecord:
    items = [
        item.model_copy(update={"value": float(value)})
        for item, value in zip(template.parameters[:5], values, strict=True)
    ]
    return template.model_copy(update={"parameters": (*items, *template.parameters[5:])})
