from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.adjustment import adjust_block
from adjust.arrays import Bools, Floats
from adjust.block import Block
from adjust.observations.direct import DirectObservations
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM
from adjust.result import AdjustmentResult
from adjust.selection.linear_estimate import LinearEstimate
from adjust.selection.parameter_normals import normals_at, normals_of_result
from adjust.solve.system import Observations, System
from tests.adjust.calibration.designs import Design, random_design
from tests.adjust.scenes import Scene, two_strips


def assert_agrees(estimate: LinearEstimate, design: Design, tolerance: float = 1e-9) -> None:
    """The same values, cofactors, Ω and f as the ordinary adjustment, in units of each σ."""
    change, cofactor, squares, redundancy = design.solved(estimate.free)
    sigma = np.sqrt(np.diagonal(cofactor))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    assert np.abs((estimate.change - change) / scale).max() < tolerance * (1.0 + np.abs(change / scale).max())
    assert np.abs((estimate.cofactor - cofactor) / np.outer(scale, scale)).max() < tolerance
    assert estimate.weighted_squares == pytest.approx(squares, rel=tolerance)
    assert estimate.redundancy == redundancy


def test_one_parameter_observed_twice_by_hand() -> None:
    # l = 1 and 3 of one parameter: a = 2, q = 1/2, Ω = 2, f = 1; held at zero Ω = 10, f = 2.
    none = np.array([np.nan])
    design = Design(np.ones((2, 1)), np.zeros((2, 0)), np.array([1.0, 3.0]), none, np.zeros(1))
    estimate = LinearEstimate.of(design.normals)
    assert estimate.change[0] == pytest.approx(2.0)
    assert estimate.cofactor[0, 0] == pytest.approx(0.5)
    assert (estimate.weighted_squares, estimate.redundancy) == (pytest.approx(2.0), 1)
    assert replace(estimate, redundancy=0).sigma0 == 1.0
    held = estimate.without(0)
    assert (held.weighted_squares, held.redundancy) == (pytest.approx(10.0), 2)
    assert held.change[0] == held.cofactor[0, 0] == 0.0


def test_a_pseudo_observation_goes_with_its_parameter_by_hand() -> None:
    # The same with a = 0.5 ± 1 as pseudo-observation: a = 4.5/3 = 1.5, Ω = 0.25 + 2.25 + 1 = 3.5, f = 2. Held
    # at zero the two observations are left: Ω = 10, f = 2, not 3.
    design = Design(np.ones((2, 1)), np.zeros((2, 0)), np.array([1.0, 3.0]), np.ones(1), np.array([0.5]))
    estimate = LinearEstimate.of(design.normals)
    assert estimate.change[0] == pytest.approx(1.5)
    assert (estimate.weighted_squares, estimate.redundancy) == (pytest.approx(3.5), 2)
    held = estimate.without(0)
    assert (held.weighted_squares, held.redundancy) == (pytest.approx(10.0), 2)


@given(st.integers(0, 10_000), st.permutations(range(8)), st.booleans())
def test_dropping_parameters_in_any_order_is_the_adjustment_without_them(
    seed: int, order: list[int], priors: bool
) -> None:
    design = random_design(seed, priors=priors)
    estimate = LinearEstimate.of(design.normals)
    assert estimate.free.all()
    assert_agrees(estimate, design)
    for d in order:
        estimate = estimate.without(d)
        assert_agrees(estimate, design)


@given(st.integers(0, 10_000), st.permutations(range(8)))
def test_what_was_dropped_comes_back_as_it_was(seed: int, order: list[int]) -> None:
    design = random_design(seed)
    estimate = LinearEstimate.of(design.normals)
    for d in order[:5]:
        estimate = estimate.without(d)
    for d in order[2:5]:
        estimate = estimate.with_free(d)
        assert_agrees(estimate, design)


def test_of_two_parameters_with_the_same_effect_only_the_first_asked_for_is_taken_in() -> None:
    design = random_design(3, priors=False)
    matrix = design.of_parameters.copy()
    matrix[:, 5] = 2.0 * matrix[:, 2] + 3.0 * design.of_others[:, 0]
    design = replace(design, of_parameters=matrix)
    for later, left in ((5, 5), (2, 2)):
        last = np.arange(8) == later
        estimate = LinearEstimate.of(design.normals, last)
        assert np.flatnonzero(~estimate.free).tolist() == [left]
        assert_agrees(estimate, design)
        with pytest.raises(ValueError, match=f"p{left} is not determined"):
            estimate.with_free(left)


def test_a_parameter_that_nothing_observes_stays_out() -> None:
    design = random_design(4, priors=False)
    matrix = design.of_parameters.copy()
    matrix[:, 1] = 0.0
    estimate = LinearEstimate.of(replace(design, of_parameters=matrix).normals)
    assert np.flatnonzero(~estimate.free).tolist() == [1]


def test_dropping_or_taking_twice_is_refused() -> None:
    estimate = LinearEstimate.of(random_design(5).normals)
    with pytest.raises(ValueError, match="already free"):
        estimate.with_free(0)
    with pytest.raises(ValueError, match="already held"):
        estimate.without(0).without(0)


# On blocks: against adjustments with the parameters held. All σ are a thousandth of the usual ones and the
# given values lie some σ beside the estimates, so that only the update is compared, not how curved the
# model is.

FREE = {INTERIOR_ORIENTATION: True, BORESIGHT: True, LEVER_ARM: True}
PRIORS = {INTERIOR_ORIENTATION: 2e-8, LEVER_ARM: 3e-4}


