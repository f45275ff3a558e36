"""Sentences about an adjustment follow from its figures alone."""

from __future__ import annotations

import pandas as pd
import pytest

from tasks.remarks.adjustment import (
    free_network_sentences,
    given_ground,
    global_test_sentences,
    group_sentences,
    late_head_sentences,
    registered_calibration_sentences,
    rejection_sentences,
    self_calibration_sentences,
    shared_moment_sentences,
    trust_map_sentences,
)
from tasks.remarks.independent_checks import (
    check_point_sentences,
    check_survey_words,
    distance_sentences,
)
from tasks.remarks.observation_sigmas import (
    correlation_time_sentences,
    unestimated_sentences,
    variance_sentences,
)
from tasks.remarks.residual_grid import residual_grid_sentences
from tasks.results.figures import (
    AdjustmentFigures,
    CameraGridFigure,
    ComponentFigure,
    CorrectionErrorsFigure,
    CorrelationTimeFigure,
    FreeNetworkFigure,
    GlobalTestFigure,
    GridIterationFigure,
    GridStepFigure,
    GroupFigure,
    LateHeadFigure,
    RegisteredCalibrationFigure,
    ResidualGridFigure,
    SelfCalibrationFigures,
    SharedMoments,
    TrustMapGrid,
    VarianceFigures,
    WithinCellsFigure,
    figures_of,
)
from tasks.results.summary import CheckPointTest

CAMERA_GRID = CameraGridFigure(
    camera="A",
    columns=25,
    rows=25,
    residuals=(9000, 9000),
    known=600,
    significant=120,
    confidence=0.95,
    expected_by_chance=30.0,
    significant_jointly=20,
    largest_um=1.24,
    rms_um=(0.3, 0.3),
    noise_um=(0.2, 0.2),
    signal_um=(0.2, 0.2),
    correction_rms_um=None,
)


def control(**changed: object) -> GroupFigure:
    usual = {"group": "control_points", "observations": 30, "redundancy": 25.0, "sigma0": 1.0, "rows": 10}
    return GroupFigure.model_validate({**usual, **changed})


def test_a_sound_adjustment_gives_no_sentence() -> None:
    test = GlobalTestFigure(lower=0.9, upper=1.1, confidence=0.95, passed=True)
    figures = AdjustmentFigures(groups=(control(),), global_test=test, critical_value=4.13)
    assert not [*global_test_sentences(figures, 1.0, 25.0), *group_sentences(figures)]
    assert not [*rejection_sentences(figures), *self_calibration_sentences(figures)]
    assert not [*variance_sentences(None), *correlation_time_sentences(None)]
    assert not [*unestimated_sentences(None, None)]
    assert not [*free_network_sentences(None), *shared_moment_sentences(None)]


def test_a_number_beyond_its_limit_does_not_look_like_it() -> None:
    failed = GlobalTestFigure(lower=0.9, upper=1.0352, confidence=0.95, passed=False)
    (sentence,) = global_test_sentences(AdjustmentFigures(global_test=failed), 1.0354, 25.0)
    assert "σ0 is 1.0354, expected from the stated σ: 0.9000 to 1.0352" in sentence
    three = (0.02, 0.02, 0.02)
    test = CheckPointTest(
        points=(8, 8, 8),
        rmse_m=(0.03931, 0.02, 0.02),
        predicted_rmse_m=three,
        predicted_low_m=(0.009, 0.009, 0.009),
        predicted_high_m=(0.0391, 0.0391, 0.0391),
        ratio=(2.0, 1.0, 1.0),
        degrees_of_freedom=(8.0, 8.0, 8.0),
        mean_m=(-0.02504, 0.0, 0.0),
        mean_limit_m=(0.025, 0.025, 0.025),
        confidence=0.95,
        over_limit=1.01,
    )
    (sentence,) = check_point_sentences(test, "control")
    assert "RMS east 0.0393 m, expected 0.0090 to 0.0391 m" in sentence
    assert "mean east -0.02504 m, expected within ±0.02500 m" in sentence


