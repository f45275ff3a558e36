"""Noise correlated over time: covariance, and what it does to parallaxes and points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.georeferencing.direct_orientation import correlated_noise
from adjust.georeferencing.space_intersection import point_errors
from adjust.observations.base import StochasticModel
from adjust.observations.gauss_markov import GaussMarkov
from tests.adjust.georeferencing.flights import Flight, fly, simulated
from tests.adjust.georeferencing.test_y_parallax import parallaxes_of


def model(strip: list[int], time: list[float], correlation_time: float) -> StochasticModel:
    alone = StochasticModel.from_sigma(np.ones((len(time), 3)))
    return alone.correlated(GaussMarkov(np.array(strip), np.array(time), correlation_time))


def test_the_covariance_is_that_of_the_process_and_strips_are_independent() -> None:
    strip, time = [0, 1, 0, 0, 1], [4.0, 0.0, 0.0, 1.0, 7.0]
    positions, attitudes = model(strip, time, 3.0), StochasticModel.from_sigma(np.ones((5, 3)))
    factor = correlated_noise(positions, attitudes)
    assert factor is not None
    covariance = (factor @ factor.T).toarray().reshape(5, 6, 5, 6)
    age = np.abs(np.subtract.outer(time, time)) / 3.0
    expected = np.where(np.equal.outer(strip, strip), np.exp(-age), 0.0)
    for component in range(6):
        of_component = covariance[:, component, :, component]
        np.testing.assert_allclose(of_component, expected if component < 3 else np.eye(5), atol=1e-12)
    assert np.count_nonzero(covariance[:, 0, :, 1]) == 0


def test_it_is_the_inverse_of_the_whitening_of_the_adjustment() -> None:
    stochastic = model([0, 0, 0, 0], [0.0, 3.0, 5.0, 20.0], 10.0)
    factor = correlated_noise(stochastic, stochastic)
    assert factor is not None
    draws = np.random.default_rng(1).normal(size=(4, 3))
    correlated = (factor @ np.concatenate([draws, draws], axis=1).ravel()).reshape(4, 6)[:, :3]
    np.testing.assert_allclose(stochastic.whitened(correlated), draws, atol=1e-12)


def test_independent_noise_needs_no_factor() -> None:
    alone = StochasticModel.from_sigma(np.ones((3, 3)))
    assert correlated_noise(alone, alone) is None


@pytest.mark.parametrize("seconds", [None, 3.0])
def test_images_of_two_heads_share_the_errors_of_their_reading(seconds: float | None) -> None:
    """Each head has strips of its own; 5 s apart."""
    alone = StochasticModel.from_sigma(np.ones((4, 3)))
    process = alone if seconds is None else model([0, 1, 0, 1], [0.0, 0.0, 5.0, 5.0], seconds)
    factor = correlated_noise(process, alone, np.array([0, 0, 2, 2]))
    assert factor is not None
    covariance = (factor @ factor.T).toarray().reshape(4, 6, 4, 6)
    same = np.kron(np.eye(2), np.ones((2, 2)))
    lasting = 0.0 if seconds is None else np.exp(-5.0 / seconds)
    for component in range(6):
        expected = same + (lasting if component < 3 else 0.0) * (1.0 - same)
        np.testing.assert_allclose(covariance[:, component, :, component], expected, atol=1e-12)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(simulated())


def correlated(flight: Flight, seconds: float) -> Flight:
    truth = flight.simulated.truth
    process = GaussMarkov(truth.plan.strip, truth.trajectory.time, seconds)
    return replace(
        flight,
        gnss=replace(flight.gnss, stochastic=flight.gnss.stochastic.correlated(process)),
        ins=replace(flight.ins, stochastic=flight.ins.stochastic.correlated(process)),
    )


def test_sensitivities_have_the_covariance_of_the_process(flight: Flight) -> None:
    seconds = 20.0
    plain, lasting = parallaxes_of(flight), parallaxes_of(correlated(flight, seconds))
    time, strip = flight.simulated.truth.trajectory.time, flight.simulated.truth.plan.strip
    correlation = np.where(
        np.equal.outer(strip, strip), np.exp(-np.abs(np.subtract.outer(time, time)) / seconds), 0.0
    )
    matrix = plain.sensitivity.images.toarray()
    covariance = np.kron(correlation, np.eye(6))
    np.testing.assert_allclose(
        lasting.sensitivity.variance_by_images(), np.sum((matrix @ covariance) * matrix, axis=1), rtol=1e-9
    )


def test_errors_that_last_give_smaller_parallaxes_and_no_better_points(flight: Flight) -> None:
    """What two successive images have in common turns and shifts their model and hardly bends it."""

    def parallax_um(one: Flight) -> float:
        return float(1e6 * np.sqrt(parallaxes_of(one).sensitivity.variance_by_images().mean()))

    def height_m(one: Flight) -> float:
        points = one.intersected()
        axes = np.broadcast_to(np.eye(3), (len(points), 3, 3))
        errors = point_errors(one.rays, one.sources(), points, axes).sensitivity
        return float(np.sqrt(errors.variance_by_images()[1::3].mean()))

    lasting = correlated(flight, 300.0)
    assert parallax_um(lasting) < 0.45 * parallax_um(flight)
    assert height_m(lasting) > 0.9 * height_m(flight)
