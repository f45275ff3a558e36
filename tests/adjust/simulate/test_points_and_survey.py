from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.simulate.block import simulate_block
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout, spread_order, survey_of
from adjust.simulate.truth import block_truth
from tests.adjust.simulate.specifications import small_specification

SQUARE = np.array([[0.0, 0.0], [1000.0, 600.0]])


@pytest.mark.parametrize("detection", [1.0, 0.4])
def test_about_as_many_tie_points_are_measured_as_asked_for(detection: float) -> None:
    specification = small_specification(survey=(), points=PointSpecification(2000, detection=detection))
    truth = block_truth(specification)
    assert len(truth.points) == pytest.approx(2000, rel=0.06)
    assert np.bincount(truth.point).min() >= 2


def test_points_keep_at_least_the_asked_number_of_rays() -> None:
    truth = block_truth(small_specification(points=PointSpecification(500, detection=0.6, rays=4)))
    assert np.bincount(truth.point).min() == 4


def test_rays_are_sorted_by_point_and_image_and_none_is_double() -> None:
    truth = block_truth(small_specification())
    key = truth.point * len(truth.plan.images) + truth.image
    assert np.all(np.diff(key) > 0)


def test_a_grid_lies_in_the_middle_of_its_cells() -> None:
    survey = survey_of((SurveyLayout("grid", columns=2, rows=3, margin=0.0),), SQUARE)
    np.testing.assert_allclose(survey.place[:, 0], [250, 750] * 3)
    np.testing.assert_allclose(survey.place[:, 1], [100, 100, 300, 300, 500, 500])
    assert not survey.is_check.any()


def test_a_perimeter_keeps_to_the_border() -> None:
    survey = survey_of((SurveyLayout("perimeter", count=8, margin=0.1),), SQUARE)
    part = (survey.place - [100, 60]) / [800, 480]
    on_border = np.isclose(part, 0.0).any(axis=1) | np.isclose(part, 1.0).any(axis=1)
    assert on_border.all()
    assert len(np.unique(part.round(9), axis=0)) == 8


def test_a_list_is_taken_as_it_stands() -> None:
    places = ((10.0, 20.0), (-5.0, 3.0))
    survey = survey_of((SurveyLayout("list", places=places),), SQUARE)
    np.testing.assert_array_equal(survey.place, places)


def test_fewer_control_points_are_a_part_of_more_and_the_first_four_are_corners() -> None:
    layouts = [SurveyLayout("grid", columns=12, rows=7, control=count) for count in (5, 10, 28, 44)]
    chosen = [set(np.flatnonzero(~survey_of((layout,), SQUARE).is_check)) for layout in layouts]
    assert [len(control) for control in chosen] == [5, 10, 28, 44]
    assert chosen[0] < chosen[1] < chosen[2] < chosen[3]
    corners = {0, 11, 72, 83}
    place = survey_of((layouts[0],), SQUARE).place
    whole = spread_order(place)
    assert set(whole[:4].tolist()) == corners
    assert sorted(whole) == list(range(len(place)))
    for most in (0, 1, 30, len(place) + 1):
        np.testing.assert_array_equal(spread_order(place, most), whole[:most])


def test_a_spread_layout_leaves_no_two_points_close() -> None:
    survey = survey_of((SurveyLayout("spread", count=9, margin=0.0),), SQUARE)
    distance = np.linalg.norm(survey.place[:, None] - survey.place[None], axis=-1)
    assert distance[~np.eye(9, dtype=bool)].min() > 250.0


def test_kinds_of_survey_say_what_is_known() -> None:
    kinds = ("full", "height", "plan")
    layouts = tuple(SurveyLayout("grid", kind, columns=1, rows=1) for kind in kinds)
    present = survey_of(layouts, SQUARE).present
    assert present.tolist() == [[True, True, True], [False, False, True], [True, True, False]]


def test_control_points_lie_where_images_see_them_even_in_a_cross() -> None:
    one, other = small_specification().flight
    cross = (replace(one, exposures=(14, 14)), replace(other, exposures=(14, 14)))
    layout = SurveyLayout("grid", columns=6, rows=6)
    truth = block_truth(small_specification(flight=cross, survey=(layout,)))
    assert len(truth.surveyed) == 36


def test_surveyed_points_are_measured_wherever_they_are_seen() -> None:
    specification = small_specification(points=PointSpecification(300, detection=0.3))
    thin, full = block_truth(specification), block_truth(small_specification())
    rays_thin = np.bincount(thin.point)[thin.surveyed]
    np.testing.assert_array_equal(rays_thin, np.bincount(full.point)[full.surveyed])
    assert thin.points[:2] == ("C001", "C002")


def test_a_block_with_height_only_and_check_points_observes_only_what_is_known() -> None:
    layouts = (
        SurveyLayout("perimeter", count=4),
        SurveyLayout("grid", "height", columns=2, rows=2, control=3),
    )
    simulated = simulate_block(small_specification(survey=layouts))
    observations = simulated.observations(simulated.block())
    control = next(group for group in observations.others if group.name == "control_points")
    assert control.stochastic.present.sum(axis=1).tolist() == [3, 3, 3, 3, 1, 1, 1]
