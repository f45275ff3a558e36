"""Simulated gross errors: how many are found, how many good observations are lost, and the power.

An error is *large* above 1.5 times the minimal detectable bias in its own direction. It is *found* when its
observation is rejected or its object point is given up and named. Good image points are *lost* when
they are rejected themselves, or given up with a point in which nothing is wrong; those that go with a
point of whose rays one is wrong, but which one cannot be told, are counted apart.
"""

from __future__ import annotations

import gc
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.least_squares import Adjusted
from adjust.options import AdjustmentOptions
from adjust.quality.detectability import NON_CENTRALITY
from adjust.result import AdjustmentResult, ObservationStatus
from adjust.simulate.block import SimulatedBlock, measure, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.gross_errors import GrossErrorSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.gauss_newton import Iteration
from adjust.solve.system import System
from tests.adjust.scenes import two_strips
from tests.adjust.simulate.specifications import CAMERA, HEIGHT, small_specification

FREE = ("boresight", "gnss_shift")
CRITICAL = 3.29


@dataclass
class Score:
    """Counts over the trials."""

    large: int = 0
    found: int = 0
    large_of_four_rays: int = 0
    found_of_four_rays: int = 0
    good: int = 0
    lost: int = 0
    gone_with_a_wrong_one: int = 0
    swapped: int = 0
    swapped_found: int = 0
    control_lost: int = 0
    wrong_positions: int = 0
    wrong_positions_found: int = 0
    positions: int = 0
    positions_lost: int = 0


@cache
def eighty_images(rate: float) -> SimulatedBlock:
    """Eight crossing lines; rays are missing, so that points have two to nine; two swapped control points and
    a strip whose time is wrong by a second."""
    base, spacing = base_of(CAMERA, HEIGHT, 0.6), spacing_of(CAMERA, HEIGHT, 0.6)
    return simulate_block(
        small_specification(
            flight=(
                LineGroup("E", "1", 0, np.pi / 2, HEIGHT, (10,) * 6, base, spacing),
                LineGroup("N", "1", 0, 0.0, HEIGHT, (10,) * 2, base, spacing),
            ),
            points=PointSpecification(count=700, detection=0.7),
            survey=(SurveyLayout("grid", columns=4, rows=4),),
            gross_errors=GrossErrorSpecification(
                image_rate=rate, image_size=(10e-6, 80e-6), control_swaps=1, wrong_strips=1, time_error=1.0
            ),
        )
    )


@cache
def detectable(rate: float, seed: int) -> np.ndarray:
    """Minimal detectable bias of every wrong image point in the direction of its error, metres."""
    measured = eighty_images(rate).measured_again(seed)
    clean = replace(measured.specification, gross_errors=GrossErrorSpecification())
    without = replace(measured, measured=measure(clean, measured.truth, seed))
    block = without.block(FREE)
    result = adjust_block(block, without.observations(block))
    wrong = measured.measured.gross_errors
    remainder = np.eye(2) - result.cofactor.hat_of_rays[wrong.image_points][:, [0, 1, 1, 2]].reshape(-1, 2, 2)
    direction = wrong.displacement / np.linalg.norm(wrong.displacement, axis=1, keepdims=True)
    controlled = np.einsum("ni,nij,nj->n", direction, remainder, direction)
    return NON_CENTRALITY * clean.noise.image / np.sqrt(np.maximum(controlled, 1e-9))


def count(score: Score, measured: SimulatedBlock, result: AdjustmentResult, bias: np.ndarray) -> None:
    """Add one trial to the score."""
    wrong, truth = measured.measured.gross_errors, measured.truth
    status = result.groups[0].status
    rejected = (status == ObservationStatus.REJECTED).any(axis=1)
    out = rejected | (status == ObservationStatus.NOT_USED).all(axis=1)
    is_large = np.linalg.norm(wrong.displacement, axis=1) > 1.5 * bias
    has_four = np.bincount(truth.point)[truth.point][wrong.image_points] >= 4
    found = out[wrong.image_points]
    score.large += int(is_large.sum())
    score.found += int((is_large & found).sum())
    score.large_of_four_rays += int((is_large & has_four).sum())
    score.found_of_four_rays += int((is_large & has_four & found).sum())
    is_good = np.ones(len(truth.point), dtype=bool)
    is_good[wrong.image_points] = False
    is_spoilt = np.isin(truth.point, truth.point[wrong.image_points])
    score.good += int(is_good.sum())
    score.lost += int((is_good & (rejected | (out & ~is_spoilt))).sum())
    score.gone_with_a_wrong_one += int((is_good & out & ~rejected & is_spoilt).sum())

    def taken(group: int) -> np.ndarray:
        return np.asarray((result.groups[group].status == ObservationStatus.REJECTED).any(axis=1))

    is_swapped = np.isin(result.groups[1].group.point, truth.surveyed[wrong.swapped.ravel()])
    score.swapped += int(is_swapped.sum())
    score.swapped_found += int(taken(1)[is_swapped].sum())
    score.control_lost += int(taken(1)[~is_swapped].sum())
    in_strip = np.isin(truth.plan.strip, wrong.strips)
    score.wrong_positions += int(in_strip.sum())
    score.wrong_positions_found += int(taken(2)[in_strip].sum())
    score.positions += int((~in_strip).sum())
    score.positions_lost += int(taken(2)[~in_strip].sum())


