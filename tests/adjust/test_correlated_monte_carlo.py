"""Blocks whose GNSS and INS errors last for some exposures: who promises the errors that are really made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block, estimate_block
from adjust.arrays import Floats
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.object_points import PointSpecification
from tests.adjust.simulate.specifications import CAMERA, HEIGHT, NOISE, small_specification

FREE = (BORESIGHT, GNSS_SHIFT)
# Exposures are 3.6 s apart: errors last for four of them, and for eight.
TIMES: Mapping[str, float] = {GnssPositions.name: 15.0, InsAttitudes.name: 30.0}
NOTHING = (0.0, 0.0, 0.0)


def correlated_block(exposures: int = 12) -> SimulatedBlock:
    """Four lines of 12 exposures, two of them across, with nothing but correlated errors of GNSS and INS."""
    base, spacing = base_of(CAMERA, HEIGHT, 0.6), spacing_of(CAMERA, HEIGHT, 0.6)
    return simulate_block(
        small_specification(
            flight=(
                LineGroup("E", "1", 0, np.pi / 2, HEIGHT, (exposures,) * 2, base, spacing),
                LineGroup("N", "1", 0, 0.0, HEIGHT, (exposures,) * 2, base, spacing),
            ),
            points=PointSpecification(count=12 * exposures),
            noise=replace(
                NOISE,
                gnss=NOTHING,
                gnss_markov=NOISE.gnss,
                gnss_correlation_time=TIMES[GnssPositions.name],
                ins=NOTHING,
                ins_markov=NOISE.ins,
                ins_correlation_time=TIMES[InsAttitudes.name],
            ),
        )
    )


def system_errors(simulated: SimulatedBlock, times: Mapping[str, float] | None) -> Floats:
    """Estimated minus true boresight and shift, (6,)."""
    block = simulated.block(FREE)
    state = estimate_block(block, simulated.observations(block, correlation_times=times)).state
    truth = simulated.true_state()
    return np.concatenate([(state.system[name] - truth.system[name]).ravel() for name in FREE])


def predicted(simulated: SimulatedBlock, times: Mapping[str, float] | None) -> Floats:
    """Standard deviations of boresight and shift, (6,), for σ0 = 1."""
    block = simulated.block(FREE)
    result = adjust_block(block, simulated.observations(block, correlation_times=times))
    names = [name for name, *_ in result.layout.border_names()]
    assert names[0].startswith("boresight")
    return np.sqrt(np.diagonal(result.cofactor.reduced.corner))


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_with_the_right_correlation_boresight_and_shift_are_as_good_as_they_say() -> None:
    """400 blocks: 6 parameters pin the pooled ratio to 1.5 %, each of them to 3.5 %."""
    simulated, trials = correlated_block(), 400
    right, white = predicted(simulated, TIMES), predicted(simulated, None)
    errors_right, errors_white = [], []
    for seed in range(trials):
        measured = simulated.measured_again(seed)
        errors_right.append(system_errors(measured, TIMES))
        errors_white.append(system_errors(measured, None))
    empirical = np.sqrt(np.mean(np.square(errors_right), axis=0))
    empirical_white = np.sqrt(np.mean(np.square(errors_white), axis=0))
    ratio, ratio_white = empirical / right, empirical_white / white
    print("empirical / predicted, right:", np.round(ratio, 3), "white:", np.round(ratio_white, 3))
    print("sigma right / white:", np.round(right / white, 3))
    print("errors of white over those of right:", np.round(empirical_white / empirical, 3))
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.05)
    assert ratio.min() > 0.88
    assert ratio.max() < 1.12
    # Taken as independent the same errors promise far too much, and the estimates are worse, too.
    assert np.sqrt(np.mean(ratio_white**2)) > 1.5
    assert np.sqrt(np.mean((empirical_white / empirical) ** 2)) > 1.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_intervals_of_correlation_times_and_sigmas_hold_the_truth_as_often_as_they_say() -> None:
    """60 blocks from wrong σ and τ: misses of the 95 % intervals, each with a false-alarm rate of 0.1 %."""
    simulated, trials, confidence = correlated_block(20), 60, 0.95
    misses: dict[str, int] = {}
    logs: dict[str, list[float]] = {}
    rounds = []
    options = AdjustmentOptions(variance_components=True, correlation_times=True, confidence=confidence)
    for seed in range(trials):
        measured = simulated.measured_again(seed)
        block = measured.block(FREE)
        wrong = {name: 3.0 * seconds for name, seconds in TIMES.items()}
        observations = measured.observations(block, correlation_times=wrong)
        others = tuple(
            group.rescaled(np.array(2.0)) if group.name in TIMES else group for group in observations.others
        )
        result = adjust_block(block, replace(observations, others=others), options)
        rounds.append(result.reweighted)
        for item in result.correlation_times:
            inside = item.lower < TIMES[item.name] < item.upper
            misses[item.name] = misses.get(item.name, 0) + (not inside)
            logs.setdefault(item.name, []).append(float(np.log(item.seconds / TIMES[item.name])))
        for component in result.variance_components:
            name = component.part.name
            if name.split()[0] in TIMES:
                inside = component.lower < 0.5 < component.upper
                misses[name] = misses.get(name, 0) + (not inside)
                logs.setdefault(name, []).append(float(np.log(component.factor / 0.5)))
    print("rounds:", np.bincount(rounds).tolist())
    for name, count in misses.items():
        print(name, "misses", count, "median", np.exp(np.median(logs[name])), "sd log", np.std(logs[name]))
    for name, count in misses.items():
        assert count <= stats.binom.isf(1e-3, trials, 1.0 - confidence), name
        # The median of the estimates is the truth within its own uncertainty.
        assert abs(np.median(logs[name])) < 4.0 * np.std(logs[name]) / np.sqrt(trials), name
