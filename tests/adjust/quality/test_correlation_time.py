"""Correlation times: the most likely one is found, with an honest interval, and said when there is none."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.least_squares import Adjusted, Adjuster
from adjust.observations.base import CorrelatedOverTime, StochasticModel
from adjust.observations.gauss_markov import GaussMarkov
from adjust.observations.joint_prior import JointPrior
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, ConsideredParameters, ParameterPlace, State
from adjust.quality.cofactor import cofactor
from adjust.quality.correlation_time import (
    CorrelationTime,
    along_derivative,
    limits_of,
    score,
    seconds_of,
    stated_or_estimated,
    zeta_of,
)
from adjust.quality.observation_parts import correlations_of, parts_of
from adjust.quality.trace_matrix import trace_matrix
from adjust.quality.variance_components import PartSums
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import design_matrix, full_cofactor, full_covariance
from adjust.solve.gauss_newton import iterate
from adjust.solve.system import Observations, System
from tests.adjust.scenes import (
    DEGREE,
    Scene,
    two_strips,
    with_correlated_attitudes,
    with_rejected_positions,
)

GNSS, INS = 2, 3
FREE = {BORESIGHT: True, GNSS_SHIFT: True}


def with_times(observations: Observations, seconds: float, factor: float = 1.0) -> Observations:
    """Positions and attitudes stated with another correlation time and other σ."""
    others = tuple(
        group.rescaled(np.array(factor)).with_correlation_time(seconds)  # type: ignore[attr-defined]
        if isinstance(group, CorrelatedOverTime)
        else group
        for group in observations.others
    )
    return replace(observations, others=others)


def four_strips(seed: int, gnss_s: float, ins_s: float) -> Scene:
    """Sixty images, 15 exposures to a strip, 4 s apart."""
    return two_strips(
        strips=4,
        images_per_strip=15,
        points_along=24,
        points_across=8,
        control=("full",) * 6,
        free=FREE,
        noise_seed=seed,
        gnss_correlation_s=gnss_s,
        ins_correlation_s=ins_s,
    )


def estimated(scene: Scene, observations: Observations, **options: object) -> AdjustmentResult:
    return adjust_block(
        scene.block,
        observations,
        AdjustmentOptions(correlation_times=True, **options),  # type: ignore[arg-type]
    )


def small(rejected: tuple[int, ...] = ()) -> Scene:
    scene = with_correlated_attitudes(
        two_strips(
            images_per_strip=8, free=FREE, noise_seed=6, gnss_correlation_s=9.0, ins_correlation_s=25.0
        )
    )
    return with_rejected_positions(scene, rejected)


def restricted(system: System, state: State) -> Callable[[int, float], float]:
    """−2 log of the restricted likelihood of a group's correlation time, from matrices in full."""

    def value(group: int, seconds: float) -> float:
        others = list(system.observations.others)
        others[group - 1] = others[group - 1].with_correlation_time(seconds)  # type: ignore[attr-defined]
        its = replace(system, observations=replace(system.observations, others=tuple(others)))
        design = design_matrix(its, state)
        matrix = design.matrix.toarray()
        scale = np.sqrt(np.sum(matrix**2, axis=0))
        orthogonal, triangle = np.linalg.qr(matrix / scale)
        normal = 2.0 * float(np.sum(np.log(np.abs(np.diagonal(triangle)) * scale)))
        left = design.misclosure - orthogonal @ (orthogonal.T @ design.misclosure)
        model = others[group - 1].stochastic
        kept = np.flatnonzero(model.present.ravel())
        determinant = float(np.linalg.slogdet(full_covariance(model)[np.ix_(kept, kept)])[1])
        return determinant + normal + float(left @ left)

    return value


@pytest.mark.parametrize("rejected", [(), (3, 4, 9)])
def test_the_score_is_the_derivative_of_the_restricted_likelihood(rejected: tuple[int, ...]) -> None:
    scene = small(rejected)
    system = System.of(scene.block, scene.observations)
    solution = iterate(system, scene.block.approximate_state(), 20)
    likelihood = restricted(system, solution.state)
    quality = cofactor(system, solution)
    for number in (GNSS, INS):
        group = system.observations.groups[number]
        process = group.stochastic.over_time
        assert process is not None
        zeta, step = zeta_of(process, process.correlation_time), 1e-4
        beyond, below = (likelihood(number, seconds_of(process, zeta + change)) for change in (step, -step))
        found = score(system, solution.state, quality, group)
        # The derivative of −2 log is minus twice that of the logarithm.
        assert found == pytest.approx(-(beyond - below) / (2.0 * step), rel=1e-4, abs=1e-3), group.name


