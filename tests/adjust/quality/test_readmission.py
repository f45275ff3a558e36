"""What was rejected wrongly comes back; what was rejected rightly does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.data_snooping import Search
from adjust.least_squares import Adjuster
from adjust.observations.control_point import ControlPoints
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, ConsideredParameters, ParameterPlace
from adjust.quality.locatability import explanations
from adjust.quality.readmission import _predicted, in_place
from adjust.quality.rejection import SnoopingRule, snooping_statistics
from adjust.quality.snooping_statistic import normal_equivalent
from adjust.result import ObservationStatus
from adjust.solve.system import Observations, System
from tests.adjust.scenes import DEGREE, MICROMETRE, Scene, two_strips

RULE = SnoopingRule(4.13)


def search_without(scene: Scene, rays: list[int], positions: list[int], given_up: list[int]) -> Search:
    """A search that has rejected some observations and given up some points."""
    adjuster = Adjuster(AdjustmentOptions(critical_value=4.13))
    system = System.of(scene.block, scene.observations)
    search = Search.start(scene.observations, adjuster.adjust(system, scene.block.approximate_state()))
    rejected = tuple(mask.copy() for mask in search.rejected)
    rejected[0][rays] = True
    rejected[2][positions] = True
    points = search.given_up.copy()
    points[given_up] = True
    search = replace(search, rejected=rejected, given_up=points)
    return replace(search, adjusted=adjuster.again(search.adjusted, search.remaining()))


def rays_of_many(scene: Scene) -> list[int]:
    """Two rays of unsurveyed points with five rays."""
    rays = scene.observations.image_points
    counts = np.bincount(rays.point)
    chosen = np.setdiff1d(np.flatnonzero(counts == 5), scene.observations.others[0].point)
    return [int(ray) for ray in np.searchsorted(rays.point, chosen[[0, -1]])]


def two_ray_point(scene: Scene) -> int:
    counts = np.bincount(scene.observations.image_points.point)
    return int(np.setdiff1d(np.flatnonzero(counts == 2), scene.observations.others[0].point)[0])


@pytest.mark.parametrize("test", ["components", "observations"])
def test_sound_observations_come_back_once(test: Any) -> None:
    scene = two_strips(noise_seed=8)
    point = two_ray_point(scene)
    rays = rays_of_many(scene)
    search = search_without(scene, rays, [3], [point])
    rule = SnoopingRule(4.13, test)
    back = search.fitting_again(rule)
    assert np.flatnonzero(back.observations[0]).tolist() == rays
    assert np.flatnonzero(back.observations[2]).tolist() == [3]
    assert np.flatnonzero(back.points).tolist() == [point]
    adjuster = Adjuster(AdjustmentOptions(critical_value=4.13))
    again = search.more(adjuster, back)
    assert again.adjusted.solution.stalled
    again = replace(again, adjusted=adjuster.to_the_end(again.adjusted))
    ordinary = adjust_block(scene.block, scene.observations)
    np.testing.assert_allclose(again.adjusted.state.object_point, ordinary.state.object_point, atol=1e-5)
    assert again.taken_back == 3 + 2
    # Rejected again, they stay where they are.
    twice = replace(again, rejected=search.rejected, given_up=search.given_up)
    assert twice.fitting_again(rule).count == 0


def test_a_point_that_was_given_up_stands_where_its_rays_meet_however_it_was_left() -> None:
    scene = two_strips(noise_seed=8)
    point = two_ray_point(scene)
    search = search_without(scene, [], [], [point])
    found = in_place(search.adjusted, scene.observations, search.given_up)
    rows = scene.observations.image_points.point == point
    # Of two rays only the parallax is left.
    assert np.abs(found.residuals[0].residual[rows]).max() < 6 * MICROMETRE
    assert np.linalg.norm(found.state.object_point[point] - scene.truth.object_point[point]) < 1.0
    np.testing.assert_array_equal(
        found.residuals[0].residual[~rows], search.adjusted.residuals[0].residual[~rows]
    )
    places = search.adjusted.state.object_point.copy()
    places[point] += 7.0
    solution = replace(search.adjusted.solution, state=replace(search.adjusted.state, object_point=places))
    again = in_place(replace(search.adjusted, solution=solution), scene.observations, search.given_up)
    np.testing.assert_array_equal(again.state.object_point, found.state.object_point)
    np.testing.assert_array_equal(again.residuals[0].residual, found.residuals[0].residual)


def test_wrong_observations_do_not_come_back() -> None:
    scene = two_strips(noise_seed=8)
    rays = scene.observations.image_points
    point = two_ray_point(scene)
    xy = rays.xy.copy()
    wrong = rays_of_many(scene)[0]
    xy[[wrong, int(np.searchsorted(rays.point, point))]] += 60 * MICROMETRE
    gnss: Any = scene.observations.others[1]
    observed = gnss.observed.copy()
    observed[3] += 1.0
    others = list(scene.observations.others)
    others[1] = replace(gnss, observed=observed)
    observations = replace(scene.observations, image_points=replace(rays, xy=xy), others=tuple(others))
    search = search_without(replace(scene, observations=observations), [wrong], [3], [point])
    assert search.fitting_again(RULE).count == 0


@pytest.mark.parametrize(("component", "wrong", "size_um"), [(0, 3, 10), (1, 0, 14), (1, 2, 20)])
def test_of_two_suspects_the_one_that_fits_comes_back_and_stays(
    component: int, wrong: int, size_um: float
) -> None:
    """Each may fit without the other; both together do not, and neither is rejected once more."""
    scene = two_strips(noise_seed=8)
    rays = scene.observations.image_points
    points = np.setdiff1d(np.flatnonzero(np.bincount(rays.point) == 4), scene.observations.others[0].point)
    point = points[0] if component else points[-1]
    own = np.flatnonzero(rays.point == point)
    xy = rays.xy.copy()
    xy[own[wrong], component] += size_um * MICROMETRE
    observations = replace(scene.observations, image_points=replace(rays, xy=xy))
    result = adjust_block(scene.block, observations, AdjustmentOptions(critical_value=4.13))
    assert result.rejected_per_pass == (2,)
    assert result.taken_back == 1
    assert (result.groups[0].status[own] == ObservationStatus.REJECTED).all(axis=1).sum() == 1


@pytest.mark.parametrize("test", ["components", "observations"])
def test_sound_rays_of_one_point_come_back_one_after_the_other(test: Any) -> None:
    scene = two_strips(noise_seed=8)
    first = rays_of_many(scene)[0]
    adjuster, rule = Adjuster(AdjustmentOptions(critical_value=4.13)), SnoopingRule(4.13, test)
    search = search_without(scene, [first, first + 1], [], [])
    for _ in range(2):
        back = search.fitting_again(rule)
        assert back.count == 1
        search = search.more(adjuster, back)
    assert not search.rejected[0].any()


def with_ray_error(scene: Scene, ray: int, component: int, error_um: float) -> Scene:
    rays = scene.observations.image_points
    xy = rays.xy.copy()
    xy[ray, component] += error_um * MICROMETRE
    return replace(scene, observations=replace(scene.observations, image_points=replace(rays, xy=xy)))


def test_a_ray_comes_back_to_a_point_of_which_another_ray_is_wrong_without_it_too() -> None:
    first = rays_of_many(two_strips(noise_seed=8))[0]
    scene = with_ray_error(two_strips(noise_seed=8), first + 2, 1, 20.0)
    back = search_without(scene, [first], [], []).fitting_again(RULE)
    assert np.flatnonzero(back.observations[0]).tolist() == [first]


def test_of_a_surveyed_point_a_ray_that_fits_comes_back_whatever_the_others_would_say_alone() -> None:
    """Without the survey another ray would be suspicious as soon as it is back."""
    scene = two_strips(noise_seed=8)
    rays, point = scene.observations.image_points, scene.observations.others[0].point[2]
    second = int(np.flatnonzero(rays.point == point)[1])
    back = search_without(with_ray_error(scene, second, 0, 8.0), [second], [], []).fitting_again(RULE)
    assert np.flatnonzero(back.observations[0]).tolist() == [second]


@pytest.mark.parametrize("correlation_s", [10.0, 200.0])
def test_of_two_neighbours_of_a_strip_each_is_predicted_without_the_other(correlation_s: float) -> None:
    """What the first one had if it came back alone: its neighbours are those that are left."""
    scene = two_strips(noise_seed=8, gnss_correlation_s=correlation_s)
    alone = search_without(scene, [], [4], [])
    inside = float(snooping_statistics(alone.adjusted, RULE)[2][3])
    search = search_without(scene, [], [3, 4], [])
    for value, comes in ((0.999 * inside, False), (1.001 * inside, True)):
        found = search.fitting_again(replace(RULE, critical_value=value))
        assert bool(found.observations[2][3]) is comes


def test_rays_of_a_point_close_within_the_sigma0_that_the_residuals_say() -> None:
    """Where it is not trusted; all standard deviations are stated twice as large as they are."""
    scene = two_strips(noise_seed=8)
    observations = Observations(
        scene.observations.image_points.rescaled(np.array(2.0)),
        tuple(group.rescaled(np.array(2.0)) for group in scene.observations.others),
    )
    point = two_ray_point(scene)
    search = search_without(replace(scene, observations=observations), [], [], [point])
    adjusted, rays = search.adjusted, observations.image_points
    sigma0 = np.sqrt(adjusted.weighted_squares / adjusted.redundancy)
    assert sigma0 == pytest.approx(0.5, abs=0.05)
    state = in_place(adjusted, observations, search.given_up).state
    w = float(explanations(rays, state, np.array([point]), {})[point].component.max())
    for reference, factor in (("a_priori", 1.0), ("a_posteriori", sigma0)):
        for value, comes in ((0.999 * w / factor, 0), (1.001 * w / factor, 1)):
            rule = SnoopingRule(value, reference_variance=reference)  # type: ignore[arg-type]
            assert search.fitting_again(rule).count == comes


def test_taken_back_is_what_came_back_and_was_not_rejected_again() -> None:
    scene = two_strips(noise_seed=8)
    rays = scene.observations.image_points
    one, other = np.setdiff1d(
        np.flatnonzero(np.bincount(rays.point) == 5), scene.observations.others[0].point
    )[[0, -1]]
    search = search_without(scene, [], [], [])
    returned = tuple(mask.copy() for mask in search.returned)
    rejected, points, given_up = (
        tuple(mask.copy() for mask in search.rejected),
        search.returned_points.copy(),
        search.given_up.copy(),
    )
    returned[2][[3, 4]], rejected[2][4] = True, True
    # Of the five rays of a point that came back one is rejected; another point was given up again.
    points[[one, other]], given_up[other] = True, True
    rejected[0][np.flatnonzero(rays.point == one)[2]] = True
    found = replace(search, returned=returned, rejected=rejected, returned_points=points, given_up=given_up)
    assert found.taken_back == 1 + 4


@pytest.mark.parametrize("test", ["components", "observations"])
def test_with_errors_of_considered_parameters_the_statistic_is_the_same_inside_and_outside(test: Any) -> None:
    """Of a boresight known to 0.01° and a shift known to 0.1 m, which make residuals larger."""
    scene = two_strips(noise_seed=8)
    places = tuple(ParameterPlace(family, 0, k) for family in (BORESIGHT, GNSS_SHIFT) for k in range(3))
    covariance = np.diag([(0.01 * DEGREE) ** 2] * 3 + [0.1**2] * 3)
    known = ConsideredParameters(places, covariance)
    block = replace(scene.block, considered=known)
    adjuster = Adjuster(AdjustmentOptions())
    system = System.of(block, scene.observations)
    adjusted, rule = adjuster.adjust(system, block.approximate_state()), SnoopingRule(4.13, test)
    statistics = snooping_statistics(adjusted, rule)
    first, second = (ray + int(np.argmax(statistics[0][ray : ray + 5])) for ray in rays_of_many(scene))
    for group, row in ((0, first), (0, second), (2, 4), (2, 3), (3, 6)):
        inside = float(statistics[group][row])
        rejected = tuple(np.zeros(len(item.event), dtype=bool) for item in scene.observations.groups)
        rejected[group][row] = True
        search = replace(Search.start(scene.observations, adjusted), rejected=rejected)
        search = replace(search, adjusted=adjuster.again(adjusted, search.remaining()))
        for value, comes in ((0.999 * inside, 0), (1.001 * inside, 1)):
            found = search.fitting_again(replace(rule, critical_value=value))
            assert found.count == comes, (group, row)


@pytest.mark.parametrize("test", ["components", "observations"])
@pytest.mark.parametrize("reference", ["a_priori", "a_posteriori"])
@pytest.mark.parametrize("correlation_s", [None, 10.0, 200.0])
def test_a_lone_observation_has_the_same_statistic_inside_and_outside(
    correlation_s: float | None, reference: Any, test: Any
) -> None:
    """Deleting it multiplies v by 1/r and its cofactor likewise: w stays.

    With errors correlated over time outside is between its neighbours in the strip.
    """
    scene = two_strips(noise_seed=8, gnss_correlation_s=correlation_s, ins_correlation_s=correlation_s)
    observations = scene.observations
    adjuster = Adjuster(AdjustmentOptions())
    adjusted = adjuster.adjust(System.of(scene.block, observations), scene.block.approximate_state())
    rule = SnoopingRule(4.13, test, reference)
    statistics = snooping_statistics(adjusted, rule)
    # No other ray of their point is above the critical values below when they are back.
    first, second = (ray + int(np.argmax(statistics[0][ray : ray + 5])) for ray in rays_of_many(scene))
    # Whether other rays suffer is asked of σ0 alone, which at values this small is not the τ-test.
    of_rays = [(0, first), (0, second)] if reference == "a_priori" else []
    for group, row in (*of_rays, (2, 4), (2, 3), (3, 6)):
        inside = float(statistics[group][row])
        rejected = tuple(np.zeros(len(item.event), dtype=bool) for item in observations.groups)
        rejected[group][row] = True
        search = replace(Search.start(observations, adjusted), rejected=rejected)
        search = replace(search, adjusted=adjuster.again(adjusted, search.remaining()))
        for value, comes in ((0.999 * inside, 0), (1.001 * inside, 1)):
            found = search.fitting_again(replace(rule, critical_value=value))
            assert found.count == comes, (group, row)


@pytest.mark.parametrize("reference", ["a_priori", "a_posteriori"])
def test_a_partly_controlled_observation_has_the_same_statistic_inside_and_outside(reference: Any) -> None:
    """Control points of 12 mm: the rays control them in plan, not in height.

    With the height among its directions, one rejected at |w| = 4.2 came back with 3.9, to be rejected again.
    """
    scene = two_strips(noise_seed=8, control=("full",) * 5, sigma_control_m=0.012)
    observations, group = scene.observations, 1
    adjuster = Adjuster(AdjustmentOptions())
    adjusted = adjuster.adjust(System.of(scene.block, observations), scene.block.approximate_state())
    control = adjusted.residuals[group].control
    partly = np.flatnonzero((control[:, :2] > 0.15).all(axis=1) & (control[:, 2] < 0.07))
    assert len(partly) >= 4
    rule = SnoopingRule(4.13, "observations", reference)
    for row in partly:
        inside = float(snooping_statistics(adjusted, rule)[group][row])
        rejected = tuple(np.zeros(len(item.event), dtype=bool) for item in observations.groups)
        rejected[group][row] = True
        search = replace(Search.start(observations, adjusted), rejected=rejected)
        search = replace(search, adjusted=adjuster.again(adjusted, search.remaining()))
        assert search.fitting_again(replace(rule, critical_value=0.999 * inside)).count == 0
        # All directions together may be larger than those that are controlled.
        assert search.fitting_again(replace(rule, critical_value=1.001 * inside + 1.0)).count == 1


def test_an_error_in_a_direction_that_nothing_else_controls_keeps_an_observation_out() -> None:
    """A height 1 m off of a control point of 12 mm, which the rays check to a few centimetres only."""
    scene = two_strips(noise_seed=8, control=("full",) * 5, sigma_control_m=0.012)
    control = scene.observations.others[0]
    assert isinstance(control, ControlPoints)
    height = control.given_height.copy()
    height[1] += 1.0
    others = (replace(control, given_height=height), *scene.observations.others[1:])
    search = search_without(
        replace(scene, observations=replace(scene.observations, others=others)), [], [], []
    )
    rejected = tuple(mask.copy() for mask in search.rejected)
    rejected[1][1] = True
    search = replace(search, rejected=rejected)
    adjuster = Adjuster(AdjustmentOptions(critical_value=4.13))
    search = replace(search, adjusted=adjuster.again(search.adjusted, search.remaining()))
    for rule in (RULE, SnoopingRule(4.13, "observations")):
        assert search.fitting_again(rule).count == 0


def test_whole_observations_are_tested_along_what_is_controlled_and_along_everything() -> None:
    """Cofactors of predictions, and of what a weight makes of them inside: T² over them, from a tenth on."""
    weight, whitener = np.full(1, 1.4), np.eye(3)[None]

    def statistic(pull: list[float], outside: list[float]) -> float:
        cofactor = np.diag(outside)[None]
        rule = SnoopingRule(4.13, "observations")
        given = np.array([pull]), cofactor, np.zeros_like(cofactor), whitener, weight
        return float(_predicted(*given, rule, None)[0])

    def expected(squares: float, dimension: int) -> float:
        return float(normal_equivalent(np.array([squares]), np.array([dimension]))[0])

    # The third one is 1.4² / 50 inside: it counts only where all together say more.
    assert statistic([3.0, 4.0, 0.0], [2.0, 3.0, 50.0]) == pytest.approx(expected(9 / 2 + 16 / 3, 2))
    assert statistic([0.0, 0.0, 70.0], [2.0, 3.0, 50.0]) == pytest.approx(expected(70**2 / 50, 3))
    # A component that is not there is none of the directions.
    assert statistic([3.0, 0.0, 0.0], [2.0, 50.0, 0.0]) == pytest.approx(expected(9 / 2, 1))
