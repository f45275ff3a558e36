"""Covariances before the flight: closed answers, those of the adjustment, and what must always hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.camera.interior import FrameCamera
from adjust.errors import DatumDefectError
from adjust.observations.base import StochasticModel
from adjust.observations.distance import Distances
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
)
from adjust.planning import a_priori
from adjust.planning.a_priori import APriori, CalibrationModel, a_priori_covariance
from adjust.planning.network import PlannedDistances, PlannedNetwork, PlannedRays
from adjust.planning.simulated_network import simulated_network
from adjust.rig import RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from adjust.simulate.block import simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockSpecification
from adjust.solve.normal_equations import weighted_squares
from adjust.solve.system import System
from tests.adjust.rig_flights import dmc, penta
from tests.adjust.simulate.specifications import HEIGHT, small_specification, without_noise

ALL = (0, 1, 2)
BIAS = 0.03
SET_A = {INTERIOR_ORIENTATION: ALL, BORESIGHT: ALL, GNSS_SHIFT: ALL}
WITH_BIAS = {**SET_A, GNSS_STRIP_BIAS: ALL}
PRIOR = {GNSS_STRIP_BIAS: np.full(3, BIAS)}


def specification(**changes: object) -> BlockSpecification:
    """Two heights in one flight, so that everything is determined."""
    small = small_specification()
    high = tuple(
        replace(group, name=f"H{group.name}", height=2.0 * group.height, base=2.0 * group.base)
        for group in small.flight
    )
    return replace(small, flight=(*small.flight, *high), **changes)  # type: ignore[arg-type]


def sigma_of(found: APriori) -> dict[str, float]:
    return {name: float(sigma) for (name, _, _), sigma in zip(found.names, found.sigma, strict=True)}


def with_sigma_times(network: PlannedNetwork, factor: float) -> PlannedNetwork:
    exposures, rays, control = network.exposures, network.rays, network.control
    return replace(
        network,
        exposures=replace(
            exposures,
            position_sigma=factor * exposures.position_sigma,
            attitude_covariance=factor**2 * exposures.attitude_covariance,
        ),
        rays=replace(rays, sigma=factor * rays.sigma),
        control=replace(control, covariance=factor**2 * control.covariance),
    )


@pytest.mark.parametrize("distances", [False, True])
def test_they_are_the_cofactors_of_the_adjustment_of_the_same_block(distances: bool) -> None:
    """The adjustment's own border, on the same network without noise: nine parameters and the strips."""
    system = SystemSpecification(lever_arm=(0.4, -0.2, -1.1), strip_bias=(BIAS, BIAS, BIAS))
    simulated = simulate_block(without_noise(specification(system=replace(system, strip_bias=(0, 0, 0)))))
    # The prior of the biases is stated, none is drawn.
    stated = replace(simulated, specification=replace(simulated.specification, system=system))
    block = stated.block(WITH_BIAS)
    block = replace(
        block,
        system=tuple(
            replace(item, values=system_values(stated, item.family.name))
            if item.family.name == LEVER_ARM
            else item
            for item in block.system
        ),
    )
    observations, network = stated.observations(block), simulated_network(stated.specification)
    if distances:
        one, other = np.array([3, 10, 30]), np.array([40, 50, 3])
        length = np.linalg.norm(network.object_point[one] - network.object_point[other], axis=1)
        bars = Distances(one, other, length, StochasticModel.from_sigma(np.full((3, 1), 1e-3)))
        observations = replace(observations, others=(*observations.others, bars))
        network = replace(network, distances=PlannedDistances(one, other, np.full(3, 1e-3)))
    adjusted = adjust_block(block, observations)
    expected = a_priori_covariance(network, CalibrationModel(WITH_BIAS, PRIOR))
    assert expected.names == adjusted.layout.border_names()
    scale = expected.sigma
    np.testing.assert_allclose(
        expected.cofactor / np.outer(scale, scale),
        adjusted.cofactor.reduced.corner / np.outer(scale, scale),
        atol=1e-6,
    )


