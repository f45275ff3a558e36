"""The iteration: fast where it may be, damped where it must be."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from adjust.adjustment import adjust_block, estimate_block
from adjust.errors import DivergenceError
from adjust.parameters import BORESIGHT
from adjust.quality.cofactor import cofactor
from adjust.solve.gauss_newton import Iteration, converge, iterate, single_step
from adjust.solve.normal_equations import reduced_normals, weighted_squares
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips


def system_of(scene: Scene) -> System:
    return System.of(scene.block, scene.observations)


def test_convergence_is_fast_from_the_start_values_of_a_flight() -> None:
    scene = two_strips(noise_seed=1, start_seed=2)
    steps = iterate(system_of(scene), scene.block.approximate_state(), 20).iterations
    moves = [step.largest_move for step in steps]
    assert len(steps) <= 5
    assert all(step.damping == 0.0 for step in steps)
    assert all(later < 0.05 * earlier for earlier, later in pairwise(moves))
    assert moves[-1] < 1e-3 < moves[-2]


def test_weighted_squares_of_the_last_step_are_a_minimum() -> None:
    scene = two_strips(noise_seed=1, start_seed=2, free={BORESIGHT: True})
    system = system_of(scene)
    solution = iterate(system, scene.block.approximate_state(), 20)
    least = solution.normals.weighted_squares
    generator = np.random.default_rng(5)
    layout = system.layout
    for _ in range(10):
        moved = layout.update(
            solution.state,
            generator.normal(0.0, 1e-4, (layout.events, 6)) * [1, 1, 1, 1e-3, 1e-3, 1e-3],
            generator.normal(0.0, 1e-6, layout.border),
            generator.normal(0.0, 1e-3, (layout.points, 3)),
        )
        assert reduced_normals(system, moved).weighted_squares > least


def test_the_end_does_not_depend_on_the_path_to_it() -> None:
    # Without control points: their heights carry the rounding of geocentric coordinates.
    scene = two_strips(noise_seed=1, start_seed=2, control=())
    system = system_of(scene)
    start = scene.block.approximate_state()
    moved = system.layout.update(
        start,
        np.full((system.layout.events, 6), 1e-4),
        np.full(system.layout.border, 1e-4),
        np.full((system.layout.points, 3), 0.5),
    )
    one, other, again = (
        iterate(system, state, 20) for state in (start, moved, iterate(system, moved, 20, near=True).state)
    )
    quality = cofactor(system, one)
    of_exposures = np.sqrt(np.diagonal(quality.reduced.of_exposures, axis1=1, axis2=2))
    of_points = np.sqrt(np.diagonal(quality.of_points, axis1=1, axis2=2))
    for found in (other, again):
        centres = found.state.projection_centre - one.state.projection_centre
        points = found.state.object_point - one.state.object_point
        rotations = found.state.local_from_camera - one.state.local_from_camera
        assert np.abs(centres / of_exposures[:, :3]).max() < 1e-9
        assert np.abs(rotations).max() < 1e-9 * of_exposures[:, 3:].min()
        assert np.nanmax(np.abs(points / of_points)) < 1e-9


def test_near_the_end_a_solution_counts_as_stalled_with_the_equations_of_its_last_step() -> None:
    scene = two_strips(noise_seed=1, start_seed=2)
    system = system_of(scene)
    found = iterate(system, scene.block.approximate_state(), 20, near=True)
    moves = [step.largest_move for step in found.iterations]
    assert 1e-3 < moves[-1] < 1.0 < min(moves[:-1])
    assert found.stalled
    assert found.linearized_at is not None
    left = reduced_normals(system, found.linearized_at).weighted_squares
    assert found.normals.weighted_squares == pytest.approx(left, rel=1e-12)
    end = iterate(system, found.state, 20)
    again = iterate(system, end.state, 20, near=True)
    assert (end.stalled, again.stalled) == (False, False)


def test_near_the_end_a_free_network_counts_as_stalled_likewise() -> None:
    scene = two_strips(noise_seed=1, start_seed=2, control=(), gnss=False, ins=False)
    system = System.of(scene.block, scene.observations, inner_constraints="object_points")
    end = iterate(system, scene.block.approximate_state(), 20)
    centre = end.state.projection_centre.copy()
    centre[2] += [1e-3, 0.0, 0.0]
    found = iterate(system, replace(end.state, projection_centre=centre), 20, near=True)
    assert 1e-3 < found.iterations[-1].largest_move < 1.0
    assert (found.stalled, end.stalled) == (True, False)
    assert (found.defect, end.defect) == (7, 7)
    assert end.linearization is end.state
    np.testing.assert_allclose(found.state.projection_centre, end.state.projection_centre, atol=1e-5)


def test_one_linear_step_promises_the_squares_that_are_left_without_a_few_observations() -> None:
    scene = two_strips(noise_seed=1, start_seed=2)
    system, rays = system_of(scene), scene.observations.image_points
    end = iterate(system, scene.block.approximate_state(), 20)
    gone = np.isin(np.arange(len(rays.image)), [40, 90])
    left = system.remaining(replace(system.observations, image_points=rays.without(gone)))
    solution, promised = single_step(system, end, left, end.linearization)
    assert solution.stalled
    assert solution.iterations[0].largest_move ** 2 == pytest.approx(
        solution.normals.weighted_squares - promised, rel=1e-6
    )
    at_end = weighted_squares(left, iterate(left, solution.state, 20).state)
    assert promised == pytest.approx(at_end, rel=1e-6)
    assert at_end < 0.999 * end.normals.weighted_squares


@pytest.mark.parametrize("ray", [40, 41, 42, 136])
def test_rounding_in_the_last_step_is_not_taken_for_divergence(ray: int) -> None:
    # Heights of control points carry the rounding of geocentric coordinates, 1e-9 m, and vPv with
    # them; 41 and 136 are cases where the last, tiny step made it rise by more than 1e-9.
    scene = two_strips(start_seed=9, free={BORESIGHT: True})
    rays = scene.observations.image_points
    xy = rays.xy.copy()
    xy[ray] += 12e-6
    observations = replace(scene.observations, image_points=replace(rays, xy=xy))
    result = adjust_block(scene.block, observations)
    assert len(result.iterations[-1]) <= 5


def test_damping_adds_to_the_diagonal_of_the_unreduced_normal_equations() -> None:
    scene = two_strips(noise_seed=1, start_seed=2, free={BORESIGHT: True})
    system, state = system_of(scene), scene.block.approximate_state()
    plain, damped = reduced_normals(system, state), reduced_normals(system, state, 1e-2)
    np.testing.assert_array_equal(damped.diagonal_exposure, plain.diagonal_exposure)
    np.testing.assert_array_equal(damped.diagonal_border, plain.diagonal_border)
    assert damped.weighted_squares == plain.weighted_squares
    larger = damped.corner - plain.corner
    np.testing.assert_allclose(np.diagonal(larger), 1e-2 * plain.diagonal_border, rtol=1e-9)


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_a_start_out_of_reach_of_plain_steps_is_reached_with_damping(seed: int) -> None:
    # A hundred metres and ten degrees off: a plain step leads behind the cameras or uphill.
    scene = two_strips(noise_seed=1)
    generator = np.random.default_rng(seed)
    state = scene.block.approximate_state()
    n, m = len(scene.block.images), len(scene.block.points)
    system = system_of(scene)
    far = system.layout.update(
        state,
        np.concatenate([generator.normal(0, 100.0, (n, 3)), generator.normal(0, 0.2, (n, 3))], axis=1),
        np.zeros(0),
        generator.normal(0.0, 200.0, (m, 3)),
    )
    near = iterate(system, state, 20)
    solution = iterate(system, far, 60)
    assert iterate(system, far, 60, near=True).iterations[-1].damping == 0.0
    assert any(step.damping > 0.0 for step in solution.iterations)
    assert solution.iterations[-1].damping == 0.0
    np.testing.assert_allclose(solution.state.projection_centre, near.state.projection_centre, atol=1e-6)


@pytest.mark.parametrize(("start_seed", "noise_seed"), [(3, 0), (4, 0), (7, 0), (10, 1), (21, 1)])
def test_a_strip_without_control_is_found_from_every_start(start_seed: int, noise_seed: int) -> None:
    # Held by four positions and distances alone; from most of these starts damped steps creep for ever.
    scene = two_strips(
        strips=1, images_per_strip=4, control=(), ins=False, distances=4, noise_seed=noise_seed,
        start_seed=start_seed,
    )  # fmt: skip
    estimate = estimate_block(scene.block, scene.observations)
    assert estimate.weighted_squares == pytest.approx({0: 57.54769, 1: 61.81874}[noise_seed], abs=1e-4)


def test_what_still_moves_most_is_named_with_its_size() -> None:
    """One image 5 m off, and the roll of the boresight 0.002 rad too large."""
    scene = two_strips(free={BORESIGHT: True})
    centre, boresight = scene.truth.projection_centre.copy(), scene.truth.system[BORESIGHT].copy()
    centre[4] += [3.0, 0.0, 4.0]
    boresight[0, 0] += 0.002
    start = replace(
        scene.truth, projection_centre=centre, system={**scene.truth.system, BORESIGHT: boresight}
    )
    with pytest.raises(DivergenceError) as caught:
        iterate(system_of(scene), start, 1)
    assert caught.value.largest == "image image_04 (5.01 m); system parameters by up to 0.002"
    of_rig = two_strips(heads=2)
    centre = of_rig.truth.projection_centre.copy()
    centre[6] += [3.0, 0.0, 4.0]
    with pytest.raises(DivergenceError) as caught:
        iterate(system_of(of_rig), replace(of_rig.truth, projection_centre=centre), 1)
    assert caught.value.largest.startswith(f"event {of_rig.block.events[6]} (5.0")


def with_gross_errors(count: int, size_m: float) -> System:
    """A block of which so many image points are off by gross errors of this σ."""
    scene = two_strips(noise_seed=1, start_seed=2, control=())
    rays, random = scene.observations.image_points, np.random.default_rng(1)
    xy = rays.xy.copy()
    wrong = random.choice(len(xy), count, replace=False)
    xy[wrong] += random.normal(0.0, size_m, (count, 2))
    return system_of(
        replace(scene, observations=replace(scene.observations, image_points=replace(rays, xy=xy)))
    )


@pytest.mark.parametrize(("count", "size_m", "creeps"), [(20, 5e-3, True), (40, 3e-2, False)])
def test_an_iteration_that_leads_nowhere_may_end_early(count: int, size_m: float, creeps: bool) -> None:
    """Where long steps lower vᵀPv by less than a thousandth, or after as many steps as are allowed."""
    system, seen = with_gross_errors(count, size_m), list[Iteration]()
    start = system.block.approximate_state()
    found = converge(system, start, 20, seen.append, may_stall=True)
    assert found.stalled
    assert found.iterations == tuple(seen)
    assert [step.number for step in seen] == list(range(1, len(seen) + 1))
    at_end = weighted_squares(system, found.state)
    assert found.weighted_squares == pytest.approx(at_end, rel=1e-9)
    squares = np.array([*(step.weighted_squares for step in seen), at_end])
    lowered, moves = 1.0 - squares[1:] / squares[:-1], [step.largest_move for step in seen]
    assert (len(seen) < 20) == creeps
    if creeps:
        assert lowered[-1] < 1e-3 < lowered[:-1].min()
        assert moves[-1] > 30.0
    # A step that leads uphill is made again with more damping, and damping is taken back after one downhill.
    for step, following, downhill in zip(seen, seen[1:], lowered[:-1] > 0.0, strict=False):
        less = 0.0 if step.damping <= 1e-4 else step.damping / 10.0
        expected = less if downhill else max(10.0 * step.damping, 1e-4)
        assert following.damping == pytest.approx(expected)
    assert creeps or max(step.damping for step in seen) > 0.05
    solution = iterate(system, start, 20, may_stall=True)
    assert solution.stalled
    assert solution.iterations == found.iterations
    assert solution.linearization is solution.state
    assert solution.normals.weighted_squares == pytest.approx(at_end, rel=1e-9)


def test_without_leave_to_end_early_it_goes_on() -> None:
    system = with_gross_errors(5, 5e-3)
    start = system.block.approximate_state()
    early, end = (converge(system, start, 25, may_stall=early) for early in (True, False))
    assert (early.stalled, end.stalled) == (True, False)
    assert len(end.iterations) > len(early.iterations)
    assert end.weighted_squares < early.weighted_squares
    assert end.weighted_squares == pytest.approx(weighted_squares(system, end.state))
    # Short steps that hardly lower vᵀPv are the end of any iteration.
    calm = system_of(two_strips(noise_seed=2, start_seed=7))
    assert not converge(calm, calm.block.approximate_state(), 20, may_stall=True).stalled
