"""Gain, read noise and full well of simulated sensors; linearity and fall-off of light."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.image_quality.light_response import light_fall_off, linearity
from adjust.image_quality.photon_transfer import PhotonTransfer, pair_statistics, photon_transfer

DARK = 100.0


def sensor(
    gain: float, read: float, well: float, electrons: float, rng: np.random.Generator, side: int = 300
) -> Floats:
    """An image of side × side pixels that differ by 1 % in sensitivity, in whole grey values."""
    sensitivity = 1.0 + 0.01 * np.random.default_rng(99).normal(size=(side, side))
    counted = np.minimum(rng.poisson(electrons * sensitivity).astype(np.float64), well)
    return np.rint(DARK + (counted + rng.normal(0.0, read, counted.shape)) / gain)


def curve(gain: float, read: float, seed: int, well: float = 40_000.0, side: int = 300) -> PhotonTransfer:
    rng = np.random.default_rng(seed)
    levels = np.concatenate([[0.0, 50.0, 200.0], np.linspace(1_000.0, 1.1 * well, 14)])
    rows = [
        pair_statistics(*(sensor(gain, read, well, level, rng, side) for _ in range(2))) for level in levels
    ]
    mean, variance, pixels = np.array(rows).T
    return photon_transfer(mean, variance, pixels, DARK)


@pytest.mark.parametrize(("gain", "read"), [(2.0, 12.0), (5.0, 20.0), (0.8, 6.0), (10.0, 30.0)])
def test_gain_read_noise_and_full_well_are_those_of_the_sensor(gain: float, read: float) -> None:
    found = curve(gain, read, seed=3)
    assert found.gain == pytest.approx(gain, rel=0.02)
    assert found.read_noise == pytest.approx(read, rel=0.02)
    # Between the last level that does not clip and the first that does.
    assert found.full_well == pytest.approx(40_000.0, rel=0.1)
    assert 0.2 < found.statistic < 3.0


def test_the_stated_sigmas_are_those_of_a_weighted_line() -> None:
    """Closed case: exact variances, of which each has the standard deviation √(2/n) of itself and 1/12."""
    signal, gain, read = np.linspace(300.0, 9_000.0, 8), 3.0, 15.0
    pixels = np.geomspace(1e4, 1e6, 8)
    for offset in ((read / gain) ** 2, -5.0):
        variance = offset + signal / gain
        found = photon_transfer(DARK + signal, variance + 1.0 / 12.0, pixels, DARK)
        weight = 1.0 / ((variance + 1.0 / 12.0) * np.sqrt(2.0 / pixels))
        _, covariance = np.polyfit(signal, variance, 1, w=weight, cov="unscaled")
        of_slope, of_offset = np.sqrt(np.diagonal(covariance))
        assert found.gain == pytest.approx(gain)
        assert found.sigma_gain == pytest.approx(gain**2 * of_slope)
        if offset > 0.0:
            by = np.array([-read * gain, gain**2 / (2.0 * read)])
            assert found.read_noise == pytest.approx(read)
            assert found.sigma_read_noise == pytest.approx(np.sqrt(by @ covariance @ by))
        else:  # it may be as large as its σ
            assert found.read_noise == 0.0
            assert found.sigma_read_noise == pytest.approx(gain * np.sqrt(of_offset))


def test_the_stated_sigmas_are_those_of_the_scatter() -> None:
    # The ratio does not depend on the number of pixels.
    found = [curve(3.0, 15.0, seed, side=25) for seed in range(60)]
    for values, stated in (
        ([one.gain for one in found], [one.sigma_gain for one in found]),
        ([one.read_noise for one in found], [one.sigma_read_noise for one in found]),
    ):
        ratio = np.std(values, ddof=1) / np.sqrt(np.mean(np.square(stated)))
        # 60 values know their standard deviation to 9 %.
        assert 0.7 < ratio < 1.3


@pytest.mark.parametrize("quantised", [True, False])
def test_the_sigma_of_a_read_noise_below_the_rounding_is_that_of_the_scatter(quantised: bool) -> None:
    """400 values know their standard deviation to 3.5 %; without the part of the rounding it is 25 % off."""
    random, pixels, signal = np.random.default_rng(5), 250.0**2, np.array([0.0, 200.0, 2e3, 6e3, 1e4])
    true = 0.5**2 + signal / 4.0 + (1.0 / 12.0 if quantised else 0.0)
    variance = true * (1.0 + np.sqrt(2.0 / pixels) * random.normal(size=(400, len(signal))))
    many = np.full(len(signal), pixels)
    found = [photon_transfer(signal, own, many, 0.0, quantised=quantised) for own in variance]
    values, stated = np.array([(one.read_noise, one.sigma_read_noise) for one in found]).T
    assert np.mean(values) == pytest.approx(2.0, rel=0.005)
    assert np.std(values, ddof=1) / np.sqrt(np.mean(stated**2)) == pytest.approx(1.0, abs=0.11)


def test_a_series_that_does_not_reach_the_full_well_states_none() -> None:
    rng = np.random.default_rng(1)
    rows = [
        pair_statistics(*(sensor(2.0, 10.0, 1e9, level, rng) for _ in range(2)))
        for level in (0, 1e3, 5e3, 2e4)
    ]
    assert photon_transfer(*np.array(rows).T, DARK).full_well is None


def test_what_no_line_goes_through_is_refused() -> None:
    with pytest.raises(ValueError, match="three levels"):
        photon_transfer(np.array([100.0, 200.0]), np.array([1.0, 2.0]), np.array([10.0, 10.0]), 90.0)


def test_a_straight_response_has_no_residuals_and_a_bent_one_its_bend() -> None:
    exposure = np.linspace(1.0, 10.0, 10)
    straight = linearity(exposure, 64.0 + 350.0 * exposure)
    assert straight.sensitivity == pytest.approx(350.0)
    assert straight.dark == pytest.approx(64.0)
    assert straight.largest < 1e-12
    bent = linearity(exposure, 64.0 + 350.0 * exposure - 2.0 * (exposure - 5.5) ** 2)
    assert bent.largest == pytest.approx(2.0 * (20.25 - 8.25) / 3500.0, rel=0.05)


def test_the_fall_off_is_that_of_the_lens() -> None:
    rows, columns, width, height = 40, 60, 6000.0, 4000.0
    y, x = np.meshgrid(
        (np.arange(rows) + 0.5) / rows - 0.5, (np.arange(columns) + 0.5) / columns - 0.5, indexing="ij"
    )
    radius = np.hypot(x * width, y * height) / (0.5 * np.hypot(width, height))
    light = 1.0 - 0.3 * radius**2 + 0.05 * radius**4
    found = light_fall_off(2500.0 * light, np.full((rows, columns), 100), width, height)
    np.testing.assert_allclose(found.coefficients, [-0.3, 0.05, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.cells, light, rtol=1e-9)
    assert found.largest < 1e-9
    dusty = light.copy()
    dusty[10, 20] *= 0.9
    assert light_fall_off(2500.0 * dusty, np.full((rows, columns), 100), width, height).largest > 0.08