def test_the_score_leaves_out_what_errors_of_considered_parameters_explain() -> None:
    """The likelihood is that of an adjustment in which the parameters are observed."""
    scene, places = small(), tuple(ParameterPlace(BORESIGHT, 0, component) for component in range(3))
    known = ConsideredParameters(places, (0.01 * DEGREE) ** 2 * np.eye(3))
    system = tuple(
        replace(item, values=item.values + 0.01 * DEGREE, free=np.zeros_like(item.free))
        if item.family.name == BORESIGHT
        else item
        for item in scene.block.system
    )
    block = replace(scene.block, system=system, considered=known)
    adjusted = Adjuster(AdjustmentOptions()).adjust(
        System.of(block, scene.observations), block.approximate_state()
    )
    model = StochasticModel.from_covariance(known.covariance[None], np.ones((1, 3), dtype=bool))
    (given,) = (item.values[:1] for item in system if item.family.name == BORESIGHT)
    prior = JointPrior("C", ("roll", "pitch", "yaw"), ("rad",) * 3, places, given, model)
    observed = Observations(scene.observations.image_points, (*scene.observations.others, prior))
    free = tuple(
        replace(item, free=np.ones_like(item.free)) if item.family.name == BORESIGHT else item
        for item in system
    )
    likelihood = restricted(System.of(replace(block, system=free, considered=None), observed), adjusted.state)
    group = scene.observations.groups[INS]
    process = group.stochastic.over_time
    assert process is not None
    zeta, step = zeta_of(process, process.correlation_time), 1e-4
    beyond, below = (likelihood(INS, seconds_of(process, zeta + change)) for change in (step, -step))
    found = score(adjusted.system, adjusted.state, adjusted.quality, group)
    assert found == pytest.approx(-(beyond - below) / (2.0 * step), rel=1e-4, abs=1e-3)


def test_shared_information_is_that_of_the_full_matrices() -> None:
    scene = small((3, 4, 9))
    system = System.of(scene.block, scene.observations)
    solution = iterate(system, scene.block.approximate_state(), 20)
    design = design_matrix(system, solution.state)
    groups = system.observations.groups
    used = np.concatenate([group.stochastic.present.ravel() for group in groups])
    kept = np.flatnonzero(used)
    rows = design.matrix.toarray()[kept]
    remainder = np.eye(len(kept)) - rows @ full_cofactor(design) @ rows.T
    parts = tuple(
        part
        for part in (*parts_of(system.observations), *correlations_of(system.observations))
        if part.group in (GNSS, INS)
    )
    derivatives = [np.zeros((len(used), len(used))) for _ in parts]
    for matrix, part in zip(derivatives, parts, strict=True):
        first, last = design.row_start[part.group], design.row_start[part.group + 1]
        model = groups[part.group].stochastic
        n, m = model.present.shape
        columns = list(part.components)
        for unit in range(last - first):
            vector = np.zeros((n, m))
            vector.ravel()[unit] = 1.0
            if part.is_correlation:
                value = along_derivative(model, np.where(model.present, vector, 0.0))
            else:
                value = np.zeros((n, m))
                value[:, columns] = vector[:, columns]
            matrix[first:last, first + unit] = value.ravel()
        np.testing.assert_allclose(matrix, matrix.T, atol=1e-9)
    products = [remainder @ matrix[np.ix_(kept, kept)] for matrix in derivatives]
    exact = np.array([[np.sum(one * other.T) for other in products] for one in products])
    redundancy = PartSums.of(Adjusted(system, solution, ()), parts).redundancy
    # Strips are sorted in time here, so our whitened rows are those of Cholesky's factor.
    probed = trace_matrix(system, solution, parts, redundancy)
    size = np.sqrt(np.outer(np.diagonal(exact), np.diagonal(exact)))
    assert np.abs((probed - exact) / size).max() < 0.12
    assert np.abs(exact[-2:, :-2] / size[-2:, :-2]).max() > 0.3, "σ and τ share information"