@pytest.mark.parametrize(
    ("specification", "families"),
    [
        pytest.param(
            penta(lines=3, exposures=6, points=300, late=2e-3),
            (INTERIOR_ORIENTATION, BORESIGHT, GNSS_SHIFT, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET),
            id="penta",
        ),
        pytest.param(dmc(points=400), (RELATIVE_ROTATION, LEVER_ARM), id="platform"),
    ],
)
def test_those_of_a_rig_are_the_cofactors_of_the_adjustment_of_its_block(
    specification: BlockSpecification, families: tuple[str, ...]
) -> None:
    simulated = simulate_block(without_noise(specification))
    block = simulated.block(families)
    adjusted = adjust_block(block, simulated.observations(block))
    free = {family: tuple(range(len(FAMILIES[family].components))) for family in families}
    expected = a_priori_covariance(simulated_network(simulated.specification), CalibrationModel(free, {}))
    assert expected.names == adjusted.layout.border_names()
    scale = expected.sigma
    np.testing.assert_allclose(
        expected.cofactor / np.outer(scale, scale),
        adjusted.cofactor.reduced.corner / np.outer(scale, scale),
        atol=1e-6,
    )


def test_biases_of_the_attitudes_of_the_strips_are_in_the_boresight() -> None:
    """Orientations known: σ of a mean over strips with a bias each."""
    bias = 2e-4
    noise = NoiseSpecification(1e-9, (1e-5, 1e-5, 1e-5), (0.05, 0.05, 0.08), (5e-5, 6e-5, 1.4e-4))
    network = simulated_network(specification(noise=noise, survey=(SurveyLayout("grid", columns=8, rows=8),)))
    model = CalibrationModel({BORESIGHT: ALL, INS_STRIP_BIAS: ALL}, {INS_STRIP_BIAS: np.full(3, bias)})
    found, count = sigma_of(a_priori_covariance(network, model)), np.bincount(network.exposures.strip)
    for name, sigma in zip(("roll", "pitch", "yaw"), noise.ins, strict=True):
        weight = np.sum(1.0 / (bias**2 + sigma**2 / count))
        assert found[f"boresight_{name}"] == pytest.approx(1.0 / np.sqrt(weight), rel=2e-3)


def system_values(simulated: object, family: str) -> np.ndarray:
    return simulated.truth.state.system[family]  # type: ignore[attr-defined, no-any-return]


def test_with_known_orientations_boresight_and_shift_are_means() -> None:
    """Image points and control without error: σ_b = σ_INS/√n, and the shift a mean over strips."""
    noise = NoiseSpecification(1e-9, (1e-5, 1e-5, 1e-5), (0.05, 0.05, 0.08), (5e-5, 6e-5, 1.4e-4))
    survey = (SurveyLayout("grid", columns=8, rows=8),)
    network = simulated_network(specification(noise=noise, survey=survey))
    n = len(network.exposures)
    free = {BORESIGHT: ALL, GNSS_SHIFT: ALL}
    white = sigma_of(a_priori_covariance(network, CalibrationModel(free, {})))
    for name, sigma in zip(("roll", "pitch", "yaw"), noise.ins, strict=True):
        assert white[f"boresight_{name}"] == pytest.approx(sigma / np.sqrt(n), rel=2e-3)
    for axis, sigma in zip("xyz", noise.gnss, strict=True):
        assert white[f"gnss_shift_{axis}"] == pytest.approx(sigma / np.sqrt(n), rel=2e-3)
    biased = sigma_of(a_priori_covariance(network, CalibrationModel({**free, GNSS_STRIP_BIAS: ALL}, PRIOR)))
    count = np.bincount(network.exposures.strip)
    for axis, sigma in zip("xyz", noise.gnss, strict=True):
        weight = np.sum(1.0 / (BIAS**2 + sigma**2 / count))
        assert biased[f"gnss_shift_{axis}"] == pytest.approx(1.0 / np.sqrt(weight), rel=2e-3)


def test_all_sigmas_twice_as_large_are_all_results_twice_as_large() -> None:
    network = simulated_network(specification())
    model = CalibrationModel(WITH_BIAS, PRIOR)
    doubled = replace(model, prior_sigma={GNSS_STRIP_BIAS: np.full(3, 2.0 * BIAS)})
    one = a_priori_covariance(network, model)
    two = a_priori_covariance(with_sigma_times(network, 2.0), doubled)
    np.testing.assert_allclose(two.cofactor, 4.0 * one.cofactor, rtol=1e-6, atol=1e-6 * one.sigma.min() ** 2)


