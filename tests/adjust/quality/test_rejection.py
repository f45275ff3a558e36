"""Rejection of gross errors: what is found, what is spared, and what the last pass states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.errors import InconsistentBlockError
from adjust.least_squares import Adjuster
from adjust.observations.base import StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.distance import Distances
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from adjust.parameters import ADDITIONAL_PARAMETERS, BORESIGHT, INTERIOR_ORIENTATION
from adjust.quality.detectability import NON_CENTRALITY, UNCONTROLLED
from adjust.quality.rejection import SnoopingRule, contradicting_priors, snooping_statistics
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.solve.system import Observations, System
from tests.adjust.scenes import MICROMETRE, Scene, two_strips

CRITICAL = 4.13


def scene(**switches: Any) -> Scene:
    return two_strips(**{"noise_seed": 8, "start_seed": 9, "free": {BORESIGHT: True}, **switches})


def with_rays(given: Scene, rays: ImagePoints) -> Scene:
    return replace(given, observations=replace(given.observations, image_points=rays))


def with_ray_error(given: Scene, ray: int, error_m: tuple[float, float]) -> Scene:
    rays = given.observations.image_points
    xy = rays.xy.copy()
    xy[ray] += error_m
    return with_rays(given, replace(rays, xy=xy))


def adjusted(given: Scene, critical_value: float | None = CRITICAL) -> AdjustmentResult:
    return adjust_block(given.block, given.observations, AdjustmentOptions(critical_value=critical_value))


def first_ray(given: Scene, count: int) -> int:
    """The first ray of a point with ``count`` rays that no survey knows."""
    rays = given.observations.image_points
    surveyed = [group.point for group in given.observations.others if (group.point >= 0).any()]
    counts = np.bincount(rays.point)
    chosen = np.setdiff1d(np.flatnonzero(counts == count), np.concatenate(surveyed))
    return int(np.searchsorted(rays.point, chosen[0]))


def rejected_rays(result: AdjustmentResult) -> list[int]:
    return np.flatnonzero((result.groups[0].status == ObservationStatus.REJECTED).any(axis=1)).tolist()


def test_clean_observations_are_left_alone() -> None:
    result = adjusted(scene())
    assert result.rejected_per_pass == ()
    assert all(group.rejected == 0 for group in result.groups)
    assert len(result.iterations) == 2  # where the search begins, and the end


@pytest.mark.parametrize("error_um", [(40.0, 0.0), (0.0, -40.0), (30.0, 30.0), (2000.0, -500.0)])
def test_a_gross_error_in_a_point_of_many_rays_is_found_and_nothing_else(
    error_um: tuple[float, float],
) -> None:
    given = scene()
    ray = first_ray(given, 5)
    damaged = with_ray_error(given, ray, (error_um[0] * MICROMETRE, error_um[1] * MICROMETRE))
    result = adjusted(damaged)
    assert rejected_rays(result) == [ray]
    assert result.rejected_per_pass == (1,)
    assert all(group.rejected == 0 for group in result.groups[1:])
    residual = result.groups[0].residual[ray]
    # v = adjusted − observed of the rejected ray shows the error with the opposite sign.
    np.testing.assert_allclose(residual, -np.array(error_um) * MICROMETRE, atol=12 * MICROMETRE)


def test_without_a_critical_value_nothing_is_rejected() -> None:
    given = scene()
    damaged = with_ray_error(given, first_ray(given, 5), (40 * MICROMETRE, 0.0))
    result = adjusted(damaged, None)
    assert rejected_rays(result) == []
    assert result.test.sigma0 > result.test.upper


def test_after_rejection_everything_is_as_if_the_observation_had_never_been() -> None:
    given = scene()
    ray = first_ray(given, 5)
    found = adjusted(with_ray_error(given, ray, (60 * MICROMETRE, 20 * MICROMETRE)))
    rays = given.observations.image_points
    never = adjusted(with_rays(given, rays.without(np.arange(len(rays.image)) == ray)), None)
    assert found.test.redundancy == never.test.redundancy
    assert found.test.sigma0 == pytest.approx(never.test.sigma0, rel=1e-6)
    np.testing.assert_allclose(found.state.object_point, never.state.object_point, atol=1e-6)
    np.testing.assert_allclose(found.cofactor.of_points, never.cofactor.of_points, rtol=1e-6)
    np.testing.assert_allclose(found.groups[0].redundancy, never.groups[0].redundancy, atol=1e-6)
    assert np.isnan(found.groups[0].redundancy[ray]).all()
    total = sum(group.redundancy_sum for group in found.groups)
    assert total == pytest.approx(found.test.redundancy, abs=1e-6)
    squares = sum(group.weighted_squares for group in found.groups)
    assert squares == pytest.approx(found.test.weighted_squares)


def test_several_gross_errors_are_all_found() -> None:
    given = scene()
    rays = given.observations.image_points
    counts = np.bincount(rays.point)
    surveyed = given.observations.others[0].point
    points = np.setdiff1d(np.flatnonzero(counts >= 4), surveyed)[:4]
    damaged = given
    expected = np.searchsorted(rays.point, points).tolist()
    for k, ray in enumerate(expected):
        damaged = with_ray_error(damaged, ray, (50e-6 * (-1) ** k, 30e-6))
    assert rejected_rays(adjusted(damaged)) == expected


def test_a_control_point_one_metre_off_is_rejected_rather_than_its_rays() -> None:
    given = scene()
    control: Any = given.observations.others[0]
    given_position = control.given.copy()
    given_position[1, 0] += 1.0
    wrong = replace(control, given=given_position)
    others = (wrong, *given.observations.others[1:])
    result = adjusted(replace(given, observations=Observations(given.observations.image_points, others)))
    status = result.groups[1].status
    assert (status[1] == ObservationStatus.REJECTED).all()
    assert (np.delete(status, 1, axis=0) != ObservationStatus.REJECTED).all()
    assert rejected_rays(result) == []
    # The point itself stays, determined by its rays.
    assert result.active_point[control.point[1]]
    assert result.groups[1].residual[1, 0] == pytest.approx(-1.0, abs=0.2)


@pytest.mark.parametrize("test", ["components", "observations"])
@pytest.mark.parametrize("count", [2, 3])
def test_a_control_point_that_most_of_its_rays_contradict_is_rejected_in_their_place(
    test: Any, count: int
) -> None:
    """Hardly anything controls its height, and without them it would count as exact."""
    given = scene()
    rays, control = given.observations.image_points, cast(ControlPoints, given.observations.others[0])
    point = int(control.point[0])
    others = np.flatnonzero(rays.point == point)[:-count]
    rays = rays.only(np.setdiff1d(np.arange(len(rays.image)), others))
    position, height = control.given.copy(), control.given_height.copy()
    sigma = control.stochastic.sigma.copy()
    sigma[0] = 0.02
    position[0] += 2.0 * control.frame.local_from_enu(position[:1])[0, :, 2]
    height[0] += 2.0
    weights = StochasticModel.from_sigma(sigma)
    wrong = replace(control, given=position, given_height=height, stochastic=weights)
    observations = Observations(rays, (wrong, *given.observations.others[1:]))
    options = AdjustmentOptions(critical_value=CRITICAL, test=test)
    result = adjust_block(given.block, observations, options)
    assert (result.groups[1].status[0] == ObservationStatus.REJECTED).all()
    assert [group.rejected for group in result.groups] == [0, 1, 0, 0]
    error = result.state.object_point[point] - given.truth.object_point[point]
    assert (np.abs(error) < 4.0 * np.sqrt(np.diag(result.cofactor.of_points[point]))).all()


def test_a_wrong_antenna_position_is_rejected() -> None:
    given = scene()
    gnss: Any = given.observations.others[1]
    observed = gnss.observed.copy()
    observed[3] += [0.0, 1.0, 0.0]
    others = list(given.observations.others)
    others[1] = replace(gnss, observed=observed)
    result = adjusted(
        replace(given, observations=Observations(given.observations.image_points, tuple(others)))
    )
    assert (result.groups[2].status[3] == ObservationStatus.REJECTED).all()
    assert [group.rejected for group in result.groups] == [0, 0, 1, 0]


def test_both_rays_of_a_two_ray_point_go_because_the_wrong_one_cannot_be_told() -> None:
    given = scene()
    ray = first_ray(given, 2)
    result = adjusted(with_ray_error(given, ray, (60 * MICROMETRE, 60 * MICROMETRE)))
    status = result.groups[0].status[ray : ray + 2]
    assert sorted(status.max(axis=1).tolist()) == [ObservationStatus.REJECTED, ObservationStatus.NOT_USED]
    assert not result.active_point[given.observations.image_points.point[ray]]
    clean = adjusted(given)
    # Four coordinates less three of the point.
    assert result.test.redundancy == clean.test.redundancy - 1
    total = sum(group.redundancy_sum for group in result.groups)
    assert total == pytest.approx(result.test.redundancy, abs=1e-6)


def test_an_error_nobody_controls_is_marked_and_never_tested() -> None:
    # Two rays of one strip: x is along the base, where any error only moves the point up or down.
    given = two_strips(
        cameras=1,
        strips=1,
        images_per_strip=3,
        control=(),
        noise_seed=8,
        points_across=5,
        headings_deg=(90.0,),
    )
    result = adjusted(given)
    group = result.groups[0]
    uncontrolled = group.status == ObservationStatus.UNCONTROLLED
    assert uncontrolled.any()
    assert (group.redundancy[uncontrolled] < UNCONTROLLED).all()
    assert (group.redundancy[group.status == ObservationStatus.USED] >= UNCONTROLLED).all()
    ray = int(np.flatnonzero(uncontrolled[:, 0] & ~uncontrolled[:, 1])[0])
    damaged = with_ray_error(given, ray, (40 * MICROMETRE, 0.0))
    after = adjusted(damaged)
    assert (after.groups[0].status[ray, 0]) == ObservationStatus.UNCONTROLLED


def test_a_bias_of_the_detectable_size_gives_the_non_centrality_of_the_test() -> None:
    given = scene(noise_seed=None)
    clean = adjusted(given, None)
    rays = np.flatnonzero((clean.groups[0].redundancy > 0.3).all(axis=1))[::17]
    for ray in rays:
        bias = float(clean.groups[0].detectable[ray, 0])
        biased = adjusted(with_ray_error(given, int(ray), (bias, 0.0)), None)
        assert abs(biased.groups[0].standardized[ray, 0]) == pytest.approx(NON_CENTRALITY, rel=1e-3)


def test_correlated_components_are_tested_with_their_own_non_centrality() -> None:
    given = scene(noise_seed=None)
    control: Any = given.observations.others[0]
    row = given.plan.control.index("covariance")
    clean = adjusted(given, None).groups[1]
    # Up to the redundancies, the detectable bias of correlated components is not σ δ0/√r.
    uncorrelated = control.stochastic.sigma[row] * NON_CENTRALITY / np.sqrt(clean.redundancy[row])
    assert np.abs(clean.detectable[row] / uncorrelated - 1.0).max() > 0.05
    for component in range(3):
        position, height = control.given.copy(), control.given_height.copy()
        bias = clean.detectable[row, component]
        axes = control.frame.local_from_enu(control.given[[row]])[0]
        position[row] += bias * axes[:, component]
        if component == 2:
            height[row] += bias
        others = (replace(control, given=position, given_height=height), *given.observations.others[1:])
        biased = adjusted(
            replace(given, observations=Observations(given.observations.image_points, others)), None
        )
        assert abs(biased.groups[1].standardized[row, component]) == pytest.approx(NON_CENTRALITY, rel=2e-3)


def test_a_critical_value_far_too_small_is_refused_instead_of_eating_the_block() -> None:
    given = scene()
    options = AdjustmentOptions(critical_value=0.5, most_passes=3)
    with pytest.raises(
        InconsistentBlockError, match=r"above 0\.5\. σ0 of what is left: image points [01]\.\d\d"
    ):
        adjust_block(given.block, given.observations, options)


@pytest.mark.parametrize("test", ["components", "observations"])
def test_a_prior_that_contradicts_hides_no_gross_error_for_good(test: Any) -> None:
    """It cannot be rejected, so a limit of seven tenths of its value would stay."""
    given = scene(
        free={BORESIGHT: True, INTERIOR_ORIENTATION: True}, priors={INTERIOR_ORIENTATION: 10 * MICROMETRE}
    )
    *others, prior = given.observations.others
    assert isinstance(prior, DirectObservations)
    wrong = replace(prior, given=prior.given + np.array([0.0, 150 * MICROMETRE, 0.0]))
    given = replace(given, observations=replace(given.observations, others=(*others, wrong)))
    ray = first_ray(given, 5)
    damaged = with_ray_error(given, ray, (20 * MICROMETRE, 0.0))
    options = AdjustmentOptions(critical_value=CRITICAL, test=test)
    result = adjust_block(damaged.block, damaged.observations, options)
    largest = np.nanmax(np.abs(result.groups[-1].standardized))
    assert 10.0 < largest < CRITICAL / 0.2
    assert rejected_rays(result) == [ray]


@pytest.mark.parametrize("test", ["components", "observations"])
@pytest.mark.parametrize("robust", [None, "huber"])
def test_smaller_errors_are_found_behind_a_prior_that_contradicts(test: Any, robust: Any) -> None:
    """A fifth of its 38 σ for rays, and seven tenths for positions, would hide them; the prior stays."""
    given = scene(
        free={BORESIGHT: True, INTERIOR_ORIENTATION: True}, priors={INTERIOR_ORIENTATION: 10 * MICROMETRE}
    )
    *others, prior = given.observations.others
    assert isinstance(prior, DirectObservations)
    gnss: Any = others[1]
    observed = gnss.observed.copy()
    observed[6, 0] += 0.6
    others[1] = replace(gnss, observed=observed)
    wrong = replace(prior, given=prior.given + np.array([0.0, 420 * MICROMETRE, 0.0]))
    given = replace(given, observations=replace(given.observations, others=(*others, wrong)))
    ray = first_ray(given, 5)
    damaged = with_ray_error(given, ray, (15 * MICROMETRE, 0.0))
    result = adjust_block(
        damaged.block,
        damaged.observations,
        AdjustmentOptions(critical_value=CRITICAL, test=test, robust=robust),
    )
    assert np.nanmax(np.abs(result.groups[-1].standardized)) > 35.0
    assert result.groups[-1].rejected == 0
    assert rejected_rays(result) == [ray]
    (positions,) = np.nonzero((result.groups[2].status == ObservationStatus.REJECTED).any(axis=1))
    assert positions.tolist() == [6]
    # A robust estimate gives way to the prior, and what it takes away wrongly comes back.
    assert robust is not None or result.taken_back == 0


def test_a_prior_of_many_parameters_that_fits_is_not_suspicious() -> None:
    """Its T has as many degrees of freedom; as that of fewer it would look large and shield others."""
    given = scene(additional=True, free={ADDITIONAL_PARAMETERS: True})
    family = next(item.family for item in given.block.system if item.family.name == ADDITIONAL_PARAMETERS)
    true = given.truth.system[ADDITIONAL_PARAMETERS]
    assert true.shape[1] > 3
    sigma = np.full(true.shape, 10.0)
    off = true + 1.5 * sigma * np.where(np.arange(true.shape[1]) % 2, 1.0, -1.0)
    prior = DirectObservations(family, np.arange(len(true)), off, StochasticModel.from_sigma(sigma))
    observations = replace(given.observations, others=(*given.observations.others, prior))
    adjusted = Adjuster(AdjustmentOptions()).adjust(
        System.of(given.block, observations), given.block.approximate_state()
    )
    statistics = snooping_statistics(adjusted, SnoopingRule(CRITICAL, "observations"))
    largest = np.nanmax(np.abs(adjusted.residuals[-1].standardized))
    assert largest < 2.0
    np.testing.assert_allclose(statistics[-1].max(), largest, rtol=1e-12)


def test_whether_a_prior_contradicts_is_judged_with_the_variance_that_the_rule_trusts() -> None:
    given = scene(
        free={BORESIGHT: True, INTERIOR_ORIENTATION: True}, priors={INTERIOR_ORIENTATION: 10 * MICROMETRE}
    )
    half = np.array(0.5)
    observations = Observations(
        given.observations.image_points.rescaled(half),
        tuple(group.rescaled(half) for group in given.observations.others),
    )
    adjusted = Adjuster(AdjustmentOptions()).adjust(
        System.of(given.block, observations), given.block.approximate_state()
    )
    critical = 0.8 * float(np.abs(adjusted.residuals[-1].standardized).max())
    trusted, unknown = (
        contradicting_priors(adjusted, SnoopingRule(critical, reference_variance=variance))
        for variance in ("a_priori", "a_posteriori")
    )
    assert trusted[-1].any()
    assert not any(mask.any() for mask in (*trusted[:-1], *unknown))


def test_with_an_unknown_variance_components_have_the_statistic_of_pope() -> None:
    """τ = w/σ̂0, and τ √((f − 1)/(f − τ²)) has the t-distribution of f − 1 degrees of freedom."""
    given = scene()
    adjusted = Adjuster(AdjustmentOptions()).adjust(
        System.of(given.block, given.observations), given.block.approximate_state()
    )
    rule = SnoopingRule(CRITICAL, reference_variance="a_posteriori")
    freedom = adjusted.redundancy
    positions = adjusted.residuals[2]
    assert (positions.control > UNCONTROLLED).all()
    largest = np.abs(positions.standardized).max(axis=1)
    tau = largest / np.sqrt(adjusted.weighted_squares / freedom)
    tail = stats.t.sf(tau * np.sqrt((freedom - 1.0) / (freedom - tau**2)), freedom - 1)
    np.testing.assert_allclose(snooping_statistics(adjusted, rule)[2], stats.norm.isf(tail), rtol=1e-9)


@pytest.mark.parametrize("turned", [False, True])
def test_a_distance_decides_about_neither_of_its_points(turned: bool) -> None:
    """Which end comes first is of no importance, and the residual is that of the stated points."""
    given = scene(distances=8, control=("full",) * 4)
    *others, distances = given.observations.others
    assert isinstance(distances, Distances)
    ray = first_ray(given, 2)
    rays = given.observations.image_points
    ends = [int(rays.point[ray]), int(rays.point[first_ray(given, 5)])]
    assert not np.isin(ends, [distances.point, distances.other_point]).any()
    first, second = np.array(ends[::-1] if turned else ends)
    true = np.linalg.norm(given.truth.object_point[first] - given.truth.object_point[second])
    more = Distances(
        np.append(distances.point, first),
        np.append(distances.other_point, second),
        np.append(distances.given, true),
        StochasticModel.from_sigma(np.full((9, 1), 0.01)),
    )
    given = replace(given, observations=replace(given.observations, others=(*others, more)))
    result = adjusted(with_ray_error(given, ray, (0.0, 300 * MICROMETRE)))
    assert result.given_up.tolist() == [ends[0]]
    between = result.state.object_point[first] - result.state.object_point[second]
    of_distance = result.groups[-1]
    assert of_distance.status[-1] == ObservationStatus.NOT_USED
    np.testing.assert_allclose(of_distance.residual[-1], np.linalg.norm(between) - true, atol=1e-9)