def scored(rate: float, trials: range, **options: Any) -> Score:
    score, simulated = Score(), eighty_images(rate)
    for seed in trials:
        measured = simulated.measured_again(seed)
        block = measured.block(FREE)
        chosen = AdjustmentOptions(critical_value=CRITICAL, **options)
        result = adjust_block(block, measured.observations(block), chosen)
        count(score, measured, result, detectable(rate, seed))
    return score


def assert_as_promised(score: Score) -> None:
    assert score.found >= 0.95 * score.large
    assert score.found_of_four_rays >= 0.985 * score.large_of_four_rays
    assert score.lost <= 0.005 * score.good
    assert score.swapped_found == score.swapped > 0
    assert score.wrong_positions_found == score.wrong_positions > 0
    assert score.positions_lost <= 0.01 * score.positions


@pytest.mark.parametrize("rate", [pytest.param(0.01, marks=pytest.mark.slow), 0.03])
def test_gross_errors_of_every_kind_are_found_together(rate: float) -> None:
    assert_as_promised(scored(rate, range(2), test="observations"))


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.01, 0.03])
def test_gross_errors_of_every_kind_are_found_in_many_blocks(rate: float) -> None:
    score = scored(rate, range(25), test="observations")
    assert_as_promised(score)
    assert score.large > 700
    assert score.gone_with_a_wrong_one <= 0.15 * rate * score.good


# Daily one whose weights vanish; that each leaves clean blocks alone is daily, too.
@pytest.mark.parametrize(
    "robust",
    [
        "tukey",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("huber", "cauchy", "biber", "danish")),
    ],
)
def test_a_robust_estimation_beforehand_finds_them_too(robust: Any) -> None:
    score = scored(0.03, range(1), test="observations", robust=robust)
    assert score.found >= 0.95 * score.large
    assert score.found_of_four_rays >= 0.985 * score.large_of_four_rays
    assert score.swapped_found == score.swapped
    assert score.wrong_positions_found == score.wrong_positions
    # More of what is good goes than without: that is why it is no default.
    assert score.lost <= 0.02 * score.good


def test_robust_estimation_leaves_clean_blocks_alone() -> None:
    scene = two_strips(noise_seed=8)
    ordinary = adjust_block(scene.block, scene.observations)
    for robust in ("huber", "cauchy", "tukey", "biber", "danish"):
        options = AdjustmentOptions(critical_value=4.5, robust=robust)  # type: ignore[arg-type]
        result = adjust_block(scene.block, scene.observations, options)
        assert sum(group.rejected for group in result.groups) == 0, robust
        np.testing.assert_allclose(result.state.object_point, ordinary.state.object_point, atol=1e-4)


def test_wrong_sigmas_call_for_the_tau_test() -> None:
    """All σ four times too small: with σ0 = 1 half the block goes, with σ0 from the residuals nothing."""
    scene = two_strips(noise_seed=8, control=())
    observations = replace(
        scene.observations,
        image_points=scene.observations.image_points.rescaled(np.array(0.25)),
        others=tuple(group.rescaled(np.array(0.25)) for group in scene.observations.others),
    )
    tau = AdjustmentOptions(critical_value=4.5, reference_variance="a_posteriori")
    result = adjust_block(scene.block, observations, tau)
    assert sum(group.rejected for group in result.groups) == 0
    trusted = adjust_block(scene.block, observations, AdjustmentOptions(critical_value=4.5))
    assert sum(group.rejected for group in trusted.groups) > 20


