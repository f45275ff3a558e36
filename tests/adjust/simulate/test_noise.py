from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.geometry import rotation
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.gross_errors import GrossErrorSpecification
from adjust.simulate.noise import NoiseSpecification, gnss_markov_noise, ins_markov_noise, white_noise
from adjust.simulate.random_streams import RandomStreams, Source
from adjust.simulate.system import SystemSpecification
from adjust.simulate.truth import BlockTruth
from tests.adjust.simulate.specifications import NOISE, small_specification

MARKOV = replace(NOISE, gnss_markov=(0.03, 0.03, 0.03), ins_markov=(4e-5, 5e-5, 6e-5))
PARTS = {
    Source.IMAGE_NOISE: "xy",
    Source.CONTROL_NOISE: "surveyed",
    Source.GNSS_WHITE: "positions",
    Source.GNSS_MARKOV: "positions",
    Source.INS_NOISE: "local_from_body",
    Source.INS_MARKOV: "local_from_body",
}


def _measured(noise: NoiseSpecification) -> SimulatedBlock:
    return simulate_block(small_specification(noise=noise))


def _same_truth(one: BlockTruth, other: BlockTruth) -> None:
    for name in ("projection_centre", "local_from_camera", "object_point"):
        np.testing.assert_array_equal(getattr(one.state, name), getattr(other.state, name))
    for name in ("image", "point", "xy", "surveyed"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for family, values in one.state.system.items():
        np.testing.assert_array_equal(values, other.state.system[family])


@pytest.mark.parametrize("source", list(PARTS))
def test_silencing_one_source_changes_nothing_else(source: Source) -> None:
    loud = _measured(MARKOV)
    silent = _measured(replace(MARKOV, silent=frozenset({source})))
    for name in ("xy", "surveyed", "positions", "local_from_body"):
        same = np.array_equal(getattr(loud.measured, name), getattr(silent.measured, name))
        assert same == (name != PARTS[source])
    _same_truth(loud.truth, silent.truth)


def test_silencing_one_of_two_sources_leaves_exactly_the_other() -> None:
    def error(*silent: Source) -> np.ndarray:
        noise = replace(MARKOV, silent=frozenset(silent))
        free = _measured(replace(MARKOV, level=0.0)).measured.positions
        return np.asarray(_measured(noise).measured.positions - free)

    both = error()
    one, other = error(Source.GNSS_WHITE), error(Source.GNSS_MARKOV)
    np.testing.assert_allclose(both, one + other, atol=1e-12)


def test_the_truth_does_not_depend_on_the_noise() -> None:
    calm = simulate_block(small_specification())
    wild = simulate_block(
        small_specification(
            noise=replace(MARKOV, image=9e-6, level=3.0),
            gross_errors=GrossErrorSpecification(image_rate=0.1, control_swaps=1, wrong_strips=1),
        )
    )
    _same_truth(calm.truth, wild.truth)


def test_strip_biases_are_drawn_apart_from_drifts() -> None:
    def system(**values: tuple[float, float, float]) -> SimulatedBlock:
        return simulate_block(small_specification(system=SystemSpecification(**values)))

    one = system(strip_bias=(0.03,) * 3).truth.state.system["gnss_strip_bias"]
    both = system(strip_bias=(0.03,) * 3, strip_drift=(1e-3,) * 3).truth.state.system
    np.testing.assert_array_equal(one, both["gnss_strip_bias"])
    assert np.corrcoef(one.ravel(), both["gnss_drift"].ravel())[0, 1] < 0.99


def test_the_same_seed_measures_the_same_and_another_seed_something_else() -> None:
    block = simulate_block(small_specification())
    again = simulate_block(small_specification())
    np.testing.assert_array_equal(block.measured.xy, again.measured.xy)
    other = block.measured_again(6)
    assert not np.array_equal(block.measured.xy, other.measured.xy)
    _same_truth(block.truth, other.truth)


def test_another_day_has_other_strip_errors_and_nothing_else_that_is_new() -> None:
    biased = SystemSpecification(strip_bias=(0.03, 0.02, 0.0), strip_drift=(0.0, 0.0, 1e-3))
    block = simulate_block(small_specification(system=biased))
    again, other = block.flown_again(5), block.flown_again(6)
    _same_truth(block.truth, again.truth)
    np.testing.assert_array_equal(again.measured.positions, block.measured.positions)
    one, two = block.truth.state.system, other.truth.state.system
    np.testing.assert_array_equal(one["gnss_strip_bias"][:, :2] != two["gnss_strip_bias"][:, :2], True)
    assert not two["gnss_strip_bias"][:, 2].any()
    np.testing.assert_array_equal(one["gnss_drift"][:, 2] != two["gnss_drift"][:, 2], True)
    # Only the positions know of strips.
    np.testing.assert_array_equal(other.measured.xy, block.measured_again(6).measured.xy)
    added = two["gnss_strip_bias"] - one["gnss_strip_bias"]
    moved = other.measured.positions - block.measured_again(6).measured.positions
    np.testing.assert_allclose(moved[:, :2], added[block.truth.plan.strip][:, :2], atol=1e-12)


def test_white_noise_has_its_standard_deviation() -> None:
    sigma = np.array([0.02, 0.5])
    noise = white_noise(NOISE, RandomStreams(1), Source.CONTROL_NOISE, sigma, 40_000)
    # σ of a standard deviation from 40,000 numbers is 0.35 %; five times that is allowed.
    np.testing.assert_allclose(noise.std(axis=0), sigma, rtol=0.018)
    np.testing.assert_allclose(noise.mean(axis=0) / sigma, 0.0, atol=0.025)


def test_attitude_noise_is_a_small_rotation_in_body_axes() -> None:
    block = _measured(NOISE)
    turned = np.swapaxes(block.measured.local_from_body, 1, 2) @ block.truth.trajectory.local_from_body
    expected = RandomStreams(5).of(Source.INS_NOISE).standard_normal((20, 3)) * NOISE.ins
    np.testing.assert_allclose(rotation.log(turned), expected, atol=1e-15)


def test_markov_noise_is_correlated_over_time_within_a_strip_only() -> None:
    step, tau = 10.0, 40.0
    noise = replace(MARKOV, gnss_markov=(1.0, 1.0, 1.0), gnss_correlation_time=tau)
    strips, length = 2000, 6
    strip = np.repeat(np.arange(strips), length)
    time = np.tile(np.arange(length) * step, strips)
    error = gnss_markov_noise(noise, RandomStreams(2), time, strip).reshape(strips, length, 3)
    np.testing.assert_allclose(error.std(axis=0), 1.0, rtol=0.08)
    for lag in (1, 3):
        found = np.mean(error[:, lag:] * error[:, :-lag])
        assert found == pytest.approx(np.exp(-lag * step / tau), abs=0.03)
    assert abs(np.mean(error[1:, 0] * error[:-1, -1])) < 0.06


def test_markov_noise_does_not_depend_on_the_order_of_the_exposures_in_time() -> None:
    time = np.array([30.0, 0.0, 10.0, 20.0])
    noise = gnss_markov_noise(MARKOV, RandomStreams(2), time, np.zeros(4, dtype=np.int64))
    white = RandomStreams(2).of(Source.GNSS_MARKOV).standard_normal((4, 3)) * 0.03
    factor = np.exp(-10.0 / 100.0)
    # The earliest is white; the next in time follows from it.
    np.testing.assert_allclose(noise[1], white[1])
    np.testing.assert_allclose(noise[2], factor * noise[1] + np.sqrt(1 - factor**2) * white[2])


def test_attitudes_have_a_correlated_part_of_their_own() -> None:
    noise = replace(MARKOV, ins_markov=(1.0, 2.0, 3.0), ins_correlation_time=20.0)
    time, strip = np.tile(10.0 * np.arange(2), 4000), np.repeat(np.arange(4000), 2)
    error = ins_markov_noise(noise, RandomStreams(2), time, strip).reshape(4000, 2, 3)
    np.testing.assert_allclose(error.std(axis=(0, 1)), [1.0, 2.0, 3.0], rtol=0.04)
    for component, sigma in enumerate((1.0, 2.0, 3.0)):
        found = np.mean(error[:, 0, component] * error[:, 1, component]) / sigma**2
        assert found == pytest.approx(np.exp(-0.5), abs=0.05)
    of_positions = gnss_markov_noise(noise, RandomStreams(2), time, strip).reshape(4000, 2, 3)
    assert abs(np.corrcoef(error[:, 0, 0], of_positions[:, 0, 0])[0, 1]) < 0.06


def test_stated_sigmas_contain_both_parts() -> None:
    np.testing.assert_allclose(MARKOV.stated_gnss, np.hypot([0.05, 0.05, 0.07], 0.03))
    np.testing.assert_allclose(MARKOV.stated_ins, np.hypot(NOISE.ins, [4e-5, 5e-5, 6e-5]))
