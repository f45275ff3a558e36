"""Orientations from GNSS and INS: exact, and with exact derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from adjust.georeferencing.direct_orientation import DirectOrientations, direct_orientations
from adjust.observations.base import StochasticModel
from adjust.parameters import BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS, LEVER_ARM, TIME_OFFSET
from tests.adjust.georeferencing.flights import Flight, fly, simulated
from tests.adjust.simulate.specifications import on_the_earth, small_specification, without_noise


@pytest.fixture(scope="module")
def exact() -> Flight:
    noise = without_noise(small_specification()).noise
    return fly(simulated(noise=noise, frame=on_the_earth(small_specification()).frame))


@pytest.fixture(scope="module")
def noisy() -> Flight:
    return fly(simulated())


def elements(one: DirectOrientations, other: DirectOrientations) -> Floats:
    """Differences (n, 6) of orientations: other minus one."""
    turned = np.swapaxes(one.state.local_from_camera, 1, 2) @ other.state.local_from_camera
    shift = other.state.projection_centre - one.state.projection_centre
    return np.concatenate([shift, rotation.log(turned)], axis=1)


def test_without_noise_they_are_the_true_ones(exact: Flight) -> None:
    truth = exact.simulated.truth.state
    error = elements(replace(exact.orientations, state=truth), exact.orientations)
    assert np.abs(error[:, :3]).max() < 1e-9
    assert np.abs(error[:, 3:]).max() < 1e-12


def test_position_and_attitude_are_fitted_without_residuals(noisy: Flight) -> None:
    state = noisy.orientations.state
    assert np.abs(noisy.gnss.linearize(state).misclosure).max() < 1e-9
    assert np.abs(noisy.ins.linearize(state).misclosure).max() < 1e-12


@pytest.mark.parametrize(
    ("family", "step"),
    [(BORESIGHT, 1e-5), (LEVER_ARM, 1e-2), (GNSS_SHIFT, 1e-2), (GNSS_STRIP_BIAS, 1e-2), (TIME_OFFSET, 1e-4)],
)
def test_derivatives_by_the_calibration_are_those_of_differences(
    noisy: Flight, family: str, step: float
) -> None:
    term = next(term for term in noisy.orientations.terms if term.block == family)
    for component in range(term.jacobian.shape[2]):
        change = np.zeros(term.jacobian.shape[2])
        change[component] = step
        ahead, behind = (noisy.with_system(family, sign * change).orientations for sign in (1.0, -1.0))
        numeric = elements(behind, ahead) / (2.0 * step)
        assert np.abs(numeric - term.jacobian[:, :, component]).max() < 1e-6 * max(
            1.0, np.abs(term.jacobian).max()
        )


def test_derivatives_by_the_observations_are_those_of_differences(noisy: Flight) -> None:
    orientations = noisy.orientations
    for component in range(6):
        change = np.zeros(6)
        change[component] = 1e-6
        ahead, behind = (
            direct_orientations(
                replace(
                    noisy.gnss, observed=noisy.gnss.observed + noisy.gnss.local_from_enu @ (sign * change[:3])
                ),
                # log(R_INSᵀ R) grows by what the observed attitude is turned back.
                replace(noisy.ins, observed=noisy.ins.observed @ rotation.exp(sign * change[3:])),
                noisy.system,
            )
            for sign in (1.0, -1.0)
        )
        numeric = elements(behind, ahead) / 2e-6
        assert np.abs(numeric - orientations.of_observations[:, :, component]).max() < 1e-5


def test_their_covariance_is_that_of_position_and_attitude(noisy: Flight) -> None:
    """Whose components are correlated."""
    n, random = noisy.orientations.images, np.random.default_rng(3)
    covariance = np.zeros((n, 6, 6))
    for part, sigma in ((slice(0, 3), 0.05), (slice(3, 6), 1e-4)):
        root = sigma * random.normal(size=(n, 3, 3))
        covariance[:, part, part] = root @ np.swapaxes(root, 1, 2)
    every = np.ones((n, 3), dtype=bool)
    position, attitude = (
        StochasticModel.from_covariance(covariance[:, part, part], every)
        for part in (slice(0, 3), slice(3, 6))
    )
    orientations = replace(
        noisy,
        gnss=replace(noisy.gnss, stochastic=position),
        ins=replace(noisy.ins, stochastic=attitude),
    ).orientations
    expected = orientations.of_observations @ covariance @ np.swapaxes(orientations.of_observations, 1, 2)
    found = orientations.of_noise @ np.swapaxes(orientations.of_noise, 1, 2)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-16)


def test_every_image_has_the_calibration_of_its_camera(noisy: Flight) -> None:
    """Every other one is of a second camera, mounted otherwise."""
    camera = np.arange(noisy.orientations.images) % 2
    second = noisy.with_system(BORESIGHT, np.array([3e-3, 2e-3, -1e-3]))
    second = second.with_system(LEVER_ARM, np.array([0.2, -0.3, 0.1]))
    both = {
        family: np.concatenate([values, second.system[family]])
        if family in (BORESIGHT, LEVER_ARM)
        else values
        for family, values in noisy.system.items()
    }
    found = direct_orientations(
        replace(noisy.gnss, camera=camera), replace(noisy.ins, camera=camera), both
    ).state
    for number, flight in enumerate((noisy, second)):
        own, alone = camera == number, flight.orientations.state
        for name in ("projection_centre", "local_from_camera"):
            np.testing.assert_allclose(getattr(found, name)[own], getattr(alone, name)[own], atol=1e-9)


def test_an_image_without_attitude_is_refused(noisy: Flight) -> None:
    model = noisy.ins.stochastic
    lacking = model.sigma.copy()
    lacking[2, 1] = np.nan
    with pytest.raises(InconsistentBlockError, match="lacks a component"):
        direct_orientations(
            noisy.gnss, replace(noisy.ins, stochastic=StochasticModel.from_sigma(lacking)), noisy.system
        )
    with pytest.raises(InconsistentBlockError, match="every image"):
        direct_orientations(noisy.gnss, replace(noisy.ins, event=noisy.ins.event[::-1]), noisy.system)