def test_with_known_sigmas_the_most_likely_correlation_time_is_found() -> None:
    scene = small()
    result = estimated(scene, with_times(scene.observations, 60.0))
    observations = with_times(scene.observations, 60.0)
    others = list(observations.others)
    for item in result.correlation_times:
        others[item.group - 1] = others[item.group - 1].with_correlation_time(item.seconds)  # type: ignore[attr-defined]
    system = System.of(scene.block, replace(observations, others=tuple(others)))
    likelihood = restricted(system, result.state)
    for item in result.correlation_times:
        best = optimize.minimize_scalar(
            lambda log_seconds, group=item.group: likelihood(group, float(np.exp(log_seconds))),
            bounds=(np.log(1.0), np.log(1000.0)),
            method="bounded",
        )
        assert item.seconds == pytest.approx(float(np.exp(best.x)), rel=0.02), item.name
        assert item.verdict == "estimated"
        assert item.lower < item.seconds < item.upper
        # The curvature of −2 log L is twice the information of ζ, whose inverse is the variance.
        process = others[item.group - 1].stochastic.over_time
        assert process is not None
        zeta, step = zeta_of(process, item.seconds), 0.02
        before, here, after = (
            likelihood(item.group, seconds_of(process, zeta + change)) for change in (-step, 0.0, step)
        )
        variance = 2.0 * step**2 / (before - 2.0 * here + after)
        confidence = AdjustmentOptions().confidence
        expected = stated_or_estimated(item.group, item.name, process, item.redundancy, variance, confidence)
        assert (item.lower, item.upper) == pytest.approx((expected.lower, expected.upper), rel=0.1)
    # Nothing else was asked for.
    assert result.variance_components == ()


@functools.cache
def together(seed: int, seconds: float, factor: float) -> AdjustmentResult:
    """Estimated correlation times of 12 s and 30 s, with the σ, from others."""
    scene = four_strips(seed, gnss_s=12.0, ins_s=30.0)
    return estimated(scene, with_times(scene.observations, seconds, factor), variance_components=True)


@pytest.mark.parametrize(("seed", "seconds"), [(2, 200.0), pytest.param(1, 60.0, marks=pytest.mark.slow)])
def test_correlation_times_and_sigmas_are_found_together_from_wrong_ones(seed: int, seconds: float) -> None:
    result = together(seed, seconds, 2.0)
    assert result.test.sigma0 == pytest.approx(1.0, abs=0.02)
    times = {item.name: item for item in result.correlation_times}
    for name, truth in (("gnss_positions", 12.0), ("ins_attitudes", 30.0)):
        item = times[name]
        assert item.verdict == "estimated"
        assert item.lower < truth < item.upper, (name, item)
        assert item.upper / item.lower < 12.0, "the interval says something"
    for component in result.variance_components:
        if component.part.group in (GNSS, INS):
            assert component.lower < 0.5 < component.upper, component
            # σ and τ borrow from each other: far fewer degrees of freedom than the redundancy.
            assert component.degrees_of_freedom < 0.7 * component.redundancy


@pytest.mark.slow
def test_the_start_has_no_influence_on_what_is_found() -> None:
    one, other = together(2, 4.0, 1.0), together(2, 200.0, 2.0)
    for first, second in zip(one.correlation_times, other.correlation_times, strict=True):
        assert second.seconds == pytest.approx(first.seconds, rel=0.05), first.name
    for a, b in zip(one.variance_components, other.variance_components, strict=True):
        if a.estimated:
            assert b.sigma == pytest.approx(a.sigma, rel=0.03), a.part.name


def test_white_errors_are_found_to_be_white() -> None:
    scene = four_strips(4, gnss_s=1e-3, ins_s=1e-3)
    result = estimated(scene, with_times(scene.observations, 20.0), variance_components=True)
    for item in result.correlation_times:
        assert item.verdict == "none", item
        assert item.lower == 0.0
        assert item.upper < 6.0, item
    for component in result.variance_components:
        if component.part.group in (GNSS, INS):
            assert component.lower < 1.0 < component.upper


def test_errors_that_outlast_the_strips_do_not_tell_how_long_they_last() -> None:
    scene = four_strips(5, gnss_s=5000.0, ins_s=5000.0)
    result = estimated(scene, with_times(scene.observations, 60.0), variance_components=True)
    for item in result.correlation_times:
        assert item.verdict == "longer", item
        assert item.upper == np.inf
        assert item.lower > 20.0, item


def test_what_has_no_redundancy_or_no_successors_keeps_what_was_stated() -> None:
    scene = two_strips(
        strips=2, images_per_strip=2, control=(), gnss_correlation_s=12.0, ins_correlation_s=30.0
    )
    result = estimated(scene, scene.observations)
    for item, stated in zip(result.correlation_times, (12.0, 30.0), strict=True):
        assert item.redundancy < 10.0
        assert (item.seconds, item.verdict) == (stated, "stated")
        assert np.isnan([item.lower, item.upper]).all()