def test_differences_smaller_than_expected_are_named_too() -> None:
    high = (0.04, 0.04, 0.04)
    test = CheckPointTest(
        points=(8, 8, 8),
        rmse_m=(0.0089, 0.02, 0.02),
        predicted_rmse_m=high,
        predicted_low_m=(0.009, 0.009, 0.009),
        predicted_high_m=high,
        ratio=(0.2, 0.5, 0.5),
        degrees_of_freedom=(8.0, 8.0, 8.0),
        mean_m=(0.0, 0.0, 0.0),
        mean_limit_m=high,
        confidence=0.95,
        over_limit=0.5,
    )
    (sentence,) = check_point_sentences(test, "control")
    assert "smaller than expected from their σ: RMS east 0.0089 m, expected 0.0090 to 0.0400 m" in sentence
    enough = test.model_copy(update={"rmse_m": (0.0091, 0.02, 0.02)})
    assert not [*check_point_sentences(enough, "control")]


@pytest.mark.parametrize(
    ("observed", "against"),
    [
        (("control_points", "gnss_positions"), " against those of control and GNSS"),
        (("image_points", "control_points"), " against those of control"),
        (("gnss_positions",), " against those of GNSS"),
        (("image_points", "distances"), ""),
    ],
)
def test_check_points_are_to_be_compared_with_what_is_observed(
    observed: tuple[str, ...], against: str
) -> None:
    figures = AdjustmentFigures(groups=tuple(control(group=name) for name in observed))
    assert check_survey_words(given_ground(figures)) == (
        f"check datum, height system and survey of the check points{against}"
    )


def test_distances_beyond_their_limits_and_rejected_ones_are_named_in_millimetres() -> None:
    # Of two, each is tested at 2.5 %: 2.24 σ.
    table = pd.DataFrame(
        {
            "status": ["check", "check", "rejected", "used"],
            "point": ["A", "C", "E", "G"],
            "other_point": ["B", "D", "F", "H"],
            "difference_m": [-0.00226, 0.00222, 0.0213, 0.1],
            "sigma_difference_m": [0.001, 0.001, 0.002, 0.001],
        }
    )
    beyond, rejected = distance_sentences(table, 0.95)
    assert "(95 % for all 2): A to B -2.26 mm (σ 1 mm). Check scale" in beyond
    assert rejected == "Distances were rejected as gross errors: E to F +21.3 mm (σ 2 mm)."


def test_a_registered_calibration_that_the_block_contradicts_is_named_with_its_chance() -> None:
    figure = RegisteredCalibrationFigure(
        camera="A", use="considered", parameters=3, statistic=24.5, freedom=3, probability=2e-5,
        contradicted=True,
    )  # fmt: skip
    found = (figure, figure.model_copy(update={"camera": "B", "contradicted": False}))
    (sentence,) = registered_calibration_sentences(
        AdjustmentFigures(registered_calibrations=found, groups=(control(),))
    )
    assert "camera A in the registry: T is 24.5 with 3 degrees of freedom" in sentence
    assert "exceeded by chance in 0.002 % of all blocks" in sentence
    assert "the block has an error of its control, or σ that are too small" in sentence
    (sentence,) = registered_calibration_sentences(AdjustmentFigures(registered_calibrations=found))
    assert "the block has σ that are too small" in sentence


def test_no_redundancy_is_named_before_a_failed_test() -> None:
    failed = GlobalTestFigure(lower=0.9, upper=1.1, confidence=0.95, passed=False)
    figures = AdjustmentFigures(global_test=failed)
    (sentence,) = global_test_sentences(figures, 1.3, 25.0)
    assert sentence == (
        "The global test fails: σ0 is 1.300, expected from the stated σ: 0.900 to 1.100 (95 %)."
    )
    (sentence,) = global_test_sentences(figures, 1.3, 0.0)
    assert "no redundancy" in sentence


