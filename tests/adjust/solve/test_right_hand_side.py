"""Right-hand sides without their matrix: those of the whole normal equations at the same state."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from adjust.parameters import State
from adjust.solve.gauss_newton import iterate
from adjust.solve.normal_equations import reduced_normals
from adjust.solve.right_hand_side import with_right_hand_sides
from adjust.solve.step import Step
from adjust.solve.system import System
from tests.adjust.scenes import two_strips, variants

VARIANTS = variants()


def moved(system: System, state: State) -> State:
    layout, generator = system.layout, np.random.default_rng(4)
    return layout.update(
        state,
        generator.normal(0.0, 1e-2, (layout.events, 6)) * [1, 1, 1, 1e-3, 1e-3, 1e-3],
        generator.normal(0.0, 1e-8, layout.border),
        generator.normal(0.0, 1e-2, (layout.points, 3)),
    )


@pytest.mark.parametrize("name", list(VARIANTS))
def test_they_are_those_of_the_normal_equations_there(name: str) -> None:
    system = System.of(VARIANTS[name].block, VARIANTS[name].observations)
    start = VARIANTS[name].block.approximate_state()
    there = moved(system, start)
    old, expected = reduced_normals(system, start), reduced_normals(system, there)
    found = with_right_hand_sides(old, system, there)
    assert found is not None
    assert found.blocks is old.blocks
    assert found.corner is old.corner
    assert found.weighted_squares == pytest.approx(expected.weighted_squares, rel=1e-12)
    assert found.eliminated == pytest.approx(expected.eliminated, rel=1e-9)
    # |s_i| ≤ √N_ii |l| by Cauchy–Schwarz.
    for right, wanted, diagonal in (
        (found.rhs_exposure, expected.rhs_exposure, expected.diagonal_exposure),
        (found.rhs_border, expected.rhs_border, expected.diagonal_border),
    ):
        scale = np.sqrt(diagonal * expected.weighted_squares)
        assert np.all(np.abs(right - wanted) <= 1e-9 * scale)
    active = system.active_point
    np.testing.assert_allclose(found.point_factor[active], expected.point_factor[active], rtol=1e-9)
    np.testing.assert_allclose(found.point_rhs[active], expected.point_rhs[active], rtol=1e-9, atol=1e-6)


def test_a_point_behind_a_camera_is_told() -> None:
    scene = two_strips()
    system, state = System.of(scene.block, scene.observations), scene.block.approximate_state()
    above = replace(state, object_point=2.0 * state.projection_centre[0] - state.object_point)
    assert with_right_hand_sides(reduced_normals(system, state), system, above) is None


def test_steps_with_factors_of_the_start_end_where_new_ones_do() -> None:
    scene = two_strips(noise_seed=1, start_seed=2, control=())
    system, state = System.of(scene.block, scene.observations), scene.block.approximate_state()
    steps = [Step.newton(system, state, reduced_normals(system, state))]
    for _ in range(12):
        normals = with_right_hand_sides(steps[-1].normals, system, steps[-1].moved)
        assert normals is not None
        steps.append(steps[-1].then(steps[-1].moved, normals))
    assert not any(step.is_newton for step in steps[1:])
    assert all(later.largest_move < 0.2 * earlier.largest_move for earlier, later in pairwise(steps[:5]))
    end = iterate(system, state, 20).state
    np.testing.assert_allclose(steps[-1].moved.projection_centre, end.projection_centre, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(steps[-1].moved.object_point, end.object_point, rtol=0.0, atol=1e-8)