def test_an_error_of_the_detectable_size_is_found_four_times_in_five() -> None:
    """5,000 trials: one biased image coordinate each, the noise of all observations drawn anew."""
    scene = two_strips()
    result = adjust_block(scene.block, scene.observations)
    system = System.of(scene.block, scene.observations)
    design = design_matrix(system, result.state)
    matrix = design.matrix.toarray()
    remainder = np.eye(len(matrix)) - matrix @ full_cofactor(design) @ matrix.T
    used = np.concatenate([group.stochastic.present.ravel() for group in scene.observations.groups])
    group = result.groups[0]
    testable = np.flatnonzero(group.redundancy.ravel() >= 0.1)
    random = np.random.default_rng(7)
    trials = 5_000
    chosen = random.choice(testable, trials)
    noise = np.where(used, random.normal(size=(trials, len(used))), 0.0)
    bias = (group.detectable / group.sigma).ravel()[chosen]
    noise[np.arange(trials), chosen] += bias * random.choice((-1.0, 1.0), trials)
    residual = np.einsum("tn,tn->t", remainder[chosen], noise)
    w = residual / np.sqrt(group.redundancy.ravel()[chosen])
    found = np.mean(np.abs(w) > stats.norm.isf(0.0005))
    assert found == pytest.approx(0.80, abs=0.02)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_power_holds_in_whole_adjustments() -> None:
    """The same with 5,000 adjustments: noise and bias in the observations, w as reported."""
    nominal = two_strips()
    clean = adjust_block(nominal.block, nominal.observations).groups[0]
    testable = np.argwhere(clean.redundancy >= 0.1)
    random = np.random.default_rng(8)
    found, trials = 0, 5_000
    for seed in range(trials):
        scene = two_strips(noise_seed=seed)
        rays = scene.observations.image_points
        ray, component = testable[random.integers(len(testable))]
        xy = rays.xy.copy()
        xy[ray, component] += clean.detectable[ray, component] * random.choice((-1.0, 1.0))
        observations = replace(scene.observations, image_points=replace(rays, xy=xy))
        result = adjust_block(scene.block, observations, AdjustmentOptions(threads=1))
        found += bool(abs(result.groups[0].standardized[ray, component]) > stats.norm.isf(0.0005))
    assert found / trials == pytest.approx(0.80, abs=0.02)


def test_external_reliability_bounds_what_an_undetected_error_does() -> None:
    """A bias of the detectable size moves every unknown by at most δ̄ of its standard deviation."""
    scene = two_strips()
    clean = adjust_block(scene.block, scene.observations)
    rays = scene.observations.image_points
    sigma = np.sqrt(np.diagonal(clean.cofactor.of_points, axis1=1, axis2=2))
    group = clean.groups[0]
    np.testing.assert_allclose(
        group.external,
        NON_CENTRALITY * np.sqrt((1.0 - group.redundancy) / group.redundancy),
        rtol=1e-6,
    )
    for ray in np.flatnonzero((group.redundancy > 0.2).all(axis=1))[::23]:
        xy = rays.xy.copy()
        xy[ray, 0] += group.detectable[ray, 0]
        biased = adjust_block(scene.block, replace(scene.observations, image_points=replace(rays, xy=xy)))
        moved = np.abs(biased.state.object_point - clean.state.object_point) / sigma
        assert moved.max() <= group.external[ray, 0] * 1.01
        assert moved.max() >= 0.3 * group.external[ray, 0], "the bound is of the right size"


def test_the_passes_before_the_last_are_not_kept_in_memory() -> None:
    scene = two_strips()
    rays = scene.observations.image_points
    xy = rays.xy.copy()
    xy[[3, 40], 0] += np.array([1e-3, 1e-4])
    observations = replace(scene.observations, image_points=replace(rays, xy=xy))
    alive = list[int]()

    def count_adjustments(_: Iteration) -> None:
        alive.append(sum(isinstance(item, Adjusted) for item in gc.get_objects()))

    before = sum(isinstance(item, Adjusted) for item in gc.get_objects())
    result = adjust_block(
        scene.block, observations, AdjustmentOptions(critical_value=CRITICAL), count_adjustments
    )
    assert len(result.rejected_per_pass) > 1
    assert alive[-1] - before <= 2  # the one a pass begins with, and the one it has just made
