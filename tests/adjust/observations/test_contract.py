"""What every observation group has to keep: derivatives, weights, order and rejection."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from adjust.arrays import Bools, Floats
from adjust.geometry import rotation
from adjust.observations.base import Linearization, ObservationGroup, Term
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    EXTERIOR_ORIENTATION,
    FAMILIES,
    INTERIOR_ORIENTATION,
    OBJECT_POINT,
    State,
)
from tests.adjust.scenes import ALL_FREE, DEGREE, Scene, two_strips

# Steps of the central differences for each unit. Truncation is of the order of the squared ratio of
# the step to the scale over which the model bends (1000 m flying height, 1 rad), below 1e-7; rounding
# stays below 1e-8.
STEP = {"m": 0.05, "rad": 2e-5, "s": 1e-3, "m/s": 1e-2, "rad/s": 2e-6, "interior": 1e-5, "1": 0.1}


def scene() -> Scene:
    """Everything free, two rigs and flights, the state far from where the observations agree."""
    priors = dict.fromkeys(FAMILIES, 0.01)
    strips = dict.fromkeys(
        ("gnss_strip_bias", "gnss_drift", "ins_strip_bias", "ins_drift", "time_offset"), True
    )
    free = {**ALL_FREE, **strips, ADDITIONAL_PARAMETERS: True}
    return two_strips(
        cameras=2,
        heads=3,
        flights=2,
        additional=True,
        turning=True,
        distances=5,
        free=free,
        priors=priors,
        noise_seed=31,
        start_seed=32,
    )


def unit_of(family: str) -> str:
    return "1" if family == ADDITIONAL_PARAMETERS else FAMILIES[family].unit


def non_trivial_state(of: Scene) -> State:
    """Approximate values with parameters that are neither zero nor true."""
    generator = np.random.default_rng(33)
    state = of.block.approximate_state()
    system = {}
    for name, values in of.truth.system.items():
        size = {"m": 0.3, "rad": 0.5 * DEGREE, "1": 5.0}.get(unit_of(name), 0.01)
        size = 20e-6 if name == INTERIOR_ORIENTATION else size
        system[name] = values + generator.normal(0.0, size, values.shape)
    return replace(state, system=system)


SCENE = scene()
STATE = non_trivial_state(SCENE)
GROUPS: dict[str, ObservationGroup] = {group.name: group for group in SCENE.observations.groups}


def moved(state: State, block: str, component: int, steps: Floats) -> State:
    """The state with one component of a kind of unknown changed, by its own step for each entity."""
    if block == EXTERIOR_ORIENTATION and component < 3:
        centre = state.projection_centre.copy()
        centre[:, component] += steps
        return replace(state, projection_centre=centre)
    if block == EXTERIOR_ORIENTATION:
        turn = rotation.exp(steps[:, None] * np.eye(3)[component - 3])
        return replace(state, local_from_camera=state.local_from_camera @ turn)
    if block == OBJECT_POINT:
        points = state.object_point.copy()
        points[:, component] += steps
        return replace(state, object_point=points)
    values = state.system[block].copy()
    values[:, component] += steps
    return replace(state, system={**state.system, block: values})


def unknowns(state: State) -> Iterator[tuple[str, int, int, float]]:
    """Every kind of unknown of the block, component by component: (kind, entities, component, step)."""
    sizes = {
        EXTERIOR_ORIENTATION: (len(state.projection_centre), 6),
        OBJECT_POINT: (len(state.object_point), 3),
        **{name: values.shape for name, values in state.system.items()},
    }
    for block, (entities, components) in sizes.items():
        for component in range(components):
            if block == EXTERIOR_ORIENTATION:
                step = STEP["m"] if component < 3 else STEP["rad"]
            elif block == OBJECT_POINT:
                step = STEP["m"]
            else:
                step = STEP["interior" if block == INTERIOR_ORIENTATION else unit_of(block)]
            yield block, entities, component, step


def along(
    equations: Linearization, whitener: Floats, block: str, component: int, direction: Floats
) -> tuple[Floats, Floats]:
    """Whitened derivative (n, m) along a direction (entities,), and the largest single one (n,)."""
    n, m = equations.misclosure.shape
    total, largest = np.zeros((n, m)), np.zeros(n)
    for term in equations.terms:
        if term.block == block:
            seen = term.index >= 0
            single = np.einsum("nij,nj->ni", whitener, term.jacobian[:, :, component]) * seen[:, None]
            total += single * direction[term.index][:, None]
            largest = np.maximum(largest, np.abs(single).max(axis=1))
    return total, largest


def largest_derivative_error(group: ObservationGroup, state: State) -> float:
    """Largest |analytic − numeric|, relative to the largest derivative of its kind in the observation.

    All entities are moved at once, each by a part of the step that is its own, so that a derivative with
    respect to a wrong one shows.
    """
    whitener, random = group.stochastic.whitener, np.random.default_rng(35)
    analytic = group.linearize(state)
    scale: dict[tuple[str, bool], Floats] = {}
    errors = []
    for block, entities, component, step in unknowns(state):
        direction = random.uniform(0.5, 1.0, entities) * random.choice([-1.0, 1.0], entities)
        after = group.linearize(moved(state, block, component, step * direction)).misclosure
        before = group.linearize(moved(state, block, component, -step * direction)).misclosure
        numeric = -np.einsum("nij,nj->ni", whitener, after - before) / (2.0 * step)
        expected, size = along(analytic, whitener, block, component, direction)
        kind = (block, block == EXTERIOR_ORIENTATION and component >= 3)
        scale[kind] = np.maximum(scale.get(kind, np.zeros(len(size))), size)
        errors.append((kind, np.abs(numeric - expected).max(axis=1)))
    # A kind of unknown that an observation does not see has the derivative zero, exactly.
    return float(
        max(
            np.max(np.where(scale[kind] > 0, error / np.maximum(scale[kind], 1e-300), error))
            for kind, error in errors
        )
    )


@pytest.mark.parametrize("name", list(GROUPS))
def test_derivatives_are_those_of_central_differences(name: str) -> None:
    assert largest_derivative_error(GROUPS[name], STATE) < 1e-6


def test_derivatives_hold_for_a_distortion_of_the_ideal_point() -> None:
    """Of millimetres, beside a correction; and the values are not the truth."""
    distorted = two_strips(
        cameras=2, flights=2, additional=True, forward=True, free=ALL_FREE, noise_seed=31, start_seed=32
    )
    start, truth = distorted.block.approximate_state(), distorted.truth.system
    drawn = np.random.default_rng(34).uniform(0.8, 1.2, truth[ADDITIONAL_PARAMETERS].shape)
    interior = truth[INTERIOR_ORIENTATION] + 20e-6
    system = {
        **truth,
        INTERIOR_ORIENTATION: interior,
        ADDITIONAL_PARAMETERS: truth[ADDITIONAL_PARAMETERS] * drawn,
    }
    state = replace(start, system=system)
    rays = distorted.observations.image_points
    assert largest_derivative_error(rays, state) < 1e-6
    # Distortion bends what the camera sees: without it the derivatives are some percent off.
    assert rays.self_calibration is not None
    plain = replace(rays, self_calibration=replace(rays.self_calibration, distortions=()))
    undistorted, found = (one.linearize(state).terms[0].jacobian[:, :, :3] for one in (plain, rays))
    assert np.abs(undistorted - found).max() > 0.03 * np.abs(found).max()


@pytest.mark.parametrize("forward", [False, True])
def test_image_points_with_additional_parameters_agree_with_the_truth(forward: bool) -> None:
    exact = two_strips(cameras=2, additional=True, forward=forward)
    misclosure = exact.observations.image_points.misclosure(exact.truth)
    assert np.abs(misclosure).max() < 1e-11


def test_every_observation_type_and_every_family_is_under_contract() -> None:
    families = {term.block for group in GROUPS.values() for term in group.linearize(STATE).terms}
    assert families == {EXTERIOR_ORIENTATION, OBJECT_POINT, ADDITIONAL_PARAMETERS, *FAMILIES}
    assert {"image_points", "control_points", "gnss_positions", "ins_attitudes"} <= set(GROUPS)


@dataclass(frozen=True, eq=False)
class LinearisedAttitudes(InsAttitudes):
    """Attitudes without the inverse Jacobian of the logarithm: an error that small residuals hide."""

    def linearize(self, state: State) -> Linearization:
        exact = super().linearize(state)
        inverse = rotation.right_jacobian_inverse(-exact.misclosure)
        terms = tuple(
            Term(term.block, term.index, np.linalg.solve(inverse, term.jacobian)) for term in exact.terms
        )
        return Linearization(exact.misclosure, terms)


def test_the_contract_finds_a_derivative_that_is_only_nearly_right() -> None:
    sound = GROUPS["ins_attitudes"]
    assert isinstance(sound, InsAttitudes)
    broken = LinearisedAttitudes(
        sound.event, sound.camera, sound.observed, sound.body_from_camera, sound.stochastic, sound.turning
    )
    assert largest_derivative_error(broken, STATE) > 1e-3


def test_the_contract_finds_a_derivative_with_respect_to_another_entity() -> None:
    @dataclass(frozen=True, eq=False)
    class Shifted:
        group: Any

        def __getattr__(self, name: str) -> Any:
            return getattr(self.group, name)

        def linearize(self, state: State) -> Linearization:
            found = self.group.linearize(state)
            own = [replace(term, index=term.index[::-1]) for term in found.terms]
            return replace(found, terms=tuple(own))

    shifted: Any = Shifted(GROUPS["gnss_positions"])
    assert largest_derivative_error(shifted, STATE) > 1e-2


def test_the_contract_finds_a_wrong_sign() -> None:
    @dataclass(frozen=True, eq=False)
    class Turned:
        group: Any

        def __getattr__(self, name: str) -> Any:
            return getattr(self.group, name)

        def linearize(self, state: State) -> Linearization:
            found = self.group.linearize(state)
            return replace(found, misclosure=-found.misclosure)

    turned: Any = Turned(GROUPS["gnss_positions"])
    assert largest_derivative_error(turned, STATE) > 1.0


@pytest.mark.parametrize("name", list(GROUPS))
def test_misclosure_vanishes_at_the_truth_without_noise(name: str) -> None:
    exact = two_strips(
        cameras=2,
        heads=3,
        flights=2,
        turning=True,
        distances=5,
        free={**ALL_FREE, "time_offset": True},
        priors=dict.fromkeys(FAMILIES, 0.01),
    )
    group = next(group for group in exact.observations.groups if group.name == name)
    misclosure = group.linearize(exact.truth).misclosure[group.stochastic.present]
    # Metres or radians: rounding of coordinates of some kilometres.
    assert np.abs(misclosure).max() < 1e-11


@pytest.mark.parametrize("name", list(GROUPS))
def test_shapes_and_units_are_what_the_protocol_says(name: str) -> None:
    group = GROUPS[name]
    n, m = len(group.event), len(group.components)
    equations = group.linearize(STATE)
    assert group.point.shape == (n,)
    assert equations.misclosure.shape == (n, m)
    assert group.stochastic.whitener.shape == (n, m, m)
    assert group.stochastic.present.shape == group.stochastic.sigma.shape == (n, m)
    assert group.unit in ("m", "rad", "s", "m/s", "rad/s")
    for term in equations.terms:
        assert term.index.shape == (n,)
        assert term.jacobian.shape[:2] == (n, m)


@pytest.mark.parametrize("name", list(GROUPS))
def test_rejecting_observations_takes_out_these_and_no_others(name: str) -> None:
    group = GROUPS[name]
    rejected: Bools = np.zeros(len(group.event), dtype=bool)
    rejected[0] = True
    left = group.without(rejected)
    assert not left.stochastic.present[0].any()
    assert not left.stochastic.whitener[0].any()
    np.testing.assert_array_equal(left.stochastic.present[1:], group.stochastic.present[1:])
    np.testing.assert_array_equal(left.stochastic.whitener[1:], group.stochastic.whitener[1:])
    np.testing.assert_array_equal(left.stochastic.sigma, group.stochastic.sigma)
    np.testing.assert_array_equal(left.linearize(STATE).misclosure[1:], group.linearize(STATE).misclosure[1:])
    assert group.stochastic.present[0].any(), "the given group is left as it was"


@pytest.mark.parametrize("name", list(GROUPS))
def test_rejecting_in_two_steps_is_rejecting_both(name: str) -> None:
    group = GROUPS[name]
    if len(group.event) < 2:
        group = next(g for g in GROUPS.values() if len(g.event) > 2)
    first, second = np.arange(len(group.event)) == 0, np.arange(len(group.event)) == 1
    stepwise = group.without(first).without(second)
    at_once = group.without(first | second)
    np.testing.assert_array_equal(stepwise.stochastic.whitener, at_once.stochastic.whitener)


@pytest.mark.parametrize("name", list(GROUPS))
def test_whiteners_are_roots_of_the_inverse_covariance(name: str) -> None:
    model = GROUPS[name].stochastic
    for whitener, present, sigma in zip(model.whitener, model.present, model.sigma, strict=True):
        kept = np.flatnonzero(present)
        part = whitener[np.ix_(kept, kept)]
        covariance = np.linalg.inv(part.T @ part)
        np.testing.assert_allclose(np.sqrt(np.diagonal(covariance)), sigma[kept], rtol=1e-12)
        assert not whitener[~present].any()
        assert not whitener[:, ~present].any()


@pytest.mark.parametrize("name", ["control_points", "gnss_positions", "ins_attitudes"])
def test_the_order_of_observations_does_not_matter(name: str) -> None:
    group: Any = GROUPS[name]
    order = np.random.default_rng(3).permutation(len(group.event))
    changed = {}
    for field in ("event", "point", "camera", "flight", "given", "given_height", "observed"):
        if field in group.__dataclass_fields__:
            changed[field] = getattr(group, field)[order]
    for field in ("local_from_enu", "body_from_camera"):
        if field in group.__dataclass_fields__:
            changed[field] = getattr(group, field)[order]
    if name in ("gnss_positions", "ins_attitudes"):
        changed["motion"] = replace(
            group.motion,
            strip=group.motion.strip[order],
            since_middle=group.motion.since_middle[order],
            velocity=group.motion.velocity[order],
        )
    if name == "ins_attitudes":
        turning = group.turning
        changed["turning"] = replace(turning, flight=turning.flight[order], rate=turning.rate[order])
    model = group.stochastic
    changed["stochastic"] = replace(
        model, whitener=model.whitener[order], present=model.present[order], sigma=model.sigma[order]
    )
    permuted = replace(group, **changed).linearize(STATE)
    given = group.linearize(STATE)
    np.testing.assert_array_equal(permuted.misclosure, given.misclosure[order])
    for after, before in zip(permuted.terms, given.terms, strict=True):
        assert after.block == before.block
        np.testing.assert_array_equal(after.index, before.index[order])
        np.testing.assert_array_equal(after.jacobian, before.jacobian[order])