def test_the_noise_that_a_seed_draws_has_no_influence() -> None:
    quiet, loud = (simulated_network(item) for item in (without_noise(specification()), specification()))
    model = CalibrationModel(SET_A, {})
    np.testing.assert_array_equal(
        a_priori_covariance(quiet, model).cofactor, a_priori_covariance(loud, model).cofactor
    )


def test_more_unknowns_never_make_a_parameter_better() -> None:
    network = simulated_network(specification())
    fewer = sigma_of(a_priori_covariance(network, CalibrationModel(SET_A, PRIOR)))
    more = sigma_of(
        a_priori_covariance(
            network, CalibrationModel({**WITH_BIAS, LEVER_ARM: (0, 1), TIME_OFFSET: (0,)}, PRIOR)
        )
    )
    assert all(more[name] >= sigma * (1.0 - 1e-9) for name, sigma in fewer.items())


def test_a_prior_of_something_unobserved_comes_out_unchanged() -> None:
    """Without control a shift is the datum: σ = σ_prior, and what a small correlation hides."""
    network = simulated_network(specification(survey=()))
    model = CalibrationModel(SET_A, {GNSS_SHIFT: np.full(3, 10.0)})
    found = a_priori_covariance(network, model)
    sigma = sigma_of(found)
    for axis in "xyz":
        assert sigma[f"gnss_shift_{axis}"] == pytest.approx(10.0, rel=1e-3)
    shift = [k for k, (name, _, _) in enumerate(found.names) if name.startswith("gnss_shift")]
    others = [k for k in range(len(found.names)) if k not in shift]
    assert np.abs(found.correlation[np.ix_(shift, others)]).max() < 0.05
    with pytest.raises(DatumDefectError, match="gnss_shift"):
        a_priori_covariance(network, CalibrationModel(SET_A, {}))


def test_errors_that_last_along_a_strip_make_the_shift_worse() -> None:
    network = simulated_network(specification())
    white = sigma_of(a_priori_covariance(network, CalibrationModel(SET_A, {})))
    lasting = sigma_of(
        a_priori_covariance(
            network, CalibrationModel(SET_A, {}, gnss_correlation_time=60.0, ins_correlation_time=60.0)
        )
    )
    assert lasting["gnss_shift_x"] > 1.2 * white["gnss_shift_x"]
    assert lasting["boresight_yaw"] > 1.2 * white["boresight_yaw"]


def turning_flight(rate_deg_s: float, crab_deg: float = 4.0) -> PlannedNetwork:
    """32 images in four alternating lines of constant speed at 1,000 m."""
    camera = FrameCamera("UCE", 13080, 20010, 5.2e-6, 0.08, (0.0, 0.0), "corner", 0)
    base, spacing = base_of(camera, HEIGHT, 0.6), spacing_of(camera, HEIGHT, 0.3)
    lines = LineGroup("L", "1", 0, np.pi / 2, HEIGHT, (8,) * 4, base, spacing, "alternating")
    tilt, rate = float(np.deg2rad(1.0)), float(np.deg2rad(rate_deg_s))
    variation = FlightVariation((0.0, 0.0, 0.0), (tilt, tilt, 0.0), float(np.deg2rad(crab_deg)), (rate,) * 3)
    return simulated_network(
        small_specification(
            cameras=(camera,), flight=(lines,), variation=variation, points=PointSpecification(count=250)
        )
    )


def test_rates_of_the_body_separate_time_offset_and_lever_arm() -> None:
    model = CalibrationModel({LEVER_ARM: (0, 1), TIME_OFFSET: (0,), BORESIGHT: ALL, GNSS_SHIFT: ALL}, {})
    steady, slow, usual = (
        sigma_of(a_priori_covariance(turning_flight(rate), model)) for rate in (0.0, 0.2, 1.0)
    )
    # What an independent program finds for a block like this one.
    for found, milliseconds, centimetres in ((steady, 3.79, 26.5), (slow, 2.0, 14.0), (usual, 0.46, 3.4)):
        assert found["time_offset"] == pytest.approx(milliseconds * 1e-3, rel=0.25)
        assert found["lever_arm_x"] == pytest.approx(centimetres * 1e-2, rel=0.25)