@pytest.mark.parametrize(
    ("rejected", "rows", "named"),
    [
        (2, 10, False),
        (5, 10, False),
        (6, 10, True),
        (2, 3, False),
        (3, 5, True),
        (2, 2, True),
        (1, 1, False),
        (0, 0, False),
    ],
)
def test_a_group_that_is_mostly_rejected_has_a_common_cause(rejected: int, rows: int, named: bool) -> None:
    group = control(rejected_rows=rejected, rows=rows)
    found = [*group_sentences(AdjustmentFigures(groups=(group,)))]
    assert [text.startswith(f"{rejected} of {rows} control points were rejected") for text in found] == (
        [True] if named else []
    )


@pytest.mark.parametrize(("sigma0", "verdict"), [(1.5, "worse"), (0.6, "better")])
def test_a_group_that_does_not_fit_is_named(sigma0: float, verdict: str) -> None:
    (sentence,) = group_sentences(AdjustmentFigures(groups=(control(sigma0=sigma0, redundancy=10.0),)))
    assert sentence.startswith(f"The control points fit {verdict} than their σ predict")
    assert not [*group_sentences(AdjustmentFigures(groups=(control(sigma0=sigma0, redundancy=9.0),)))]


def test_rejections_name_control_points_and_given_up_points() -> None:
    rays = GroupFigure(group="image_points", observations=100, rejected=7, uncontrolled=4)
    figures = AdjustmentFigures(
        groups=(rays, control(rejected=3)),
        critical_value=4.13,
        taken_back=2,
        rejected_control=("C1",),
        given_up_points=tuple(f"P{k}" for k in range(7)),
    )
    first, points, given_up, uncontrolled = rejection_sentences(figures)
    assert "image points (7), control points (3)" in first
    assert "above 4.13); 2 that had been rejected were accepted again" in first
    one, *_ = rejection_sentences(figures.model_copy(update={"taken_back": 1}))
    assert "above 4.13); 1 that had been rejected was accepted again" in one
    assert points.startswith("Rejected control points: C1.")
    assert given_up.startswith("7 object points were removed")
    assert "P0, P1, P2, P3, P4 and 2 more" in given_up
    assert uncontrolled.startswith("4 image coordinates are uncontrolled")
    assert uncontrolled.endswith(" They were not tested.")
    (only,) = rejection_sentences(figures.model_copy(update={"critical_value": None}))
    assert only == uncontrolled.removesuffix(" They were not tested.")


@pytest.mark.parametrize(("number", "words"), [(1, "coordinate … is"), (12, "coordinates … are")])
def test_control_points_whose_errors_nothing_would_show_are_counted(number: int, words: str) -> None:
    """A height measured in two images: whatever is wrong with it goes into the result."""
    rays = GroupFigure(group="image_points", observations=100)
    names = tuple(f"z of C{k:02}" for k in range(number))
    groups = (rays, control(uncontrolled=number))
    figures = AdjustmentFigures(groups=groups, critical_value=4.13, uncontrolled_control=names)
    (sentence,) = rejection_sentences(figures)
    start = words.replace("…", "of control points")
    assert sentence.startswith(f"{number} {start} uncontrolled (redundancy number below 0.1, such as heights")
    assert (
        f": {'z of C00' if number == 1 else 'z of C00, z of C01, z of C02, z of C03, z of C04 and 7 more'}."
        in sentence
    )
    assert sentence.endswith("tested for rejection.")
    (sentence,) = rejection_sentences(figures.model_copy(update={"critical_value": None}))
    assert sentence.endswith("resemble a tilt or scale of the control.")


def test_a_single_one_is_spoken_of_as_one() -> None:
    rays = GroupFigure(group="image_points", observations=100, rejected=1, uncontrolled=1)
    figures = AdjustmentFigures(groups=(rays,), critical_value=4.13, taken_back=1, given_up_points=("P7",))
    rejected, given_up, uncontrolled = rejection_sentences(figures)
    assert "1 that had been rejected was accepted again" in rejected
    assert given_up == (
        "1 object point was removed, because the wrong one of its image points cannot be identified: P7."
    )
    assert uncontrolled.startswith("1 image coordinate is uncontrolled (")
    assert uncontrolled.endswith("a gross error in it would not be detected. It was not tested.")
    lost = SelfCalibrationFigures(
        parameters="brown", elimination="none", offered=5, kept=4, not_determinable=("brown:K3",)
    )
    (sentence,) = self_calibration_sentences(AdjustmentFigures(self_calibration=lost))
    assert sentence.startswith("1 additional parameter is not determinable in this block and was removed: ")
    assert sentence.endswith("lists the parameters from which it cannot be separated).")


