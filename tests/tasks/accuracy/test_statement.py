"""Statements by the standards: figures, wording, thresholds, editions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from tasks.accuracy.standard import asprs, nssda
from tasks.accuracy.statement import (
    AccuracyClass,
    CheckPointDifferences,
    Statement,
    asprs_statement,
    nssda_statement,
    statements,
)

#: RMS of the published direct georeferencing with an UltraCam Eagle, 84 points, and their survey.
PUBLISHED_M = (0.029, 0.033, 0.059)


def differences(rms: tuple[float, float, float], number: int, survey: float = 0.02) -> CheckPointDifferences:
    """Points that all differ by the same, alternately to either side."""
    sign = np.where(np.arange(number) % 2 == 0, 1.0, -1.0)
    return CheckPointDifferences(sign[:, None] * np.array(rms), np.full((number, 3), survey))


def asprs_of(found: CheckPointDifferences, wanted: AccuracyClass | None = None) -> Statement:
    return asprs_statement(found, wanted, asprs())


def test_the_published_differences_give_the_figures_computed_by_hand() -> None:
    found = differences(PUBLISHED_M, 84)
    # RMSE_H1 = √(.029² + .033²) = .0439, the survey's √2 · .02: RMSE_H .0522, RMSE_V .0623, RMSE_3D .0813.
    figures = asprs_of(found).figures
    assert figures["RMSE_H"] == pytest.approx(0.0522, abs=5e-5)
    assert figures["RMSE_V"] == pytest.approx(0.0623, abs=5e-5)
    assert figures["RMSE_3D"] == pytest.approx(0.0813, abs=5e-5)
    tested = nssda_statement(found, nssda()).figures
    assert tested["Accuracy_r"] == pytest.approx(0.0759, abs=1e-4)
    assert tested["Accuracy_z"] == pytest.approx(0.1156, abs=1e-4)


def test_the_factors_of_the_nssda_are_those_of_the_normal_distribution() -> None:
    assert nssda().horizontal_factor == pytest.approx(np.sqrt(stats.chi2.ppf(0.95, 2)), abs=5e-5)
    assert nssda().vertical_factor == pytest.approx(stats.norm.ppf(0.975), abs=5e-5)


def test_the_error_of_the_survey_counts_for_asprs_and_not_for_the_nssda() -> None:
    exact, rough = (differences(PUBLISHED_M, 40, survey) for survey in (1e-9, 0.10))
    assert asprs_of(rough).figures["RMSE_V"] == pytest.approx(np.hypot(0.059, 0.10))
    assert asprs_of(exact).figures["RMSE_V"] == pytest.approx(0.059)
    assert nssda_statement(rough, nssda()).figures == nssda_statement(exact, nssda()).figures


def test_differences_are_not_centred() -> None:
    shifted = CheckPointDifferences(np.full((40, 3), 0.05), np.zeros((40, 3)))
    assert asprs_of(shifted).figures["RMSE_V"] == pytest.approx(0.05)


@pytest.mark.parametrize(("number", "tested"), [(29, False), (30, True), (121, True)])
def test_asprs_wants_thirty_check_points_and_says_so(number: int, tested: bool) -> None:
    made = asprs_of(differences(PUBLISHED_M, number))
    assert made.tested is tested
    assert made.least == asprs().least_check_points == 30
    assert "Edition 2, Version 2 (2024)" in made.sentence
    assert f"{number} " in made.sentence
    assert ("Not tested according to" in made.sentence) is not tested
    assert "RMSE_H = 5.2 cm, RMSE_V = 6.2 cm" in made.sentence
    assert "95" not in made.sentence  # the edition states no figure at a confidence level


@pytest.mark.parametrize(("number", "tested"), [(19, False), (20, True)])
def test_the_nssda_wants_twenty_check_points_and_says_so(number: int, tested: bool) -> None:
    made = nssda_statement(differences(PUBLISHED_M, number), nssda())
    assert made.tested is tested
    assert made.least == nssda().least_check_points == 20
    assert "FGDC-STD-007.3-1998" in made.sentence
    if tested:
        assert "Tested 0.076 m horizontal accuracy at 95 % confidence level" in made.sentence
        assert "tested 0.116 m vertical accuracy at 95 % confidence level" in made.sentence
    else:
        assert "Not tested according to" in made.sentence
        assert "20 are needed" in made.sentence


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (AccuracyClass(0.053, 0.063), "was tested to meet"),
        (AccuracyClass(0.052, 0.063), "does not meet"),
        (AccuracyClass(0.053, 0.062), "does not meet"),
        (None, "no accuracy class was asked for"),
    ],
)
def test_the_class_asked_for_is_met_or_not(wanted: AccuracyClass | None, words: str) -> None:
    sentence = asprs_of(differences(PUBLISHED_M, 84), wanted).sentence
    assert words in sentence
    if wanted is not None:
        assert f"{wanted.horizontal_m * 100:g} cm RMSE_H" in sentence


def test_the_nssda_states_no_circle_where_the_two_directions_differ_too_much() -> None:
    made = nssda_statement(differences((0.02, 0.05, 0.06), 40), nssda())
    assert "Accuracy_r" not in made.figures
    assert "No horizontal accuracy is stated" in made.sentence
    assert "0.40 to 1" in made.sentence
    assert "Accuracy_r" in nssda_statement(differences((0.03, 0.05, 0.06), 40), nssda()).figures


def test_points_known_in_part_count_for_what_they_know() -> None:
    found = differences(PUBLISHED_M, 50)
    partly: Floats = found.difference.copy()
    partly[:15, 2] = np.nan
    partly[15:20, 0] = np.nan
    item = CheckPointDifferences(partly, found.survey_sigma)
    assert (item.has_plan.sum(), item.has_height.sum(), item.number) == (45, 35, 35)
    np.testing.assert_allclose(item.rmse, PUBLISHED_M)


def test_without_check_points_nothing_is_stated() -> None:
    nothing = CheckPointDifferences(np.zeros((0, 3)), np.zeros((0, 3)))
    for made in statements(nothing, None):
        assert not made.tested
        assert made.figures == {}
        assert "there are no independent check points" in made.sentence


def test_every_standard_says_what_of_it_was_compared_with_its_text() -> None:
    for standard in (asprs(), nssda()):
        assert standard.source
        assert "memory" in standard.verified
