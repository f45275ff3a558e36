"""Which ray of a point is wrong: told where geometry tells it, admitted where it does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.options import AdjustmentOptions
from adjust.parameters import OBJECT_POINT
from adjust.quality.detectability import UNCONTROLLED
from adjust.quality.locatability import Explanations, explanations
from adjust.quality.snooping_statistic import normal_equivalent
from adjust.result import AdjustmentResult, ObservationStatus
from tests.adjust.scenes import MICROMETRE, Scene, two_strips


def one_strip() -> Scene:
    """A single strip: all rays of a point lie in one plane with the base."""
    return two_strips(strips=1, images_per_strip=6, noise_seed=8, headings_deg=(90.0,), tilt_deg=0.3)


def damaged(scene: Scene, ray: int, error_um: tuple[float, float]) -> Scene:
    rays = scene.observations.image_points
    xy = rays.xy.copy()
    xy[ray] += np.array(error_um) * MICROMETRE
    return replace(scene, observations=replace(scene.observations, image_points=replace(rays, xy=xy)))


def middle_ray(scene: Scene, count: int) -> int:
    """The middle ray of an unsurveyed point with ``count`` rays."""
    rays = scene.observations.image_points
    chosen = np.setdiff1d(
        np.flatnonzero(np.bincount(rays.point) == count), scene.observations.others[0].point
    )
    return int(np.searchsorted(rays.point, chosen[len(chosen) // 2])) + count // 2


def snooped(scene: Scene, **options: Any) -> AdjustmentResult:
    return adjust_block(scene.block, scene.observations, AdjustmentOptions(critical_value=4.13, **options))


def test_across_the_base_the_wrong_ray_of_three_is_told() -> None:
    scene = one_strip()
    ray = middle_ray(scene, 3)
    result = snooped(damaged(scene, ray, (0.0, 60.0)))
    status = result.groups[0].status
    assert np.flatnonzero((status == ObservationStatus.REJECTED).any(axis=1)).tolist() == [ray]
    assert len(result.given_up) == 0


def test_along_the_base_it_cannot_be_told_and_the_point_is_given_up() -> None:
    scene = one_strip()
    ray = middle_ray(scene, 3)
    point = int(scene.observations.image_points.point[ray])
    result = snooped(damaged(scene, ray, (90.0, 0.0)))
    assert result.given_up.tolist() == [point]
    assert not result.active_point[point]
    of_point = scene.observations.image_points.point == point
    status = result.groups[0].status[of_point].max(axis=1)
    assert sorted(status.tolist()) == [
        ObservationStatus.REJECTED,
        ObservationStatus.NOT_USED,
        ObservationStatus.NOT_USED,
    ]


def test_a_survey_tells_what_rays_alone_cannot() -> None:
    scene = one_strip()
    control: Any = scene.observations.others[0]
    rays = scene.observations.image_points
    row = next(
        k
        for k, kind in enumerate(scene.plan.control)
        if kind == "full" and np.sum(rays.point == control.point[k]) >= 3
    )
    ray = int(np.searchsorted(rays.point, control.point[row])) + 1
    result = snooped(damaged(scene, ray, (120.0, 0.0)))
    assert result.active_point[control.point[row]]
    assert (result.groups[0].status[ray] == ObservationStatus.REJECTED).all()


def test_two_rays_explain_a_misfit_equally_well() -> None:
    scene = two_strips(noise_seed=8)
    rays = scene.observations.image_points
    ray = middle_ray(scene, 2)
    given = damaged(scene, ray, (40.0, 40.0))
    point = rays.point[ray]
    found = explanations(given.observations.image_points, scene.truth, np.array([point]), {})[int(point)]
    assert found.statistic[0] == pytest.approx(found.statistic[1], rel=1e-6)
    assert found.statistic[0] > 10.0
    assert not found.is_located


def test_every_ray_explains_what_the_matrices_of_its_point_say() -> None:
    """T_j over the directions of R_jj that are controlled, and the largest controlled |w|; of all points."""
    scene = two_strips(noise_seed=8)
    rays, state = scene.observations.image_points, scene.truth
    surveyed = {int(point): np.diag([400.0, 100.0, 900.0]) for point in scene.observations.others[0].point}
    # Heights of half a metre, which hardly control two rays along the base.
    of_two_rays = np.flatnonzero(np.bincount(rays.point) == 2)
    surveyed |= {int(point): np.diag([0.0, 0.0, 4.0]) for point in of_two_rays[::2]}
    found = explanations(rays, state, np.unique(rays.point), surveyed)
    equations = rays.linearize(state)
    of_point = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
    uncontrolled = 0
    for point, item in found.items():
        own = np.flatnonzero(rays.point == point)
        assert item.ray.tolist() == own.tolist()
        weight = 1.0 / rays.sigma[own].ravel()
        matrix = weight[:, None] * of_point[own].reshape(-1, 3)
        normal = matrix.T @ matrix + surveyed.get(point, np.zeros((3, 3)))
        remainder = np.eye(len(matrix)) - matrix @ np.linalg.solve(normal, matrix.T)
        misfit = remainder @ (weight * equations.misclosure[own].ravel())
        for k in range(len(own)):
            rows = slice(2 * k, 2 * k + 2)
            values, vectors = np.linalg.eigh(remainder[rows, rows])
            kept = values >= UNCONTROLLED
            statistic = np.sum((vectors.T @ misfit[rows])[kept] ** 2 / values[kept])
            assert item.statistic[k] == pytest.approx(statistic, rel=1e-6, abs=1e-9)
            expected = normal_equivalent(np.array([statistic]), np.array([kept.sum()]))[0]
            assert item.equivalent[k] == pytest.approx(expected, rel=1e-6, abs=1e-6)
            control = np.diagonal(remainder)[rows]
            told = control >= UNCONTROLLED
            w = np.abs(misfit[rows])[told] / np.sqrt(control[told])
            assert item.component[k] == pytest.approx(w.max(initial=0.0), rel=1e-6, abs=1e-9)
            uncontrolled += np.count_nonzero(~told)
    assert len(found) > 40
    assert uncontrolled > 10


def test_the_likeliest_rays_are_those_that_explain_most_of_both_coordinates() -> None:
    rays, statistic, component = np.arange(3) + 7, np.array([40.0, 50.0, 30.0]), np.array([5.0, 5.5, 5.4])
    found = Explanations(rays, statistic, np.sqrt(statistic), component)
    assert found.likeliest(2).tolist() == [8, 7]


def test_a_single_explanation_locates_nothing() -> None:
    assert not Explanations(np.array([4]), np.array([50.0]), np.array([7.0]), np.array([7.0])).is_located


@pytest.mark.parametrize(("likelier", "located"), [(19.0, False), (21.0, True)])
def test_a_ray_is_located_that_is_twenty_times_as_likely_to_be_wrong_as_any_other(
    likelier: float, located: bool
) -> None:
    statistic = 30.0 + np.array([0.0, 2.0 * np.log(likelier), -3.0])
    found = Explanations(np.arange(3), statistic, np.sqrt(statistic), np.sqrt(statistic))
    assert found.is_located is located