def test_parameters_that_cannot_be_determined_are_counted_and_named() -> None:
    lost = SelfCalibrationFigures(
        parameters="bluh:1-12",
        elimination="bluh",
        offered=12,
        kept=3,
        not_determinable=tuple(f"bluh:{k}" for k in range(1, 10)),
    )
    (sentence,) = self_calibration_sentences(AdjustmentFigures(self_calibration=lost))
    assert sentence.startswith("9 additional parameters are not determinable")
    assert "bluh:8 … (" in sentence


def test_datum_events_and_trust_map() -> None:
    free = FreeNetworkFigure(inner_constraints="both", defect=1, open=("scale",))
    (sentence,) = free_network_sentences(free)
    assert "do not determine 1 direction of the datum (scale)" in sentence
    (sentence,) = free_network_sentences(free.model_copy(update={"defect": 0}))
    assert "the result is an ordinary adjustment" in sentence
    (of_rig,) = shared_moment_sentences(SharedMoments(images=300, moments=60, heads=5))
    (alone,) = shared_moment_sentences(SharedMoments(images=4, moments=2))
    assert "300 images of 5 heads were exposed at 60 events" in of_rig
    assert "4 images were exposed at 2 times by several heads" in alone
    grid = {"west_m": 0.0, "north_m": 0.0, "cell_m": 1.0, "rows": 2, "columns": 2, "sigma_image_um": 1.0}
    mapped = TrustMapGrid.model_validate({**grid, "added_pairs": 0, "cells": 3, "area_cells": 4})
    (unmapped,) = trust_map_sentences(mapped)
    assert unmapped.startswith("1 of the 4 cells of the area of the trust map is not mapped: fewer than two")
    assert unmapped.endswith("It counts as exceeding every limit.")
    late = LateHeadFigure(head="left", offset_s=0.02, sigma_m=0.0063, part_of_sigma=0.312)
    (carried,) = late_head_sentences((late,))
    assert "not known to 0.006 m where the body carried left in its 20 ms" in carried
    assert "0.3 times the σ of its projection centres" in carried
    (none,) = trust_map_sentences(None)
    assert none.startswith("There is no trust map")
    assert "less than a cell (trust_map.cell_m)" in none


def component(part: str, **changed: object) -> ComponentFigure:
    usual = {"estimated": True, "factor": 2.0, "factor_lower": 1.5, "factor_upper": 2.5}
    rest = {"sigma": 0.1, "unit": "m", "redundancy": 9.0, "degrees_of_freedom": 8.0}
    return ComponentFigure.model_validate({"part": part, **usual, **rest, **changed})


def test_stated_standard_deviations_that_do_not_agree_are_named() -> None:
    parts = (
        component("gnss_positions height"),
        component("image_points", factor=1.1, factor_lower=0.9, factor_upper=1.3),
        component("control_points plan", estimated=False, factor_lower=None, factor_upper=None),
        component("ins_attitudes", factor_upper=None),
        component("distances", factor=0.5, factor_lower=0.4, factor_upper=0.8),
    )
    figures = VarianceFigures(rounds=3, confidence=0.95, components=parts)
    height, attitudes, distances = variance_sentences(figures)
    (kept,) = unestimated_sentences(figures, None)
    assert height.startswith("The stated σ of GNSS positions in height do not agree with the residuals")
    assert "2.00 (1.50 to inf) times as large" in attitudes
    assert "0.50 (0.40 to 0.80) times as large" in distances
    assert kept.endswith("the σ of control points in plan; they remain as stated.")


