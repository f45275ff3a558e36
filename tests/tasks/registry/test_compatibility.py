"""The test of a new calibration against the approved one: closed forms, false alarms, words."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from tasks.calibration.record import CalibratedCamera, CalibrationRecord
from tasks.registry.compatibility import ERROR_PROBABILITY, compatibility, quadratic_form, single_limit
from tasks.settings.camera_identity import CameraIdentity
from tests.tasks.registry.records import NAMES, SIGMAS, VALUES, covariance, parameter, record


def only(name: str, value: float, sigma: float, unit: str = "mm") -> CalibrationRecord:
    """A calibration with one estimated parameter."""
    return record(parameters=(parameter(name, unit, value, sigma, "UCE"),), covariance=((sigma**2,),))


def test_one_parameter_is_the_normal_test() -> None:
    found = compatibility(only("focal_length", 79.9961, 0.001), only("focal_length", 79.992, 0.0008))
    sigma = np.hypot(0.001, 0.0008)
    assert found.chi2 == pytest.approx((0.0041 / sigma) ** 2)
    assert found.degrees_of_freedom == 1
    assert found.probability == pytest.approx(2 * stats.norm.sf(0.0041 / sigma))
    assert found.changes[0].t == pytest.approx(3.2016, abs=1e-3)
    assert found.changes[0].sentence == "focal length changed by +4.1 µm, 3.2 σ"
    assert "Focal length changed by +4.1 µm, 3.2 σ." in found.sentences


def test_correlated_parameters_follow_the_closed_form_of_two() -> None:
    """χ² = (t₁² − 2 ρ t₁ t₂ + t₂²)/(1 − ρ²)."""
    difference, sigma, rho = np.array([2.0, -3.0]), np.array([1.0, 2.0]), 0.9
    matrix = np.array([[1.0, rho], [rho, 1.0]]) * np.outer(sigma, sigma)
    chi2, rank = quadratic_form(difference, matrix)
    one, two = difference / sigma
    assert chi2 == pytest.approx((one**2 - 2 * rho * one * two + two**2) / (1 - rho**2))
    assert rank == 2


def test_units_make_no_difference() -> None:
    scale = np.array([1e-3, 1.0, 1e9])
    difference, matrix = np.array([1.0, 2.0, 3.0]), np.diag([1.0, 2.0, 3.0]) + 0.5
    expected = float(difference @ np.linalg.solve(matrix, difference))
    found = quadratic_form(difference * scale, matrix * np.outer(scale, scale))
    assert found == (pytest.approx(expected), 3)


def test_a_combination_nobody_knows_does_not_count() -> None:
    matrix = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert quadratic_form(np.array([1.0, 1.0]), matrix) == (pytest.approx(1.0), 1)
    assert quadratic_form(np.zeros(0), np.zeros((0, 0))) == (0.0, 0)


def test_both_covariances_count_in_full() -> None:
    changes = np.array([2.0, -1.0, 0.5, 0.0, 1.0]) * SIGMAS
    found = compatibility(record(VALUES + changes, scale=2.0), record())
    matrix = covariance(2.0) + covariance()
    scale = np.sqrt(np.diagonal(matrix))
    t = changes / scale
    assert found.chi2 == pytest.approx(float(t @ np.linalg.solve(matrix / np.outer(scale, scale), t)))
    assert [change.parameter for change in found.changes] == list(NAMES)
    np.testing.assert_allclose([change.sigma for change in found.changes], scale)
    assert found.probability == pytest.approx(stats.chi2.sf(found.chi2, 5))


@pytest.mark.parametrize("trials", [1_000, pytest.param(4_000, marks=pytest.mark.slow)])
def test_an_unchanged_camera_is_called_changed_as_often_as_is_said(trials: int) -> None:
    """Pairs of calibrations of one camera; joint test and largest single parameter.

    A thousand show a covariance without the part of one of the two.
    """
    random = np.random.default_rng(5)
    factors = [np.linalg.cholesky(covariance(s) / np.outer(SIGMAS, SIGMAS)) for s in (1.0, 1.5)]
    templates = [record(), record(scale=1.5)]
    joint, single, squares = 0, 0, []
    for _ in range(trials):
        old, new = (
            with_values(template, VALUES + SIGMAS * (factor @ random.standard_normal(5)))
            for template, factor in zip(templates, factors, strict=True)
        )
        found = compatibility(new, old)
        joint += not found.agrees
        single += any(change.outstanding for change in found.changes)
        squares.append(found.chi2)
    low, high = stats.binom.interval(0.999, trials, ERROR_PROBABILITY)
    assert low <= joint <= high
    # Šidák's limit is exact for independent parameters and on the safe side for correlated ones.
    assert 0.5 * low <= single <= high
    assert stats.kstest(squares, stats.chi2(5).cdf).pvalue > 0.001


def with_values(template: CalibrationRecord, values: np.ndarray) -> CalibrationRecord:
    items = [
        item.model_copy(update={"value": float(value)})
        for item, value in zip(template.parameters[:5], values, strict=True)
    ]
    return template.model_copy(update={"parameters": (*items, *template.parameters[5:])})


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_changed_camera_is_found_and_named(sign: float) -> None:
    changed = VALUES + np.array([sign * 0.0085, 0.0, 0.0, 0.0, 0.0])
    found = compatibility(record(changed), record())
    assert not found.agrees
    assert [change.parameter for change in found.changes if change.outstanding] == ["focal_length"]
    assert found.sentences[0].startswith("All 5 common parameters together do not agree: χ² = ")
    assert found.sentences[1] == f"Focal length changed by {'+' if sign > 0.0 else '−'}8.5 µm, 5.0 σ."


@pytest.mark.parametrize(
    ("probability", "agrees", "said"),
    [
        (0.25, True, "in 25 % of all cases"),
        (0.0102, True, "in 1 % of all cases"),
        (0.0098, False, "in 0.98 % of all cases"),
        (5e-5, False, "in less than 0.01 % of all cases"),
    ],
)
def test_a_change_that_chance_makes_once_in_a_hundred_is_none_of_chance(
    probability: float, agrees: bool, said: str
) -> None:
    change = np.sqrt(2.0) * 0.001 * stats.norm.isf(probability / 2.0)
    found = compatibility(only("focal_length", 80.0 + change, 0.001), only("focal_length", 80.0, 0.001))
    assert found.agrees is agrees
    assert said in found.sentences[0]


def test_the_limit_of_a_single_parameter_grows_with_their_number() -> None:
    assert single_limit(1) == pytest.approx(stats.norm.isf(0.005))
    assert (1 - 2 * stats.norm.sf(single_limit(9))) ** 9 == pytest.approx(0.99)


def test_the_shift_of_a_flight_is_not_compared() -> None:
    found = compatibility(record(shift_m=5.0), record())
    assert found.chi2 == 0.0
    assert found.agrees


def test_boresight_is_compared_within_one_mounting_only() -> None:
    moved = VALUES + np.array([0.0, 0.0, 0.0, 1.0, 0.0])
    identity = CameraIdentity(body="UC-E-1", imu="I-8")
    found = compatibility(record(moved, identity=identity), record())
    assert "boresight_roll" not in [change.parameter for change in found.changes]
    assert found.agrees
    assert any("is different" in sentence for sentence in found.sentences)


def test_additional_parameters_of_other_axes_are_not_compared() -> None:
    turned = CalibratedCamera.model_validate({**record().camera.model_dump(), "calibration_axes_deg": 90})
    found = compatibility(record(camera=turned), record())
    assert [change.parameter for change in found.changes] == list(NAMES[:4])


def test_what_only_one_has_estimated_and_common_files_are_said() -> None:
    found = compatibility(record(inputs={"a": "1", "b": "2"}), only("focal_length", 79.992, 0.001))
    assert found.new_only == NAMES[1:]
    assert "by the new one only" in found.sentences[-1]
    shared = compatibility(record(inputs={"a": "1"}), record(inputs={"renamed": "1", "c": "3"}))
    assert shared.shared_inputs == 1
    assert any("1 common file" in sentence for sentence in shared.sentences)


def test_nothing_in_common_is_said_and_is_no_agreement_in_disguise() -> None:
    found = compatibility(only("focal_length", 80.0, 0.001), only("principal_point_x", 0.0, 0.001))
    assert found.degrees_of_freedom == 0
    assert "nothing was compared" in found.sentences[0]


def test_what_was_not_determined_is_not_compared() -> None:
    weak = record().parameters[0].model_copy(update={"verdict": "not_determinable"})
    parameters = (weak, *record().parameters[1:])
    refused = record(parameters=parameters, verdict="refused", reasons=("One height only.",))
    found = compatibility(refused, record())
    assert "focal_length" not in [change.parameter for change in found.changes]