def test_the_time_offset_of_known_attitudes_is_a_weighted_mean_over_their_rates() -> None:
    """Image points and control without error: 1/σ² = Σ ω²/σ_INS² + Σ v²/σ_GNSS²."""
    network = turning_flight(1.0)
    exposures = network.exposures
    exact = replace(
        network,
        rays=replace(network.rays, sigma=np.full_like(network.rays.sigma, 1e-9)),
        control=replace(
            network.control, covariance=1e-10 * np.tile(np.eye(3), (len(network.control.point), 1, 1))
        ),
    )
    found = sigma_of(a_priori_covariance(exact, CalibrationModel({TIME_OFFSET: (0,)}, {})))
    weight = np.linalg.inv(exposures.attitude_covariance)
    velocity = np.einsum("nji,nj->ni", exposures.local_from_axes, exposures.velocity)
    information = np.einsum("ni,nij,nj->", exposures.rate, weight, exposures.rate)
    information += np.sum((velocity / exposures.position_sigma) ** 2)
    assert found["time_offset"] == pytest.approx(1.0 / np.sqrt(information), rel=2e-3)


def test_planned_observations_contradict_nothing() -> None:
    """Of a lever arm and a boresight that are not zero, and another interior orientation than given."""
    system = SystemSpecification(
        boresight=(2e-3, -1e-3, 4e-3), lever_arm=(0.4, -0.2, -1.1), interior_change=(-8e-6, 4e-6, -6e-6)
    )
    network = simulated_network(specification(system=system))
    model = CalibrationModel(SET_A, {})
    block = a_priori._block(network, model)
    system_of = System.of(block, a_priori._observations(network, block, model))
    assert weighted_squares(system_of, block.approximate_state()) < 1e-6
    found = a_priori_covariance(network, model)
    of_camera = dict(zip([name for name, _, _ in found.names], found.value, strict=True))
    values = {item.family.name: item for item in block.system}[BORESIGHT]
    for component, value in zip(values.family.components, values.values[0], strict=True):
        assert of_camera[component] == pytest.approx(value)


def test_what_a_parameter_has_for_itself_is_its_variance_alone_over_that_with_all_others() -> None:
    random = np.random.default_rng(4)
    root = random.normal(size=(4, 4))
    found = APriori((("a", "", "m"),) * 4, np.zeros(4), root @ root.T, np.full(4, np.nan))
    alone = 1.0 / np.diagonal(np.linalg.inv(found.cofactor))
    np.testing.assert_allclose(found.own_part, alone / np.diagonal(found.cofactor), rtol=1e-9)


def test_drifts_count_from_the_middle_of_the_time_of_a_strip() -> None:
    since = a_priori._since_middle(np.array([0.0, 1.0, 10.0, 40.0, 42.0]), np.array([0, 0, 0, 1, 1]))
    assert since.tolist() == [-5.0, -4.0, 5.0, -1.0, 1.0]


def test_an_exposure_that_sees_no_point_is_above_the_mean_ground() -> None:
    network = simulated_network(specification())
    rays = network.rays
    kept = rays.image != 3
    left = PlannedRays(rays.image[kept], rays.point[kept], rays.sigma[kept])
    alone = replace(network, rays=left)
    assert alone.ground[3] == pytest.approx(network.frame.height(network.object_point).mean())
    np.testing.assert_array_equal(np.delete(alone.ground, 3), np.delete(network.ground, 3))


def test_of_points_without_an_angle_only_surveyed_ones_keep_their_rays() -> None:
    network = simulated_network(specification())
    control = network.control
    full = control.present.all(axis=1)
    present = control.present.copy()
    present[np.flatnonzero(full)[0]] = [False, False, True]
    network = replace(network, control=replace(control, present=present))
    kept = network.with_intersecting_rays(np.deg2rad(89.0)).rays
    surveyed = control.point[present.all(axis=1)]
    assert set(kept.point.tolist()) == set(np.intersect1d(surveyed, network.rays.point).tolist())
