"""Which observations one pass of data snooping takes out, from statistics that are given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.least_squares import Adjuster
from adjust.observations.control_point import ControlPoints
from adjust.observations.distance import Distances
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT
from adjust.quality import rejection
from adjust.quality.control_locatability import Doubtful
from adjust.quality.rejection import Rejection, SnoopingRule, _least, choose, survey_information
from adjust.solve.system import Observations, System
from tests.adjust.scenes import DEGREE, MICROMETRE, Scene, two_strips

RAYS, CONTROL, GNSS = 0, 1, 2


def chosen(scene: Scene, statistics: dict[tuple[int, int], float]) -> Rejection:
    """What goes with a critical value of 4, if the statistics of all but some (group, row) are zero."""
    groups = scene.observations.groups
    values = tuple(np.zeros(len(group.event)) for group in groups)
    for (group, row), value in statistics.items():
        values[group][row] = value
    return choose(scene.observations, scene.truth, values, tuple(np.full(len(one), 4.0) for one in values))


def rows(found: Rejection, group: int) -> list[int]:
    return np.flatnonzero(found.rejected[group]).tolist()


def unsurveyed(scene: Scene, least: int) -> list[int]:
    """Object points with so many rays, or more, that no survey knows."""
    rays, control = scene.observations.image_points, scene.observations.others[0]
    return np.setdiff1d(np.flatnonzero(np.bincount(rays.point) >= least), control.point).tolist()


def with_rays_of(scene: Scene, point: int, kept: list[int]) -> Scene:
    """The same with some of the rays of a point alone, counted from its first one."""
    rays = scene.observations.image_points
    own = np.flatnonzero(rays.point == point)
    rest = np.setdiff1d(np.arange(len(rays.image)), np.delete(own, kept))
    return replace(scene, observations=Observations(rays.only(rest), scene.observations.others))


def test_of_an_object_point_the_largest_goes_and_of_an_image_every_point() -> None:
    scene = two_strips()
    rays = scene.observations.image_points
    image = int(rays.image[np.flatnonzero(rays.point == unsurveyed(scene, 5)[0])[0]])
    points = [point for point in unsurveyed(scene, 5) if image in rays.image[rays.point == point]][:2]
    first, second = (int(np.flatnonzero((rays.point == p) & (rays.image == image))[0]) for p in points)
    smaller = int(np.flatnonzero((rays.point == points[0]) & (rays.image != image))[0])
    xy = rays.xy.copy()
    xy[[first, second]] += 60 * MICROMETRE
    scene = replace(scene, observations=Observations(replace(rays, xy=xy), scene.observations.others))
    found = chosen(scene, {(RAYS, first): 9.0, (RAYS, second): 8.0, (RAYS, smaller): 8.9})
    assert rows(found, RAYS) == sorted([first, second])
    assert not found.given_up.any()


def test_of_the_first_object_point_the_largest_goes_too() -> None:
    own = np.flatnonzero(two_strips().observations.image_points.point == 0)[:2]
    assert rows(chosen(two_strips(), {(RAYS, int(own[0])): 8.0, (RAYS, int(own[1])): 9.0}), RAYS) == [own[1]]


def test_of_a_ray_whose_position_goes_in_its_place_the_next_one_of_its_point_takes_none() -> None:
    """Which is as likely to be wrong as it was before."""
    scene = two_strips()
    rays = scene.observations.image_points
    first, second = np.flatnonzero(rays.point == unsurveyed(scene, 5)[0])[:2].tolist()
    xy = rays.xy.copy()
    xy[second] += 60 * MICROMETRE
    scene = replace(scene, observations=Observations(replace(rays, xy=xy), scene.observations.others))
    exposure = int(rays.image[first])
    found = chosen(scene, {(GNSS, exposure): 10.0, (RAYS, first): 9.0, (RAYS, second): 8.0})
    assert (rows(found, GNSS), rows(found, RAYS)) == ([exposure], [second])


@pytest.mark.parametrize(("of_first", "place"), [(8.9995, 0), (8.99, 1)])
def test_of_two_rays_that_are_alike_but_for_rounding_the_first_goes(of_first: float, place: int) -> None:
    scene = with_rays_of(two_strips(), point := unsurveyed(two_strips(), 5)[0], [0, 1])
    own = np.flatnonzero(scene.observations.image_points.point == point)
    found = chosen(scene, {(RAYS, int(own[0])): of_first, (RAYS, int(own[1])): 9.0})
    assert rows(found, RAYS) == [own[place]]


@pytest.mark.parametrize(("seconds", "expected"), [(None, [3, 4, 6]), (12.0, [3, 6])])
def test_of_two_neighbours_of_a_strip_whose_errors_are_correlated_the_larger_one_goes(
    seconds: float | None, expected: list[int]
) -> None:
    scene = two_strips(images_per_strip=8, gnss_correlation_s=seconds)
    statistics = {(GNSS, 3): 10.0, (GNSS, 4): 9.0, (GNSS, 6): 8.0}
    assert rows(chosen(scene, statistics), GNSS) == expected


def test_a_point_of_three_rays_whose_wrong_one_cannot_be_told_is_given_up() -> None:
    """Three images of a strip notice an error along it, but not whose it is; nor does a distance."""
    scene = two_strips(strips=1, images_per_strip=5, headings_deg=(90.0,), control=("full",) * 3, distances=4)
    *others, distances = scene.observations.others
    assert isinstance(distances, Distances)
    rays = scene.observations.image_points
    point = next(p for p in unsurveyed(scene, 3) if np.count_nonzero(rays.point == p) == 3)
    first = int(np.flatnonzero(rays.point == point)[0])
    xy = rays.xy.copy()
    xy[first, 0] += 60 * MICROMETRE
    more = replace(distances, point=np.append(point, distances.point[1:]))
    damaged = Observations(replace(rays, xy=xy), (*others, more))
    found = chosen(replace(scene, observations=damaged), {(RAYS, first): 12.0})
    assert np.flatnonzero(found.given_up).tolist() == [point]


@pytest.mark.parametrize(("row", "given_up"), [(3, False), (None, True)])
def test_one_ray_and_a_height_determine_a_point_but_not_one_ray_alone(
    row: int | None, *, given_up: bool
) -> None:
    scene = two_strips()
    control = scene.observations.others[0]
    assert isinstance(control, ControlPoints)
    point = unsurveyed(scene, 5)[0] if row is None else int(control.point[row])
    if row is not None:
        assert control.stochastic.present[row].tolist() == [False, False, True]
    scene = with_rays_of(scene, point, [0, 1])
    first = int(np.flatnonzero(scene.observations.image_points.point == point)[0])
    found = chosen(scene, {(RAYS, first): 9.0})
    assert found.given_up[point] == given_up
    assert np.count_nonzero(found.given_up) == given_up


def test_what_surveys_know_of_their_points_is_their_weight_along_local_axes() -> None:
    scene = two_strips(distances=4)
    control = scene.observations.others[0]
    assert isinstance(control, ControlPoints)
    found = survey_information(scene.observations, scene.truth)
    assert sorted(found) == sorted(control.point.tolist())
    whitener = control.stochastic.whitener * control.stochastic.present[:, None, :]
    axes = control.frame.local_from_enu(scene.truth.object_point[control.point])
    for k, point in enumerate(control.point.tolist()):
        weight = axes[k] @ whitener[k].T @ whitener[k] @ axes[k].T
        np.testing.assert_allclose(found[point], weight, rtol=1e-3, atol=1e-3 * np.trace(weight))


@pytest.mark.parametrize("distances", [0, 4])
def test_a_survey_that_goes_leaves_a_point_of_one_ray_undetermined(distances: int) -> None:
    """Also if a distance begins there, which determines no point."""
    scene = two_strips(distances=distances)
    point = int(scene.observations.others[0].point[0])
    # A point that was undetermined before is no matter of this pass.
    scene = with_rays_of(with_rays_of(scene, point, [0]), unsurveyed(scene, 5)[0], [0])
    if distances:
        *others, last = scene.observations.others
        assert isinstance(last, Distances)
        joined = replace(last, point=np.append(point, last.point[1:]))
        scene = replace(scene, observations=Observations(scene.observations.image_points, (*others, joined)))
    found = chosen(scene, {(CONTROL, 0): 9.0})
    assert rows(found, CONTROL) == [0]
    assert np.flatnonzero(found.given_up).tolist() == [point]


@pytest.mark.parametrize(("gone", "survey_goes"), [(0, False), (1, False), (2, True)])
def test_a_survey_goes_in_place_of_a_ray_that_would_leave_it_less_than_half(
    gone: int, *, survey_goes: bool
) -> None:
    scene = two_strips()
    rays, point = scene.observations.image_points, int(scene.observations.others[0].point[0])
    own = np.flatnonzero(rays.point == point)
    assert len(own) == 4
    left = rays.without(np.isin(np.arange(len(rays.image)), own[:gone]))
    scene = replace(scene, observations=Observations(left, scene.observations.others))
    found = chosen(scene, {(RAYS, int(own[-1])): 9.0})
    assert rows(found, CONTROL) == [0] * survey_goes
    assert rows(found, RAYS) == ([] if survey_goes else [own[-1]])
    assert not found.given_up.any()


def test_a_distance_does_not_go_in_place_of_the_rays_of_its_points() -> None:
    scene = two_strips(distances=4)
    *others, distances = scene.observations.others
    assert isinstance(distances, Distances)
    point, rays = unsurveyed(scene, 4)[0], scene.observations.image_points
    ends = np.append(point, distances.point[1:])
    own = np.flatnonzero(rays.point == point)
    left = rays.without(np.isin(np.arange(len(rays.image)), own[2:]))
    observations = Observations(left, (*others, replace(distances, point=ends)))
    found = chosen(replace(scene, observations=observations), {(RAYS, int(own[0])): 9.0})
    assert rows(found, RAYS) == [own[0]]
    assert found.given_up[point]
    assert not found.rejected[-1].any()


def test_what_the_error_of_another_may_cause_waits_until_that_one_is_gone() -> None:
    """Seven tenths of the largest of its image and of all that is no image point; a fifth of any other."""
    scene = two_strips(free={BORESIGHT: True}, priors={BORESIGHT: 0.01 * DEGREE})
    observations = scene.observations
    image, prior = observations.image_points.image, len(observations.groups) - 1

    def least(statistics: dict[tuple[int, int], float]) -> tuple[float, float, float]:
        """Of the image points of the first image, of those of the others, and of positions."""
        values = tuple(np.zeros(len(group.event)) for group in observations.groups)
        for (group, row), value in statistics.items():
            values[group][row] = value
        found = _least(observations, values, 4.0)
        (of_first,), (of_rest,), (of_positions,) = (
            set(one.tolist()) for one in (found[RAYS][image == 0], found[RAYS][image > 0], found[GNSS])
        )
        return of_first, of_rest, of_positions

    ray = (RAYS, int(np.flatnonzero(image == 0)[0]))
    assert least({ray: 5.0}) == (4.0, 4.0, 4.0)
    assert least({ray: 40.0}) == pytest.approx((28.0, 8.0, 28.0))
    assert least({ray: 40.0, (GNSS, 3): 30.0}) == pytest.approx((28.0, 21.0, 28.0))
    # Nothing takes a prior away, so it hides as little as an image point elsewhere.
    assert least({ray: 40.0, (prior, 0): 120.0}) == pytest.approx((28.0, 24.0, 84.0))


def test_a_control_point_that_cannot_be_told_from_another_keeps_no_ray_of_its_point_from_going(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its own statistic is the larger one, but as it stays, nothing of its point goes in the ray's place."""
    scene = two_strips()
    adjusted = Adjuster(AdjustmentOptions()).adjust(System.of(scene.block, scene.observations), scene.truth)
    control, rays = scene.observations.others[0], scene.observations.image_points
    ray = int(np.flatnonzero(rays.point == control.point[0])[0])
    statistics = tuple(np.zeros(len(group.event)) for group in scene.observations.groups)
    statistics[CONTROL][0], statistics[RAYS][ray] = 50.0, 45.0
    is_first = np.arange(len(control.point)) == 0
    doubtful = Doubtful(CONTROL, is_first, control.point[:2], 50.0)
    monkeypatch.setattr(rejection, "snooping_statistics", lambda *_: statistics)
    monkeypatch.setattr(rejection, "doubtful_control", lambda *_, **__: doubtful)
    found = rejection.reject(adjusted, SnoopingRule(4.0))
    assert (rows(found, CONTROL), rows(found, RAYS)) == ([], [ray])
    assert found.inseparable.tolist() == sorted(control.point[:2].tolist())