def test_exposures_of_which_none_follows_another_keep_what_was_stated() -> None:
    scene = two_strips(images_per_strip=10, points_along=20, free=FREE, noise_seed=6, ins_correlation_s=30.0)
    *rest, ins = scene.observations.others
    n = len(scene.block.images)
    alone = StochasticModel.from_sigma(ins.stochastic.sigma).correlated(
        GaussMarkov(np.arange(n), np.zeros(n), 30.0)
    )
    others = (*rest, replace(ins, stochastic=alone))  # type: ignore[type-var]
    result = estimated(scene, replace(scene.observations, others=others), variance_components=True)
    (time,) = result.correlation_times
    assert time.redundancy > 10.0
    assert (time.seconds, time.verdict) == (30.0, "stated")
    assert any(item.estimated for item in result.variance_components if item.part.group == INS)


def test_gross_errors_and_correlation_are_told_apart() -> None:
    scene = four_strips(6, gnss_s=12.0, ins_s=30.0)
    others = list(scene.observations.others)
    gnss = others[GNSS - 1]
    observed = gnss.observed.copy()  # type: ignore[attr-defined]
    wrong = (7, 22, 23, 50)
    observed[list(wrong)] += 3.0
    others[GNSS - 1] = replace(gnss, observed=observed)  # type: ignore[type-var]
    damaged = with_times(replace(scene.observations, others=tuple(others)), 40.0)
    result = estimated(scene, damaged, variance_components=True, critical_value=4.13)
    rejected = np.flatnonzero(np.isnan(result.groups[GNSS].redundancy).all(axis=1))
    assert set(wrong) <= set(rejected)
    assert len(rejected) <= len(wrong) + 1
    times: dict[str, CorrelationTime] = {item.name: item for item in result.correlation_times}
    assert times["gnss_positions"].lower < 12.0 < times["gnss_positions"].upper


def test_limits_are_where_the_estimate_would_just_be_compatible() -> None:
    """Pairs of exposures say the same of ζ whatever it is; long strips the less the longer errors last."""
    pairs = GaussMarkov(np.repeat(np.arange(50), 2), np.tile([0.0, 4.0], 50), 6.0)
    found = stated_or_estimated(2, "gnss_positions", pairs, 90.0, 0.02**2, 0.95)
    zeta = zeta_of(pairs, 6.0)
    for limit, sign in ((found.lower, -1.0), (found.upper, 1.0)):
        assert zeta_of(pairs, limit) == pytest.approx(zeta + sign * 1.96 * 0.02, abs=2e-3)
    strip = GaussMarkov(np.zeros(100, dtype=np.int64), 4.0 * np.arange(100), 40.0)
    found = stated_or_estimated(2, "gnss_positions", strip, 90.0, 0.15**2, 0.95)
    below = zeta_of(strip, 40.0) - zeta_of(strip, found.lower)
    above = zeta_of(strip, found.upper) - zeta_of(strip, 40.0)
    assert below < 1.96 * 0.15 < above
    assert found.verdict == "estimated"


@pytest.mark.parametrize(
    ("seconds", "sigma", "verdict"),
    [
        (1.5, 0.1, "none"),
        (20.0, 0.1, "estimated"),
        (1000.0, 0.3, "longer"),
        (8.0, 2.0, "undetermined"),
        (8.0, np.nan, "stated"),
    ],
)
def test_what_the_limits_leave_open_is_said(seconds: float, sigma: float, verdict: str) -> None:
    strip = GaussMarkov(np.zeros(40, dtype=np.int64), 4.0 * np.arange(40), seconds)
    found = stated_or_estimated(2, "gnss_positions", strip, 90.0, sigma**2, 0.95)
    assert found.verdict == verdict
    assert (found.lower == 0.0) == (verdict in ("none", "undetermined"))
    assert (found.upper == np.inf) == (verdict in ("longer", "undetermined"))


def test_zeta_and_correlation_time_say_the_same_within_the_limits() -> None:
    process = GaussMarkov(np.zeros(20, dtype=np.int64), 4.0 * np.arange(20), 10.0)
    lower, upper = limits_of(process)
    values: Floats = np.linspace(lower, upper, 9)
    seconds = np.array([seconds_of(process, float(value)) for value in values])
    assert (np.diff(seconds) > 0.0).all()
    np.testing.assert_allclose([zeta_of(process, float(value)) for value in seconds], values, rtol=1e-9)
    assert seconds[0] == pytest.approx(4.0 / np.log(100.0))
    assert seconds[-1] == pytest.approx(10.0 * 76.0)
    assert zeta_of(process, 1e-6) == lower
    assert seconds_of(process, -0.1) == 0.0
