"""Effects of undetected errors in the block against adjustments with these errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats, Ints
from adjust.observations.base import ObservationGroup
from adjust.observations.control_point import ControlPoints
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.options import AdjustmentOptions
from adjust.parameters import INTERIOR_ORIENTATION, OBJECT_POINT, State
from adjust.result import ObservationStatus
from adjust.solve.system import Observations
from adjust.trust_map.accuracy import joint_solution, new_rays
from adjust.trust_map.block_errors import block_errors
from adjust.trust_map.cells import sight_of
from tests.adjust.scenes import two_strips
from tests.adjust.trust_map.grids import cells_over


def with_error(group: ObservationGroup, error: Floats) -> ObservationGroup:
    """The group with errors (n, 3) added along the axes of its components."""
    if isinstance(group, GnssPositions):
        added = np.einsum("nij,nj->ni", group.local_from_enu, error)
        return replace(group, observed=group.observed + added)
    assert isinstance(group, ControlPoints)
    level = error * np.array([1.0, 1.0, 0.0])
    added = np.einsum("nij,nj->ni", group.frame.local_from_enu(group.given), level)
    return replace(group, given=group.given + added, given_height=group.given_height + error[:, 2])


def point_of(rays: ImagePoints, measured: State, used: State, place: Floats, image: Ints) -> Floats:
    """A point (3,) from image points exact in one state, intersected with the orientations of another."""
    none = np.zeros(len(image), dtype=np.int64)
    exact = new_rays(rays, replace(measured, object_point=place[None]), image, none, 1.0)
    found = place
    for _ in range(3):
        state = replace(used, object_point=found[None])
        equations = exact.linearize(state)
        jacobian = next(t.jacobian for t in equations.terms if t.block == OBJECT_POINT).reshape(-1, 3)
        found = found + np.linalg.lstsq(jacobian, equations.misclosure.ravel())[0]
    return found


@pytest.mark.parametrize("correlated", [None, 30.0])
def test_the_largest_effect_is_that_of_an_adjustment_with_the_smallest_error_that_is_found(
    correlated: float | None,
) -> None:
    scene = two_strips(
        free={INTERIOR_ORIENTATION: [[True, False, False]]},
        control=("full", "full", "full"),
        ins=False,
        gnss_correlation_s=correlated,
    )
    result = adjust_block(scene.block, scene.observations)
    cells = cells_over(scene.truth.object_point, 5, 5)
    sight = sight_of(scene.block, result.state, cells)
    solution = joint_solution(scene.block, result, sight, AdjustmentOptions())
    chosen = np.flatnonzero(sight.rays >= 3)[::3]
    found = block_errors(solution, result, cells, sight, chosen)

    expected = np.zeros_like(found)
    for number, (group, tested) in enumerate(zip(scene.observations.others, result.groups[1:], strict=True)):
        for i, component in np.argwhere(tested.status == ObservationStatus.USED):
            error = np.zeros(group.stochastic.sigma.shape)
            error[i, component] = tested.detectable[i, component]
            wrong = list(scene.observations.others)
            wrong[number] = with_error(group, error)
            observations = Observations(scene.observations.image_points, tuple(wrong))
            state = estimate_block(scene.block, observations).state
            rays = scene.observations.image_points
            for k, cell in enumerate(chosen):
                place, image = cells.x_in_local[cell], sight.image[sight.start[cell] : sight.start[cell + 1]]
                effect = point_of(rays, result.state, state, place, image) - place
                expected[k] = np.maximum(expected[k], np.abs(effect))
    np.testing.assert_allclose(found, expected, rtol=0.02, atol=2e-5)
    assert len(chosen) >= 3
    assert found.min() > 0.0
