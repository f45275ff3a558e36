"""Statements by the standards: figures, wording, thresholds, editions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from tasks.accuracy.check_points import QUANTITIES, CheckPointDifferences
from tasks.accuracy.statement import AccuracyClass, Statement, statement, statements
from tasks.accuracy.template import STANDARDS, delivered, read_template
from tasks.document_kit.table import Number
from tasks.documents.report.statements import figures_table
from tasks.errors import InputError
from tasks.results.figures import StatementFigure

#: RMS of the published direct georeferencing with an UltraCam Eagle, 84 points, and their survey.
PUBLISHED_M = (0.029, 0.033, 0.059)


def differences(rms: tuple[float, float, float], number: int, survey: float = 0.02) -> CheckPointDifferences:
    """Points that all differ by the same, alternately to either side."""
    sign = np.where(np.arange(number) % 2 == 0, 1.0, -1.0)
    return CheckPointDifferences(sign[:, None] * np.array(rms), np.full((number, 3), survey))


def asprs_of(found: CheckPointDifferences, wanted: AccuracyClass | None = None) -> Statement:
    return statement(delivered("asprs-2024"), found, wanted)


def nssda_of(found: CheckPointDifferences) -> Statement:
    return statement(delivered("nssda-1998"), found)


def test_the_published_differences_give_the_figures_computed_by_hand() -> None:
    found = differences(PUBLISHED_M, 84)
    # RMSE_H1 = √(.029² + .033²) = .0439, the survey's √2 · .02: RMSE_H .0522, RMSE_V .0623, RMSE_3D .0813.
    figures = asprs_of(found).figures
    assert figures["RMSE_H"] == pytest.approx(0.0522, abs=5e-5)
    assert figures["RMSE_V"] == pytest.approx(0.0623, abs=5e-5)
    assert figures["RMSE_3D"] == pytest.approx(0.0813, abs=5e-5)
    tested = nssda_of(found).figures
    assert tested["Accuracy_r"] == pytest.approx(0.0759, abs=1e-4)
    assert tested["Accuracy_z"] == pytest.approx(0.1156, abs=1e-4)


def test_the_factors_of_the_nssda_are_those_of_the_normal_distribution() -> None:
    equal = differences((1.0, 1.0, 1.0), 30)
    circle = np.sqrt(stats.chi2.ppf(0.95, 2))
    assert QUANTITIES["Accuracy_r"](equal) == pytest.approx(circle, abs=5e-5)
    # The same as 1.7308 of the radial RMSE.
    assert QUANTITIES["Accuracy_r"](equal) == pytest.approx(1.7308 * np.sqrt(2.0), abs=1e-4)
    assert QUANTITIES["Accuracy_z"](equal) == pytest.approx(stats.norm.ppf(0.975), abs=5e-5)


def test_the_error_of_the_survey_counts_for_asprs_and_not_for_the_nssda() -> None:
    exact, rough = (differences(PUBLISHED_M, 40, survey) for survey in (1e-9, 0.10))
    assert asprs_of(rough).figures["RMSE_V"] == pytest.approx(np.hypot(0.059, 0.10))
    assert asprs_of(exact).figures["RMSE_V"] == pytest.approx(0.059)
    assert nssda_of(rough).figures == nssda_of(exact).figures


def test_differences_are_not_centred() -> None:
    shifted = CheckPointDifferences(np.full((40, 3), 0.05), np.zeros((40, 3)))
    assert asprs_of(shifted).figures["RMSE_V"] == pytest.approx(0.05)
    assert QUANTITIES["mean_z"](shifted) == pytest.approx(0.05)
    assert QUANTITIES["max_r"](shifted) == pytest.approx(0.05 * np.sqrt(2.0))


@pytest.mark.parametrize(("number", "tested"), [(29, False), (30, True), (121, True)])
def test_asprs_wants_thirty_check_points_and_says_so(number: int, tested: bool) -> None:
    made = asprs_of(differences(PUBLISHED_M, number))
    assert made.tested is made.passed is tested
    assert made.least == 30
    assert "Edition 2, Version 2 (2024)" in made.sentence
    assert (f"this test was performed using ONLY {number} checkpoints" in made.sentence) is not tested
    assert "RMSE_H = 5.2 cm" in made.sentence
    assert "(NVA) was found to be RMSE_V = 6.2 cm" in made.sentence
    assert "95" not in made.sentence  # the edition states no figure at a confidence level


@pytest.mark.parametrize(("number", "tested"), [(19, False), (20, True)])
def test_the_nssda_wants_twenty_check_points_and_says_so(number: int, tested: bool) -> None:
    made = nssda_of(differences(PUBLISHED_M, number))
    assert made.tested is made.passed is tested
    assert made.least == 20
    assert "FGDC-STD-007.3-1998" in made.sentence
    if tested:
        assert "Tested 0.076 meters horizontal accuracy at 95% confidence level" in made.sentence
        assert "Tested 0.116 meters vertical accuracy at 95% confidence level" in made.sentence
    else:
        assert "not tested according to" in made.sentence
        assert "20 are needed" in made.sentence


@pytest.mark.parametrize(
    ("wanted", "missed", "passed"),
    [
        (AccuracyClass(0.058, 0.063), (), True),
        (AccuracyClass(0.052, 0.063), ("RMSE_H",), False),
        (AccuracyClass(0.058, 0.062), ("RMSE_V",), False),
        (AccuracyClass(0.030, 0.030), ("RMSE_H", "RMSE_V"), False),
        (None, (), True),
    ],
)
@pytest.mark.parametrize("number", [84, 12])
def test_the_class_asked_for_is_met_or_not(
    wanted: AccuracyClass | None, missed: tuple[str, ...], passed: bool, number: int
) -> None:
    made = asprs_of(differences(PUBLISHED_M, number), wanted)
    assert made.passed is (passed and number == 84)
    assert tuple(name for part in made.parts for name in part.exceeded) == missed
    assert made.sentence.count("NOT meet") == len(missed)
    if wanted is not None:
        assert f"{wanted.horizontal_m * 100:g} cm RMSE_H" in made.sentence


def test_a_figure_just_beyond_its_class_does_not_look_as_if_it_kept_it() -> None:
    made = asprs_of(differences((0.0, 0.0, 0.10004), 40, survey=0.0), AccuracyClass(0.10, 0.10))
    assert "does NOT meet a 10 cm RMSE_V Vertical Accuracy Class." in made.sentence
    assert "RMSE_V = 10.004 cm (40 check points)" in made.sentence
    (row,) = [
        row
        for row in figures_table([StatementFigure.model_validate(made.to_json())]).rows
        if "RMSE_V" in row.key
    ]
    assert row.cells[5:7] == (Number(pytest.approx(0.10004), 5), Number(0.10, 5))
    kept = asprs_of(differences((0.0, 0.0, 0.09999), 40, survey=0.0), AccuracyClass(0.10, 0.10))
    assert "RMSE_V = 10.0 cm (40 check points)" in kept.sentence


def test_a_survey_that_is_too_rough_for_the_class_is_refused() -> None:
    exact, rough = (differences((0.01, 0.01, 0.01), 40, survey) for survey in (0.01, 0.04))
    wanted = AccuracyClass(0.10, 0.10)
    assert asprs_of(exact, wanted).passed
    made = asprs_of(rough, wanted)
    assert all(part.case == "met" for part in made.parts if part.limits_m)
    assert not made.passed
    # Radial √2 · 4 cm is more than half of 10 cm; in height 4 cm is not.
    assert "the survey of the check points in plan is less accurate than 0.5 of the class" in made.sentence


def test_the_nssda_states_no_circle_where_the_two_directions_differ_too_much() -> None:
    made = nssda_of(differences((0.02, 0.05, 0.06), 40))
    assert "Accuracy_r" not in made.figures
    assert "No horizontal accuracy is stated" in made.sentence
    assert not made.passed
    assert "Accuracy_r" in nssda_of(differences((0.03, 0.05, 0.06), 40)).figures


def test_points_known_in_part_count_for_what_they_know() -> None:
    found = differences(PUBLISHED_M, 50)
    partly: Floats = found.difference.copy()
    partly[:15, 2] = np.nan
    partly[15:20, 0] = np.nan
    item = CheckPointDifferences(partly, found.survey_sigma)
    counted = [len(item.of(points).difference) for points in ("plan", "height", "both", "vegetated")]
    assert counted == [45, 35, 30, 0]
    np.testing.assert_allclose(item.rmse, PUBLISHED_M)


def test_without_heights_only_the_position_is_stated() -> None:
    found = differences(PUBLISHED_M, 40)
    plan: Floats = found.difference.copy()
    plan[:, 2] = np.nan
    for name in STANDARDS:
        made = statement(delivered(name), CheckPointDifferences(plan, found.survey_sigma))
        assert "no independent check points with a height" in made.sentence
        assert not {"RMSE_V", "RMSE_3D", "Accuracy_z"} & set(made.figures)
        assert {"RMSE_H", "Accuracy_r"} & set(made.figures)
        assert not made.passed


def test_points_under_vegetation_are_stated_apart_and_no_class_is_asked_of_them() -> None:
    found = differences((0.01, 0.01, 0.01), 70, 0.001)
    high: Floats = found.difference.copy()
    high[:35, 2] *= 20.0
    under = np.arange(70) < 35
    made = asprs_of(CheckPointDifferences(high, found.survey_sigma, under), AccuracyClass(0.02, 0.02))
    assert made.figures["RMSE_V"] == pytest.approx(np.hypot(0.01, 0.001))
    assert made.figures["RMSE_V vegetated"] == pytest.approx(np.hypot(0.2, 0.001))
    assert "(VVA) was found to be RMSE_V = 20.0 cm (35 check points)" in made.sentence
    assert made.passed


def test_control_points_are_no_check_points() -> None:
    nothing = CheckPointDifferences(np.zeros((0, 3)), np.zeros((0, 3)), control=84)
    for made in statements(nothing, None):
        assert not made.tested
        assert not made.passed
        assert made.figures == {}
        assert made.sentence.count("Not tested according to") == 1
        assert f"there are no independent check points, {made.least} are needed." in made.sentence
        assert (
            "The 84 control points were used in the adjustment and are no evidence of accuracy."
            in made.sentence
        )


def test_every_standard_says_what_of_it_was_compared_with_its_text() -> None:
    for name in STANDARDS:
        assert delivered(name).source
        assert delivered(name).verified.startswith("Not compared with the document itself.")


OWN = """
name = "Directive 12 of the survey department"
edition = "2026"
least_check_points = 5
tables = ["residuals"]
[[parts]]
points = "both"
states = ["RMSE_x", "RMSE_y", "max_z"]
[parts.limits_m]
RMSE_x = 0.05
max_z = 0.10
[parts.texts]
none = "No points."
too_few = "{n} of {least} points."
found = "Stated."
met = "Kept: {RMSE_x}, {max_z} m."
missed = "NOT kept: {exceeded}."
"""


def own(folder: Path, old: str = "", new: str = "") -> Path:
    file = folder / "own.toml"
    assert old in OWN
    file.write_text(OWN.replace(old, new, 1) if old else OWN, encoding="utf-8")
    return file


def test_a_template_of_ones_own_has_its_limits_and_words(tmp_path: Path) -> None:
    template = read_template(own(tmp_path))
    kept = statement(template, differences((0.04, 0.04, 0.09), 6))
    assert kept.passed
    assert kept.sentence.startswith("Kept: 0.040, 0.090 m.")
    assert "were not checked against the document" in kept.sentence
    beyond = statement(template, differences((0.06, 0.04, 0.2), 6))
    assert not beyond.passed
    assert "NOT kept: RMSE_x 0.060 above 0.05 m, max_z 0.200 above 0.1 m." in beyond.sentence
    few = statement(template, differences((0.04, 0.04, 0.09), 4))
    assert (few.tested, few.passed) == (False, False)
    assert few.sentence.startswith("4 of 5 points.")
    incomplete = statement(template, differences((0.04, 0.04, 0.09), 6), missing=["residuals"])
    assert not incomplete.passed
    assert "NOT complete: the required tables residuals are missing or empty." in incomplete.sentence


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("RMSE_x = 0.05", "RMSE_w = 0.05", "unknown quantity 'RMSE_w'. Did you mean 'RMSE_"),
        ('"max_z"]', '"largest"]', "unknown quantity 'largest'"),
        ("{max_z} m", "{max_q} m", "unknown quantity 'max_q'"),
        ("{max_z} m", "{max_z.__class__} m", "unknown quantity 'max_z.__class__'"),
        ("{max_z} m", "{max_z:>99999999} m", "quotes names as they are"),
        ('["residuals"]', '["residual"]', "unknown table 'residual'. Did you mean 'residuals'?"),
        ('missed = "NOT kept: {exceeded}."', "", "a part with limits needs the texts met and missed"),
        ("least_check_points = 5", "", "least_check_points"),
        ("max_z = 0.10", "max_z = -0.10", "greater than 0"),
        ("max_z = 0.10", "max_z = ", "not a TOML file"),
    ],
)
def test_a_template_with_something_unknown_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(InputError, match=r"\S") as refused:
        read_template(own(tmp_path, old, new))
    assert words in refused.value.what


def test_well_surveyed_points_under_vegetation_do_not_excuse_the_others() -> None:
    """30 points surveyed with 6 cm do not test a class of 10 cm, whatever 60 without a class have."""
    found = differences((0.02, 0.02, 0.02), 90, survey=0.01)
    vegetated = np.arange(90) >= 30
    found.survey_sigma[~vegetated, 2] = 0.06
    found = CheckPointDifferences(found.difference, found.survey_sigma, vegetated)
    said = asprs_of(found, AccuracyClass(0.10, 0.10))
    assert "NOT allowed: the survey of the check points in height" in said.sentence
    assert not said.passed
    # The other way round the points of the class are good enough.
    found.survey_sigma[:, 2] = np.where(vegetated, 0.20, 0.02)
    assert asprs_of(found, AccuracyClass(0.10, 0.10)).passed


def test_a_survey_of_unknown_accuracy_is_not_accurate_enough() -> None:
    found = differences((0.02, 0.02, 0.02), 30)
    found.survey_sigma[3, 2] = np.nan
    assert "NOT allowed: the survey of the check points in height" in (
        asprs_of(found, AccuracyClass(0.10, 0.10)).sentence
    )
