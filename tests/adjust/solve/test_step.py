"""One step against dense algebra: how much lower it promises to lead, how far, and where to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.parameters import BORESIGHT, GNSS_SHIFT, InnerConstraints
from adjust.solve.design_matrix import design_matrix
from adjust.solve.gauss_newton import iterate
from adjust.solve.normal_equations import reduced_normals
from adjust.solve.right_hand_side import with_right_hand_sides
from adjust.solve.step import Step
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips

FREE = {"control": (), "ins": False, "gnss": False}


def system_of(scene: Scene, constrained: InnerConstraints | None = None) -> System:
    return System.of(scene.block, scene.observations, inner_constraints=constrained)


@pytest.mark.parametrize(
    ("switches", "constrained"),
    [
        ({"free": {BORESIGHT: True, GNSS_SHIFT: True}}, None),
        (FREE, "object_points"),
        (FREE, "both"),
        ({"control": (), "ins": False, "free": {GNSS_SHIFT: True}}, "projection_centres"),
    ],
    ids=str,
)
def test_the_squares_fall_by_the_decrement_if_equations_are_linear(
    switches: dict[str, object], constrained: InnerConstraints | None
) -> None:
    """And no unknown of a determined block moves by more σ than the bound says."""
    scene = two_strips(noise_seed=1, start_seed=2, **switches)
    system, state = system_of(scene, constrained), scene.block.approximate_state()
    step = Step.newton(system, state, reduced_normals(system, state))
    design = design_matrix(system, state)
    matrix = design.matrix.toarray()
    scale = 1.0 / np.linalg.norm(matrix, axis=0)
    least = np.linalg.lstsq(matrix * scale, design.misclosure, rcond=1e-9)[0]
    left = design.misclosure - matrix @ (scale * least)
    expected = float(design.misclosure @ design.misclosure - left @ left)
    assert step.decrement == pytest.approx(expected, rel=1e-9)
    assert step.largest_move == pytest.approx(np.sqrt(expected), rel=1e-9)
    assert step.normals.weighted_squares == pytest.approx(design.weighted_squares)
    # Rounding at the end of an iteration.
    below = replace(step, normals=replace(step.normals, eliminated=-2.0 * expected), movements=None)
    assert below.largest_move == 0.0
    if constrained is None:
        sigma = np.sqrt(np.diagonal(np.linalg.inv(matrix.T @ matrix)))[design.exposure_columns]
        assert np.abs(step.of_exposures / sigma).max() <= step.largest_move


def test_a_step_with_earlier_factors_is_that_of_their_matrix_and_its_own_right_hand_sides() -> None:
    scene = two_strips(noise_seed=1, start_seed=2, free={BORESIGHT: True})
    system, state = system_of(scene), scene.block.approximate_state()
    first = Step.newton(system, state, reduced_normals(system, state))
    normals = with_right_hand_sides(first.normals, system, first.moved)
    assert normals is not None
    step = first.then(first.moved, normals)
    assert (step.is_newton, first.is_newton, step.movements) == (False, True, None)
    solved = first.factorization.factor.solve(normals.rhs_exposure, normals.rhs_border)
    np.testing.assert_array_equal(step.of_exposures, solved[0])
    np.testing.assert_array_equal(step.of_border, solved[1])
    reduced = np.sum(normals.rhs_exposure * solved[0]) + normals.rhs_border @ solved[1]
    assert step.decrement == pytest.approx(normals.eliminated + reduced)
    # It leads nearly to where new normal equations lead.
    there = Step.newton(system, first.moved, reduced_normals(system, first.moved))
    difference = step.moved.object_point - there.moved.object_point
    assert np.abs(difference).max() < 0.05 * np.abs(there.increments[2]).max()


def test_a_step_that_is_repeated_is_the_one_that_was_made() -> None:
    """Also where its factors are those of an earlier state, as that of the last step here."""
    scene = two_strips(noise_seed=2, start_seed=7)
    system = system_of(scene)
    found = iterate(system, scene.block.approximate_state(), 20, near=True)
    assert found.factorization.normals is not found.normals
    step = Step.repeated(system, found.linearization, found.normals, found.factorization)
    np.testing.assert_array_equal(step.moved.object_point, found.state.object_point)
    assert step.largest_move == found.iterations[-1].largest_move
