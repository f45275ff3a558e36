"""Whether predicted standard deviations are those of the errors.

The truth stays, the noise is drawn again, from exactly the model adjusted. The a-priori σ0 is 1, and the
seed of a run is its number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.parameters import BORESIGHT, GNSS_SHIFT
from adjust.simulate.block import simulate_block
from adjust.simulate.truth import BlockSpecification
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulation_input import block_specification
from tests.adjust.simulate.specifications import errors_of, small_specification, without_noise


@dataclass(frozen=True)
class Runs:
    """Pooled ratios √mean((error/σ)²) of empirical to predicted standard deviations, and χ² tests passed."""

    ratio: dict[str, float]
    passed: int


def _runs(specification: BlockSpecification, count: int) -> Runs:
    simulated = simulate_block(specification)
    squares: dict[str, list[float]] = {}
    passed = 0
    for seed in range(1000, 1000 + count):
        again = simulated.measured_again(seed)
        block = again.block((BORESIGHT, GNSS_SHIFT))
        result = adjust_block(block, again.observations(block))
        for name, values in errors_of(result, again.true_state()).normalized_squares.items():
            squares.setdefault(name, []).append(float(values.mean()))
        passed += result.test.passed
    return Runs({name: float(np.sqrt(np.mean(values))) for name, values in squares.items()}, passed)


def test_predicted_sigmas_are_those_of_thirty_runs_of_a_small_block() -> None:
    runs = _runs(small_specification(), 30)
    for name, ratio in runs.ratio.items():
        assert 0.9 < ratio < 1.1, (name, ratio)
    # 95 % of 30 runs; fewer than 24 or more would happen once in 5,000 times.
    assert runs.passed >= stats.binom.ppf(2e-4, 30, 0.95)


def test_the_low_flight_of_the_test_field_gives_its_truth_back_without_noise() -> None:
    specification = without_noise(block_specification(load_simulation("uce-low")))
    simulated = simulate_block(specification)
    assert len(simulated.truth.plan.images) == 200
    assert len(simulated.truth.points) == pytest.approx(5300, rel=0.01)
    assert len(simulated.truth.surveyed) == 84
    block = simulated.block((BORESIGHT, GNSS_SHIFT))
    errors = errors_of(adjust_block(block, simulated.observations(block)), simulated.true_state())
    assert np.abs(errors.positions).max() < 1e-6
    assert np.abs(errors.attitudes).max() < 1e-9


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_predicted_sigmas_are_those_of_a_hundred_runs_of_the_low_flight() -> None:
    runs = _runs(block_specification(load_simulation("uce-low")), 100)
    for name, ratio in runs.ratio.items():
        assert 0.95 < ratio < 1.05, (name, ratio)
    assert 88 <= runs.passed <= 99
