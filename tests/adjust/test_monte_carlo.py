"""Whether the stated standard deviations are those of the errors: many small blocks with noise.

The seed of a trial is its number. Sixty trials of a block with about 240 unknowns pin the pooled variances
to 4 %, two hundred in the slow tests to 2 %; all limits are two-sided with a false-alarm rate of 0.1 %.
Bands that were chosen for two hundred trials are wider for fewer, by the root of the ratio.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION, LEVER_ARM
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import design_matrix, full_normals
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips

FEW, MANY = 60, 200
FALSE_ALARM = 1e-3
FREE = {
    BORESIGHT: True,
    LEVER_ARM: [[True, True, False]],
    INTERIOR_ORIENTATION: [[True, False, False]],
}


@dataclass(frozen=True, eq=False)
class Trials:
    """What is collected over the trials."""

    number: int
    estimation_error_squared: Floats
    weighted_squares: Floats
    passed: int
    standardized: Floats
    normalized_errors: Floats
    unknowns: int
    redundancy: int

    def band(self, of_many: float) -> float:
        """The half width of a band that two hundred trials have to meet."""
        return of_many * float(np.sqrt(MANY / self.number))


def errors_of(scene: Scene, result: AdjustmentResult) -> Floats:
    """Estimated − true for every unknown, in the order of the design matrix."""
    state, truth = result.state, scene.truth
    small = rotation.log(np.swapaxes(truth.local_from_camera, 1, 2) @ state.local_from_camera)
    exposures = np.concatenate([state.projection_centre - truth.projection_centre, small], axis=1)
    border = np.zeros(result.layout.border)
    for name, columns in result.layout.columns.items():
        free = columns >= 0
        border[columns[free]] = (state.system[name] - truth.system[name])[free]
    return np.concatenate([exposures.ravel(), border, (state.object_point - truth.object_point).ravel()])


def variances_of(result: AdjustmentResult) -> Floats:
    """Predicted variances in the same order."""
    cofactor = result.cofactor
    return np.concatenate(
        [
            np.diagonal(cofactor.reduced.of_exposures, axis1=1, axis2=2).ravel(),
            np.diagonal(cofactor.reduced.corner),
            np.diagonal(cofactor.of_points, axis1=1, axis2=2).ravel(),
        ]
    )


@pytest.fixture(scope="module", params=[FEW, pytest.param(MANY, marks=pytest.mark.slow)])
def trials(request: pytest.FixtureRequest) -> Trials:
    squared, weighted, passed, standardized, normalized = [], [], 0, [], []
    for seed in range(request.param):
        scene = two_strips(free=FREE, distances=5, noise_seed=seed)
        result = adjust_block(scene.block, scene.observations)
        system = System.of(scene.block, scene.observations)
        normal, _ = full_normals(design_matrix(system, result.state))
        error = errors_of(scene, result)
        squared.append(error @ normal @ error)
        weighted.append(result.test.weighted_squares)
        passed += result.test.passed
        normalized.append(error / np.sqrt(variances_of(result)))
        all_w = np.concatenate([group.standardized.ravel() for group in result.groups])
        controlled = np.concatenate([group.redundancy.ravel() for group in result.groups]) > 0.1
        standardized.append(all_w[controlled])
    return Trials(
        request.param,
        np.array(squared),
        np.array(weighted),
        passed,
        np.concatenate(standardized),
        np.array(normalized),
        len(error),
        result.test.redundancy,
    )


def limits(degrees: int) -> tuple[float, float]:
    """Limits of a mean of χ² per degree of freedom."""
    low, high = stats.chi2.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], degrees) / degrees
    return float(low), float(high)


def test_errors_of_all_unknowns_together_have_the_stated_covariance(trials: Trials) -> None:
    degrees = trials.number * trials.unknowns
    low, high = limits(degrees)
    assert low < trials.estimation_error_squared.sum() / degrees < high
    assert 1.0 - trials.band(0.03) < low < high < 1.0 + trials.band(0.03), (
        "the limits are narrow enough to mean something"
    )


def test_every_single_unknown_has_the_stated_variance(trials: Trials) -> None:
    ratio = (trials.normalized_errors**2).mean(axis=0)
    # So many unknowns are tested at once that the alarm rate is shared among them.
    tail = 0.5 * FALSE_ALARM / trials.unknowns
    low, high = stats.chi2.ppf([tail, 1.0 - tail], trials.number) / trials.number
    assert low < ratio.min()
    assert ratio.max() < high
    assert ratio.mean() == pytest.approx(1.0, abs=trials.band(0.03))


def test_estimates_are_unbiased(trials: Trials) -> None:
    mean = trials.normalized_errors.mean(axis=0) * np.sqrt(trials.number)
    assert np.abs(mean).max() < stats.norm.isf(0.5 * FALSE_ALARM / trials.unknowns)


def test_weighted_squares_are_chi_square_with_the_redundancy(trials: Trials) -> None:
    degrees = trials.number * trials.redundancy
    low, high = limits(degrees)
    assert low < trials.weighted_squares.sum() / degrees < high


def test_the_global_test_passes_nineteen_times_in_twenty(trials: Trials) -> None:
    low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], trials.number, 0.95)
    assert low <= trials.passed <= high
    assert low > (0.95 - trials.band(0.1)) * trials.number


def test_standardized_residuals_are_standard_normal(trials: Trials) -> None:
    w = trials.standardized
    assert w.mean() == pytest.approx(0.0, abs=trials.band(0.02))
    assert w.std() == pytest.approx(1.0, abs=trials.band(0.02))
    # Correlated within a trial, hence the generous bands around 5 %, 1 % and 0.1 %.
    assert np.mean(np.abs(w) > 1.960) == pytest.approx(0.050, abs=trials.band(0.004))
    assert np.mean(np.abs(w) > 2.576) == pytest.approx(0.010, abs=trials.band(0.002))
    assert np.mean(np.abs(w) > 3.291) == pytest.approx(0.001, abs=trials.band(0.0005))