@pytest.mark.parametrize(
    ("verdict", "limits", "said"),
    [
        ("stated", (None, None), "it stays at 30 s"),
        ("undetermined", (0.0, None), "do not show whether"),
        ("none", (0.0, 4.0), "correlation time below 4 s"),
        ("longer", (90.0, None), "It is longer than 90 s"),
        ("estimated", (25.0, 35.0), "25 to 35 s), not 20 s as stated"),
        ("estimated", (15.0, 35.0), None),
    ],
)
def test_every_verdict_on_a_correlation_time_has_its_sentence(
    verdict: str, limits: tuple[float | None, float | None], said: str | None
) -> None:
    figure = CorrelationTimeFigure(
        group="gnss_positions",
        stated_s=20.0,
        correlation_s=30.0,
        lower_s=limits[0],
        upper_s=limits[1],
        verdict=verdict,
        tested=True,
    )
    found = [*correlation_time_sentences((figure,)), *unestimated_sentences(None, (figure,))]
    assert len(found) == (said is not None)
    assert said is None or said in found[0]
    untested = (figure.model_copy(update={"tested": False}),)
    assert not [*correlation_time_sentences(untested), *unestimated_sentences(None, untested)]


def test_systematic_means_and_correlated_neighbours_are_named_by_camera() -> None:
    grid = CAMERA_GRID
    rows = pd.DataFrame(
        {
            "camera": ["A", "A", "A", "A", "B"],
            "distance_to_mm": [1.0, 2.0, 4.0, 8.0, 2.0],
            "correlation": [0.11, 0.21, 0.16, 0.6, 0.3],
            "correlated": [True, True, True, True, False],
        }
    )
    systematic, neighbours = residual_grid_sentences(ResidualGridFigure(cameras=(grid,)), rows)
    assert (
        "camera A: up to 1.2 µm in sub-areas of the image, significant in 20 % of 600 (by chance: 5 %)"
        in systematic
    )
    assert "camera A are correlated (up to 0.21 below 2 mm)" in neighbours
    few = rows.assign(correlation=[0.11, 1.14, 0.16, 0.6, 0.3])
    _, neighbours = residual_grid_sentences(ResidualGridFigure(cameras=(grid,)), few)
    assert "camera A are correlated (up to 1.00 below 2 mm)" in neighbours
    by_chance = grid.model_copy(update={"significant": 51})
    assert not [*residual_grid_sentences(ResidualGridFigure(cameras=(by_chance,)), rows[4:])]


def test_a_correction_is_said_with_what_it_did_to_sigma0() -> None:
    steps = tuple(
        GridStepFigure(number=k, sigma0=s0, rms_um=0.2, noise_um=0.1)
        for k, s0 in enumerate((1.25, 1.1, 1.05))
    )
    iteration = GridIterationFigure(taken=2, reason="settled", gain=0.1, steps=steps)
    none = pd.DataFrame({"camera": [], "distance_to_mm": [], "correlation": [], "correlated": []})
    remaining = CorrectionErrorsFigure(heights=5.0)
    figure = ResidualGridFigure(cameras=(), iteration=iteration, remaining=remaining)
    sentence, *_ = residual_grid_sentences(figure, none)
    assert "corrected 2 times by their mean residuals, which changed σ0 from 1.250 to 1.050; " in sentence


