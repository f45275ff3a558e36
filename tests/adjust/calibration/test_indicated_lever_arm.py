"""What the positions say of a lever arm: the same as an adjustment in which it is free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.calibration.indicated_lever_arm import indicated_lever_arms
from adjust.observations.base import StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_SHIFT,
    LEVER_ARM,
    ConsideredParameters,
    ParameterPlace,
)
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.system import SystemSpecification
from adjust.solve.system import Observations
from tests.adjust.scenes import two_strips
from tests.adjust.simulate.specifications import small_specification

TRUE = np.array([0.61, -0.34, -1.20])
SHIFT_FREE = (BORESIGHT, GNSS_SHIFT)


@pytest.fixture(scope="module")
def simulated() -> SimulatedBlock:
    """20 images in crossing strips, forward and reverse; no shift, 5 cm GNSS."""
    return simulate_block(small_specification(system=SystemSpecification(lever_arm=tuple(TRUE))))


def with_given(block: Block, lever_arm: np.ndarray) -> Block:
    system = tuple(
        replace(item, values=np.broadcast_to(lever_arm, item.values.shape).copy())
        if item.family.name == LEVER_ARM
        else item
        for item in block.system
    )
    return replace(block, system=system)


def with_small_shift(observations: Observations) -> Observations:
    sigma = StochasticModel.from_sigma(np.full((1, 3), 0.20))
    prior = DirectObservations(FAMILIES[GNSS_SHIFT], np.zeros(1, dtype=np.int64), np.zeros((1, 3)), sigma)
    return replace(observations, others=(*observations.others, prior))


@pytest.mark.parametrize(
    ("sign", "stated", "within"),
    [(-1.0, 1.0, 0.02), (1.0, 1.0, 0.02), (1.0, 0.5, 0.002), (1.0, 2.0, 0.02)],
)
def test_it_is_that_of_an_adjustment_with_lever_arm_and_small_shift_free(
    simulated: SimulatedBlock, sign: float, stated: float, within: float
) -> None:
    held = with_given(simulated.block((BORESIGHT,)), sign * TRUE)
    observations = simulated.observations(held)
    rays = observations.image_points
    observations = replace(observations, image_points=replace(rays, sigma=stated * rays.sigma))
    found = indicated_lever_arms(held, adjust_block(held, observations))
    assert found is not None
    free = with_given(simulated.block((BORESIGHT, LEVER_ARM, GNSS_SHIFT)), sign * TRUE)
    right = adjust_block(free, with_small_shift(observations))
    columns = right.layout.columns[LEVER_ARM][0]
    sigma = np.sqrt(np.diagonal(right.cofactor.reduced.corner)[columns]) * max(1.0, right.test.sigma0)
    # One step from a lever arm that is 2.8 m off: what is not linear in it is below a tenth of a σ.
    assert (np.abs(found.value[0] - right.state.system[LEVER_ARM][0]) < 0.1 * sigma).all()
    assert (right.test.sigma0 > 1.5) == (stated < 1.0)
    np.testing.assert_allclose(found.sigma[0], sigma, rtol=within)
    assert (np.abs(found.value[0] - TRUE) < 4.0 * found.sigma[0]).all()


def test_a_free_shift_leaves_the_height_open_and_the_plan_determined(simulated: SimulatedBlock) -> None:
    block = with_given(simulated.block(SHIFT_FREE), -TRUE)
    found = indicated_lever_arms(block, adjust_block(block, simulated.observations(block)))
    assert found is not None
    assert (found.sigma[0, :2] < 0.05).all()
    assert found.sigma[0, 2] > 0.5
    assert (np.abs(found.value[0, :2] - TRUE[:2]) < 4.0 * found.sigma[0, :2]).all()


def test_positions_rejected_by_the_dozen_are_heard_and_a_single_one_is_not(
    simulated: SimulatedBlock,
) -> None:
    block = with_given(simulated.block((BORESIGHT,)), -TRUE)
    observations = simulated.observations(block)
    result = adjust_block(block, observations, AdjustmentOptions(critical_value=4.13))
    positions = next(item for item in result.groups if isinstance(item.group, GnssPositions))
    assert positions.rejected > 0.5 * len(positions.status)
    found = indicated_lever_arms(block, result)
    assert found is not None
    every = indicated_lever_arms(block, adjust_block(block, observations))
    assert every is not None
    np.testing.assert_allclose(found.sigma, every.sigma, rtol=0.15)
    assert (np.abs(found.value[0] - TRUE) < 4.0 * found.sigma[0]).all()

    others = list(observations.others)
    number = next(k for k, group in enumerate(others) if isinstance(group, GnssPositions))
    observed = others[number].observed.copy()  # type: ignore[attr-defined]
    observed[7] += 40.0
    others[number] = replace(others[number], observed=observed)  # type: ignore[type-var]
    right = with_given(block, TRUE)
    spoiled = replace(observations, others=tuple(others))
    result = adjust_block(right, spoiled, AdjustmentOptions(critical_value=4.13))
    found = indicated_lever_arms(right, result)
    assert found is not None
    assert (np.abs(found.value[0] - TRUE) < 4.0 * found.sigma[0]).all()


@pytest.mark.parametrize("observed", [False, True])
def test_a_shift_far_beyond_what_is_assumed_of_it_makes_sigma_larger(*, observed: bool) -> None:
    """A shift of 3 m is fifteen times as large as what is thought possible, or stated of one that is free.

    Of that one, what is stated is not the value from which the adjustment begins.
    """
    given = 2.0 if observed else 0.0
    system = SystemSpecification(lever_arm=tuple(TRUE), gnss_shift=(3.0, -2.0, 1.0))
    flown = simulate_block(small_specification(system=system))
    held = with_given(flown.block((BORESIGHT, GNSS_SHIFT) if observed else (BORESIGHT,)), TRUE)
    held = replace(
        held,
        system=tuple(
            replace(item, values=np.full_like(item.values, given)) if item.family.name == GNSS_SHIFT else item
            for item in held.system
        ),
    )
    observations = flown.observations(held)
    known = with_small_shift(observations) if observed else observations
    found = indicated_lever_arms(held, adjust_block(held, known))
    assert found is not None
    free = with_given(flown.block((BORESIGHT, LEVER_ARM, GNSS_SHIFT)), TRUE)
    right = adjust_block(free, with_small_shift(observations))
    columns = right.layout.columns[LEVER_ARM][0]
    sigma0 = right.test.sigma0
    assert sigma0 > 1.1
    sigma = sigma0 * np.sqrt(np.diagonal(right.cofactor.reduced.corner)[columns])
    np.testing.assert_allclose(found.sigma[0], sigma, rtol=0.02)


def test_what_was_known_of_lever_arm_and_shift_has_no_say(simulated: SimulatedBlock) -> None:
    """A lever arm of the wrong sign that was observed to 5 cm, and a shift observed to 1 cm."""
    held = with_given(simulated.block((BORESIGHT,)), TRUE)
    observations = simulated.observations(held)
    expected = indicated_lever_arms(held, adjust_block(held, observations))
    free = with_given(simulated.block((BORESIGHT, LEVER_ARM, GNSS_SHIFT)), -TRUE)
    none = np.zeros(1, dtype=np.int64)
    priors = tuple(
        DirectObservations(FAMILIES[family], none, value[None], StochasticModel.from_sigma(sigma))
        for family, value, sigma in (
            (LEVER_ARM, -TRUE, np.full((1, 3), 0.05)),
            (GNSS_SHIFT, np.zeros(3), np.full((1, 3), 0.01)),
        )
    )
    result = adjust_block(free, replace(observations, others=(*observations.others, *priors)))
    found = indicated_lever_arms(free, result, shift_is_small=True)
    assert expected is not None
    assert found is not None
    np.testing.assert_allclose(found.sigma, expected.sigma, rtol=0.1)
    assert (np.abs(found.value[0] - TRUE) < 4.0 * found.sigma[0]).all()


def test_what_the_flight_does_not_tell_keeps_its_value_with_a_sigma_of_a_hundred_metres() -> None:
    """All in one direction, a free shift is a lever arm."""
    scene = two_strips(headings_deg=(90.0, 90.0), tilt_deg=0.0, free={GNSS_SHIFT: True}, noise_seed=3)
    found = indicated_lever_arms(scene.block, adjust_block(scene.block, scene.observations))
    assert found is not None
    assert (found.sigma[0] > 2.0).all()
    assert (found.sigma[0] < 300.0).all()


def test_without_positions_nothing_is_said(simulated: SimulatedBlock) -> None:
    block = with_given(simulated.block((BORESIGHT,)), TRUE)
    observations = simulated.observations(block)
    others = tuple(group for group in observations.others if not isinstance(group, GnssPositions))
    assert indicated_lever_arms(block, adjust_block(block, replace(observations, others=others))) is None


def test_a_calibration_in_which_the_lever_arm_is_known_hides_no_wrong_sign(simulated: SimulatedBlock) -> None:
    """Neither its errors, nor what it says of the lever arm, is in what the positions say."""
    block = with_given(simulated.block((GNSS_SHIFT,)), -TRUE)
    observations = simulated.observations(block)
    places = tuple(ParameterPlace(name, 0, k) for name in (LEVER_ARM, BORESIGHT) for k in range(3))
    covariance = np.diag([0.01**2] * 3 + [1e-4**2] * 3)
    covariance[0, 3] = covariance[3, 0] = 0.5 * 0.01 * 1e-4
    plain = indicated_lever_arms(block, adjust_block(block, observations))
    considered = replace(block, considered=ConsideredParameters(places, covariance))
    found = indicated_lever_arms(considered, adjust_block(considered, observations))
    assert plain is not None
    assert found is not None
    np.testing.assert_array_equal(found.value, plain.value)

    free = with_given(simulated.block((GNSS_SHIFT, LEVER_ARM, BORESIGHT)), -TRUE)
    names = tuple(name for item in free.system[1:3] for name in item.family.components)
    values = np.array([[item.values[0, k] for item in (free.system[2], free.system[1]) for k in range(3)]])
    model = StochasticModel.from_covariance(covariance[None], np.ones((1, 6), dtype=bool))
    prior = JointPrior("camera", names, ("m",) * 6, places, values, model)
    others = (*observations.others, prior)
    observed = indicated_lever_arms(free, adjust_block(free, replace(observations, others=others)))
    assert observed is not None
    assert (np.abs(observed.value[0, :2] - TRUE[:2]) < 4.0 * observed.sigma[0, :2]).all()
    alone = prior.without_family(LEVER_ARM)
    assert alone.places == places[3:]
    np.testing.assert_allclose(alone.stochastic.sigma, [[1e-4] * 3])
