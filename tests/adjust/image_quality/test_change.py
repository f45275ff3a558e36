"""Changes between two dates: what is unchanged has changed as seldom as is said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.image_quality.change import PROBABILITY, critical_change
from adjust.image_quality.light_response import linearity
from adjust.image_quality.photon_transfer import photon_transfer

TRIALS = 3000


def most(trials: int) -> float:
    """False alarms among so many trials that chance exceeds once in a thousand times."""
    return float(stats.binom.isf(0.001, trials, PROBABILITY))


def test_limits_are_those_of_student_with_the_degrees_of_freedom_of_both() -> None:
    sigma = np.array([[1.0, 1.0], [1.0, 1e-9], [1e-9, 2.0], [1.0, 3.0]])
    degrees = np.array([[5.0, 5.0], [4.0, 50.0], [3.0, 7.0], [np.inf, np.inf]])
    expected = [*stats.t.isf(0.0005, [10.0, 4.0, 7.0]), stats.norm.isf(0.0005)]
    np.testing.assert_allclose(critical_change(sigma, degrees), expected, rtol=1e-6)
    assert critical_change(np.ones((1, 2)), np.array([[0.0, 9.0]]))[0] == np.inf


@pytest.mark.parametrize("levels", [3, 5, 12])
def test_an_unchanged_sensitivity_has_changed_as_seldom_as_is_said(levels: int) -> None:
    random, exposure = np.random.default_rng(levels), np.linspace(1.0, 10.0, levels)
    found = [
        linearity(exposure, 100.0 + 300.0 * exposure + random.normal(0.0, 1.0, levels))
        for _ in range(2 * TRIALS)
    ]
    value, sigma = np.array([(one.sensitivity, one.sigma_sensitivity) for one in found]).T
    both = sigma.reshape(-1, 2)
    t = np.abs(np.diff(value.reshape(-1, 2), axis=1)[:, 0]) / np.hypot(*both.T)
    assert np.count_nonzero(t > critical_change(both, np.full(both.shape, levels - 2.0))) <= most(TRIALS)
    assert levels > 5 or np.count_nonzero(t > 3.29) > 3 * most(TRIALS)


# Both find a σ that is half of what it should be, with a read noise of two electrons.
@pytest.mark.parametrize("trials", [TRIALS // 5, pytest.param(TRIALS, marks=pytest.mark.slow)])
# With one of 60, which is well determined, a σ that is a third too small is found, too.
@pytest.mark.parametrize("read", [0.0, 1.0, 2.0, 60.0])
def test_a_read_noise_that_is_hardly_determined_does_not_change_by_chance(read: float, trials: int) -> None:
    random, pixels, gain = np.random.default_rng(7), 1024.0**2, 4.0
    signal = np.array([300.0, 1e3, 3e3, 6e3, 1e4, 1.5e4, 2e4, 2.8e4])
    true = (read / gain) ** 2 + signal / gain + 1.0 / 12.0
    variance = true * (1.0 + np.sqrt(2.0 / pixels) * random.normal(size=(2 * trials, len(signal))))
    found = [photon_transfer(signal, own, np.full(len(signal), pixels), 0.0) for own in variance]
    value, sigma = np.array([(one.read_noise, one.sigma_read_noise) for one in found]).T
    assert (sigma > 0.0).all()
    t = np.diff(value.reshape(-1, 2), axis=1)[:, 0] / np.hypot(*sigma.reshape(-1, 2).T)
    assert np.count_nonzero(np.abs(t) > 3.29) <= most(trials)
