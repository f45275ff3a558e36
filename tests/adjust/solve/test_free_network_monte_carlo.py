"""Whether the covariances of inner constraints are those of the errors: many free networks with noise.

The approximate values are off by metres, so the datum is, too. After a similarity transformation onto
the true object points the errors must have the covariance of inner constraints on object points. The seed
of a trial is its number; all limits are two-sided with a false-alarm rate of 0.1 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import design_matrix, full_normals
from adjust.solve.system import System
from tests.adjust.scenes import Scene, two_strips

pytestmark = pytest.mark.slow
TRIALS = 200
FALSE_ALARM = 1e-3


def onto_truth(state: State, truth: State) -> tuple[Floats, Floats, Floats]:
    """Centres, rotations and points after the similarity that fits the points best (Umeyama 1991)."""
    middle, true_middle = state.object_point.mean(axis=0), truth.object_point.mean(axis=0)
    centred, true_centred = state.object_point - middle, truth.object_point - true_middle
    u, sizes, v = np.linalg.svd(true_centred.T @ centred)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    scale = sizes @ [1.0, 1.0, np.linalg.det(u @ v)] / np.sum(centred**2)

    def moved(x: Floats) -> Floats:
        return true_middle + scale * (x - middle) @ turn.T

    return moved(state.projection_centre), turn @ state.local_from_camera, moved(state.object_point)


def errors_of(scene: Scene, result: AdjustmentResult) -> Floats:
    """Transformed − true for every unknown, in the order of the design matrix."""
    truth = scene.truth
    centres, turned, points = onto_truth(result.state, truth)
    small = rotation.log(np.swapaxes(truth.local_from_camera, 1, 2) @ turned)
    exposures = np.concatenate([centres - truth.projection_centre, small], axis=1)
    return np.concatenate([exposures.ravel(), (points - truth.object_point).ravel()])


def sigmas_of(result: AdjustmentResult) -> Floats:
    """Predicted standard deviations in the same order."""
    blocks = (result.cofactor.reduced.of_exposures, result.cofactor.of_points)
    return np.sqrt(np.concatenate([np.diagonal(item, axis1=1, axis2=2).ravel() for item in blocks]))


@dataclass(frozen=True, eq=False)
class Trials:
    """Errors over their σ (trials, u), eᵀ N e (trials,), vᵀPv (trials,), and r."""

    normalized: Floats
    squares: Floats
    weighted_squares: Floats
    redundancy: int


@pytest.fixture(scope="module")
def trials() -> Trials:
    normalized, squares, weighted = [], [], []
    for seed in range(TRIALS):
        scene = two_strips(control=(), gnss=False, ins=False, noise_seed=seed, start_seed=10_000 + seed)
        options = AdjustmentOptions(free_network="object_points")
        result = adjust_block(scene.block, scene.observations, options)
        error = errors_of(scene, result)
        system = System.of(scene.block, scene.observations)
        normal, _ = full_normals(design_matrix(system, scene.truth))
        normalized.append(error / sigmas_of(result))
        squares.append(error @ normal @ error)
        weighted.append(result.test.weighted_squares)
    return Trials(np.array(normalized), np.array(squares), np.array(weighted), result.test.redundancy)


def limits(degrees: int) -> tuple[float, float]:
    """Limits of a mean of χ² per degree of freedom."""
    low, high = stats.chi2.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], degrees) / degrees
    return float(low), float(high)


def test_errors_of_all_unknowns_together_have_seven_degrees_of_freedom_less(trials: Trials) -> None:
    degrees = TRIALS * (trials.normalized.shape[1] - 7)
    low, high = limits(degrees)
    assert low < trials.squares.sum() / degrees < high
    assert 0.97 < low < high < 1.03


def test_every_single_unknown_has_the_variance_of_the_inner_constraints(trials: Trials) -> None:
    ratio = (trials.normalized**2).mean(axis=0)
    tail = 0.5 * FALSE_ALARM / len(ratio)
    low, high = stats.chi2.ppf([tail, 1.0 - tail], TRIALS) / TRIALS
    assert low < ratio.min()
    assert ratio.max() < high
    assert ratio.mean() == pytest.approx(1.0, abs=0.03)


def test_weighted_squares_are_chi_square_with_seven_more_than_n_minus_u(trials: Trials) -> None:
    low, high = limits(TRIALS * trials.redundancy)
    assert low < trials.weighted_squares.mean() / trials.redundancy < high