def test_corrections_by_mean_residuals_say_whether_sigmas_contain_what_they_leave() -> None:
    steps = tuple(GridStepFigure(number=k, sigma0=1.2 - 0.2 * k, rms_um=0.3, noise_um=0.2) for k in range(2))
    no_pairs = pd.DataFrame({"camera": [], "distance_to_mm": [], "correlation": [], "correlated": []})
    iteration = GridIterationFigure(taken=1, reason="settled", gain=0.2, steps=steps)
    camera = CAMERA_GRID.model_copy(update={"image_error_um": 1.24, "significant": 20})
    figure = ResidualGridFigure(cameras=(camera,), iteration=iteration)
    sentence, exact = residual_grid_sentences(figure, no_pairs)
    assert "corrected once by their mean residuals, which changed σ0 from 1.200 to 1.000" in sentence
    assert "The standard deviations take the corrections by mean residuals as exact" in exact
    remaining = CorrectionErrorsFigure(heights=5.04, factor=2.27, parameter="focal_length", entity="A")
    little = {"remaining": remaining.model_copy(update={"heights": 1.4})}
    assert len([*residual_grid_sentences(figure.model_copy(update=little), no_pairs)]) == 2
    much = figure.model_copy(update={"remaining": remaining})
    _, included, remedy = residual_grid_sentences(much, no_pairs)
    assert 'set adjustment.residual_grid.method = "collocation"' in remedy
    assert "include what the corrections by mean residuals leave" in included
    assert "image errors of 1.2 µm (camera A)" in included
    assert "are 5.0 times as large as without; " in included
    assert "that of focal length of A has grown most: 2.3 times." in included
    collocated = iteration.model_copy(update={"method": "collocation"})
    figure = figure.model_copy(update={"iteration": collocated, "remaining": remaining})
    sentence, _ = residual_grid_sentences(figure, no_pairs)
    assert "corrected once by collocation of their mean residuals, which" in sentence
    none = iteration.model_copy(update={"taken": 0})
    (sentence,) = residual_grid_sentences(ResidualGridFigure(cameras=(), iteration=none), no_pairs)
    assert "not corrected" in sentence
    assert "exact" not in sentence


def test_sub_areas_too_coarse_for_the_image_errors_are_named_with_what_to_do() -> None:
    no_pairs = pd.DataFrame({"camera": [], "distance_to_mm": [], "correlation": [], "correlated": []})
    within = WithinCellsFigure(rms_um=0.124, probability=1e-9, significant=True, enough=18)
    camera = CAMERA_GRID.model_copy(
        update={"columns": 9, "rows": 9, "known": 81, "significant": 4, "within": within, "parts": 1}
    )

    def said(**update: object) -> str:
        found = camera.model_copy(update=update)
        (sentence,) = residual_grid_sentences(ResidualGridFigure(cameras=(found,)), no_pairs)
        return sentence

    assert "The 9 × 9 sub-areas are too coarse for the image errors of camera A" in said()
    assert "errors of 0.12 µm (RMS)" in said()
    assert "do not include them. Within 18 × 18 sub-areas the residuals show no such errors" in said()
    assert said().endswith("set adjustment.residual_grid.cells to 18 where the corrections are computed.")
    assert "do not include" not in said(parts=3)
    assert "enter the seams" in said(within=within.model_copy(update={"enough": None}))
    chance = camera.model_copy(update={"within": within.model_copy(update={"significant": False})})
    assert not [*residual_grid_sentences(ResidualGridFigure(cameras=(chance,)), no_pairs)]


def test_where_nothing_was_corrected_sigmas_that_grow_deserve_a_word() -> None:
    no_pairs = pd.DataFrame({"camera": [], "distance_to_mm": [], "correlation": [], "correlated": []})
    step = GridStepFigure(number=0, sigma0=1.0, rms_um=0.1, noise_um=0.2)
    iteration = GridIterationFigure(taken=0, reason="nothing_to_model", gain=0.0, steps=(step,))
    camera = CAMERA_GRID.model_copy(update={"image_error_um": 1.6, "significant": 20})
    figure = ResidualGridFigure(cameras=(camera,), iteration=iteration)
    grown = figure.model_copy(update={"remaining": CorrectionErrorsFigure(heights=4.1)})
    _, sentence, *_ = residual_grid_sentences(grown, no_pairs)
    assert "indicate image errors of 1.6 µm (camera A), and the standard deviations include" in sentence
    assert "are 4.1 times as large as without." in sentence
    hardly = figure.model_copy(update={"remaining": CorrectionErrorsFigure(heights=1.01, factor=1.02)})
    assert len([*residual_grid_sentences(hardly, no_pairs)]) == 1


def test_figures_of_earlier_versions_are_read() -> None:
    assert figures_of({"groups": [{"group": "image_points", "observations": 2}]}).groups[0].rows == 0