def block_with_given_values_nearby() -> Scene:
    scene = two_strips(
        free=FREE,
        priors=PRIORS,
        noise_seed=5,
        sigma_image_m=2e-9,
        sigma_gnss_m=5e-5,
        sigma_control_m=3e-5,
        sigma_ins_rad=1e-7,
    )
    result = adjust_block(scene.block, scene.observations)
    sigma = np.sqrt(np.diagonal(result.cofactor.reduced.corner))
    beside = result.layout.update(
        result.state,
        np.zeros((result.layout.events, 6)),
        sigma * np.random.default_rng(6).normal(0.0, 3.0, len(sigma)),
        np.zeros((result.layout.points, 3)),
    )
    system = tuple(
        replace(parameters, values=beside.system[parameters.family.name]) for parameters in scene.block.system
    )
    return replace(scene, block=replace(scene.block, system=system))


def adjusted(scene: Scene, held: Bools) -> AdjustmentResult:
    """Converged with the border columns (g,) held and without their pseudo-observations."""
    layout = scene.block.layout
    system, others = [], []
    for parameters in scene.block.system:
        columns = layout.columns[parameters.family.name]
        stays = (columns >= 0) & ~np.append(held, True)[columns]
        system.append(replace(parameters, free=stays))
        for group in scene.observations.others:
            if isinstance(group, DirectObservations) and group.family.name == parameters.family.name:
                sigma = np.where(stays, group.stochastic.sigma, np.nan)
                others.append(replace(group, stochastic=type(group.stochastic).from_sigma(sigma)))
    others += [g for g in scene.observations.others if not isinstance(g, DirectObservations)]
    block = replace(scene.block, system=tuple(system))
    observations = Observations(scene.observations.image_points, tuple(others))
    for _ in range(2):
        result = adjust_block(block, observations)
        block = started_from(block, result)
    return result


def started_from(block: Block, result: AdjustmentResult) -> Block:
    return replace(
        block,
        projection_centre=result.state.projection_centre,
        local_from_camera=result.state.local_from_camera,
        object_point=result.state.object_point,
    )


def changes(result: AdjustmentResult, like: AdjustmentResult) -> Floats:
    """Adjusted minus given values in the columns of another layout."""
    found = np.zeros(like.layout.border)
    for parameters in like.layout.system:
        columns = like.layout.columns[parameters.family.name]
        difference = result.state.system[parameters.family.name] - parameters.values
        found[columns[columns >= 0]] = difference[columns >= 0]
    return found


@pytest.fixture(scope="module")
def full() -> tuple[Scene, AdjustmentResult]:
    scene = block_with_given_values_nearby()
    return scene, adjusted(scene, np.zeros(scene.block.layout.border, dtype=bool))


def assert_is(estimate: LinearEstimate, again: AdjustmentResult, full: AdjustmentResult) -> None:
    sigma = np.sqrt(np.diagonal(full.cofactor.reduced.corner))
    # What is left is the curvature of the model over some 10 σ.
    assert np.abs((estimate.change - changes(again, full)) / sigma).max() < 5e-5
    inner = again.cofactor.reduced.corner
    found = estimate.cofactor[np.ix_(estimate.free, estimate.free)]
    own = np.sqrt(np.diagonal(inner))
    assert np.abs((found - inner) / np.outer(own, own)).max(initial=0.0) < 1e-5
    assert estimate.weighted_squares == pytest.approx(again.test.weighted_squares, rel=1e-6)
    assert estimate.redundancy == again.test.redundancy


@pytest.mark.parametrize("dropped", [(), (0,), (1, 4), (2, 5, 6, 8), (0, 1, 2, 3, 4, 5, 6, 7, 8)])
def test_a_block_is_not_adjusted_again_to_know_it_without_some_parameters(
    full: tuple[Scene, AdjustmentResult], dropped: tuple[int, ...]
) -> None:
    scene, result = full
    estimate = LinearEstimate.of(normals_of_result(result))
    held = np.zeros(result.layout.border, dtype=bool)
    for d in dropped:
        estimate, held[d] = estimate.without(d), True
    assert_is(estimate, adjusted(scene, held), result)


def test_the_normals_at_a_state_with_parameters_held_say_what_freeing_them_gives(
    full: tuple[Scene, AdjustmentResult],
) -> None:
    scene, result = full
    without = adjusted(scene, np.ones(result.layout.border, dtype=bool))
    system = System.of(scene.block, scene.observations)
    estimate = LinearEstimate.of(normals_at(system, without.state))
    assert estimate.free.all()
    assert_is(estimate, result, result)
    # At a state where no parameter has its given value, nor the one that fits.
    layout, sigma = result.layout, np.sqrt(np.diagonal(result.cofactor.reduced.corner))
    nothing = np.zeros((layout.events, 6)), np.zeros((layout.points, 3))
    elsewhere = layout.update(result.state, nothing[0], 2.0 * sigma, nothing[1])
    assert_is(LinearEstimate.of(normals_at(system, elsewhere)), result, result)


def test_the_normal_matrix_of_the_parameters_is_the_inverse_of_their_cofactors(
    full: tuple[Scene, AdjustmentResult],
) -> None:
    reduced = full[1].cofactor.reduced
    scale = np.sqrt(np.diagonal(reduced.corner))
    product = (reduced.normal * np.outer(scale, scale)) @ (reduced.corner / np.outer(scale, scale))
    assert np.abs(product - np.eye(len(scale))).max() < 1e-8
