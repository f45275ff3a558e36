"""Redundancy, w and detectable bias with errors correlated over time, against matrices in full."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.least_squares import Adjusted, Adjuster
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, LEVER_ARM
from adjust.quality.cofactor import cofactor
from adjust.quality.detectability import NON_CENTRALITY
from adjust.quality.redundancy import group_residuals
from adjust.quality.rejection import SnoopingRule, reject
from adjust.quality.single_error import single_errors
from adjust.result import ObservationStatus
from adjust.solve.design_matrix import design_matrix, full_cofactor, full_covariance
from adjust.solve.gauss_newton import iterate
from adjust.solve.system import Observations, System
from tests.adjust.scenes import (
    DEGREE,
    MICROMETRE,
    Scene,
    two_strips,
    with_correlated_attitudes,
    with_rejected_positions,
)

GNSS, INS = 2, 3
CORRELATED = {"gnss_correlation_s": 12.0, "ins_correlation_s": 30.0}


def scene(rejected: tuple[int, ...] = (), **switches: object) -> Scene:
    """Fourteen images with correlated positions and attitudes, these also within themselves."""
    plan = {"images_per_strip": 7, "free": {BORESIGHT: True, GNSS_SHIFT: True}, "noise_seed": 5}
    found = with_correlated_attitudes(two_strips(**{**plan, **CORRELATED, **switches}))
    return with_rejected_positions(found, rejected)


@dataclass(frozen=True, eq=False)
class Full:
    """Matrices of a whole block: covariance Σ, P = Σ⁻¹, P Q_vv P and v over all scalars that take part."""

    kept: Floats
    start: Floats
    covariance: Floats
    weight: Floats
    scatter: Floats
    residual: Floats

    @classmethod
    def of(cls, system: System, at: object) -> Full:
        design = design_matrix(system, at)  # type: ignore[arg-type]
        groups = system.observations.groups
        used = np.concatenate([group.stochastic.present.ravel() for group in groups])
        kept = np.flatnonzero(used)
        covariance = scipy.linalg.block_diag(*(full_covariance(group.stochastic) for group in groups))
        covariance = covariance[np.ix_(kept, kept)]
        weight = np.linalg.inv(covariance)
        # Rows of A, not whitened: Σ's Cholesky factor takes the whitening away again, group by group.
        lower = np.linalg.cholesky(covariance)
        rows = lower @ design.matrix.toarray()[kept]
        residual = -lower @ design.misclosure[kept]
        scatter = weight - weight @ rows @ full_cofactor(design) @ rows.T @ weight
        return cls(kept, design.row_start, covariance, weight, scatter, residual)

    def rows_of(self, group: int) -> Floats:
        """Places among the kept scalars of a group."""
        inside = (self.kept >= self.start[group]) & (self.kept < self.start[group + 1])
        return np.flatnonzero(inside)

    def spread(self, group: int, values: Floats, shape: tuple[int, int]) -> Floats:
        """Values of the kept scalars (k,) of a group as (n, m), NaN elsewhere."""
        rows = self.rows_of(group)
        result = np.full(shape, np.nan)
        result.ravel()[self.kept[rows] - self.start[group]] = values[rows]
        return result


@pytest.mark.parametrize("rejected", [(), (0, 3, 4, 9)])
def test_w_and_detectable_bias_are_those_of_the_full_matrices(rejected: tuple[int, ...]) -> None:
    block = scene(rejected)
    system = System.of(block.block, block.observations)
    solution = iterate(system, block.block.approximate_state(), 20)
    found = group_residuals(system, solution.state, cofactor(system, solution))
    full = Full.of(system, solution.state)
    diagonal = np.diagonal(full.scatter)
    w = full.weight @ full.residual / np.sqrt(diagonal)
    r = np.einsum("ij,ji->i", full.covariance, full.scatter)
    for number in (GNSS, INS):
        shape = found[number].redundancy.shape
        for ours, theirs in (
            (found[number].redundancy, r),
            (found[number].detectable, NON_CENTRALITY / np.sqrt(diagonal)),
        ):
            expected = full.spread(number, theirs, shape)
            np.testing.assert_allclose(ours, expected, rtol=1e-9, atol=1e-9)
        # Misclosures are differences of coordinates: v itself is known to some 1e-9 times its σ.
        np.testing.assert_allclose(found[number].standardized, full.spread(number, w, shape), atol=1e-8)
    squares = full.residual @ full.weight @ full.residual
    assert sum(item.weighted_squares for item in found) == pytest.approx(squares, rel=1e-9)


def test_redundancy_numbers_add_up_to_the_redundancy_after_rejections() -> None:
    block = scene((0, 3, 4, 9))
    result = adjust_block(block.block, block.observations)
    total = sum(group.redundancy_sum for group in result.groups)
    assert total == pytest.approx(result.test.redundancy, abs=1e-6)


def test_a_vanishing_correlation_time_gives_the_white_adjustment() -> None:
    white, almost = (
        two_strips(free={BORESIGHT: True}, noise_seed=5, gnss_correlation_s=tau, ins_correlation_s=tau)
        for tau in (None, 1e-3)
    )
    # The noise of the second is drawn as correlated over a millisecond: the same numbers.
    one = adjust_block(white.block, white.observations)
    other = adjust_block(almost.block, almost.observations)
    np.testing.assert_allclose(other.state.object_point, one.state.object_point, rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(other.cofactor.reduced.corner, one.cofactor.reduced.corner, rtol=1e-12)
    for first, second in zip(one.groups, other.groups, strict=True):
        np.testing.assert_allclose(second.redundancy, first.redundancy, rtol=1e-12)
        np.testing.assert_allclose(second.standardized, first.standardized, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(second.detectable, first.detectable, rtol=1e-12)


def test_a_shift_found_from_known_orientations_has_the_variance_of_the_closed_form() -> None:
    """Of n positions 4 s apart each strip adds the information (n − (n − 2) φ)/((1 + φ) σ²)."""
    n, tau = 8, 20.0
    known = two_strips(
        images_per_strip=n,
        free={GNSS_SHIFT: True},
        gnss_correlation_s=tau,
        ins=False,
        points_along=20,
        control=("full",) * 12,
        sigma_image_m=1e-4 * MICROMETRE,
        sigma_control_m=1e-6,
    )
    result = adjust_block(known.block, known.observations)
    phi = np.exp(-4.0 / tau)
    expected = 0.05 / np.sqrt(2.0 * (n - (n - 2) * phi) / (1.0 + phi))
    sigma = np.sqrt(np.diagonal(result.cofactor.reduced.corner))
    np.testing.assert_allclose(sigma, expected * np.array([1.0, 1.0, 2.0]), rtol=1e-4)
    assert sigma[0] > 1.5 * 0.05 / np.sqrt(2 * n), "white noise would promise far too much"


def test_what_is_predicted_for_a_rejected_position_is_what_the_full_matrices_predict() -> None:
    """Best prediction from everything else, its neighbours' residuals among it, and its cofactor."""
    rejected = (0, 3, 4, 9)
    complete, left = scene(), scene(rejected)
    system = System.of(left.block, left.observations)
    solution = iterate(system, left.block.approximate_state(), 20)
    quality = cofactor(system, solution)
    given, used = complete.observations.others[GNSS - 1], left.observations.others[GNSS - 1]
    found = single_errors(
        given, given.linearize(solution.state), system.layout, quality, used.stochastic.taking_part
    )
    # In full: each of them by itself taken in, and deleted again by the formula.
    for row in rejected:
        others = tuple(other for other in rejected if other != row)
        with_it = scene(others)
        its_system = System.of(with_it.block, with_it.observations)
        full = Full.of(its_system, solution.state)
        place = np.flatnonzero(np.isin(full.kept - full.start[GNSS], 3 * row + np.arange(3)))
        place = place[np.isin(place, full.rows_of(GNSS))]
        scatter = full.scatter[np.ix_(place, place)]
        unwhitener = np.linalg.inv(given.stochastic.whitener[row])
        inside = unwhitener.T @ scatter @ unwhitener
        # Deleting an observation multiplies its pull by T_ii times the inverse of the cofactor.
        weight = found.weight[row]
        outside = weight * np.linalg.inv(inside) * weight
        np.testing.assert_allclose(outside, found.outside[row], rtol=1e-7, atol=1e-9)
        pull = unwhitener.T @ (full.scatter @ full.residual)[place]
        np.testing.assert_allclose(weight * np.linalg.solve(inside, pull), found.pull[row], rtol=1e-5)


def test_one_wrong_position_is_rejected_alone_though_it_pulls_its_neighbours() -> None:
    block = scene(gnss_correlation_s=200.0)
    result = adjust_block(block.block, block.observations)
    others = list(block.observations.others)
    gnss = others[GNSS - 1]
    observed = gnss.observed.copy()  # type: ignore[attr-defined]
    observed[10, 0] += 6.0 * result.groups[GNSS].detectable[10, 0]
    others[GNSS - 1] = replace(gnss, observed=observed)  # type: ignore[type-var]
    wrong = replace(block.observations, others=tuple(others))
    found = adjust_block(block.block, wrong, AdjustmentOptions(critical_value=4.13))
    rejected = np.isnan(found.groups[GNSS].redundancy).all(axis=1)
    assert np.flatnonzero(rejected).tolist() == [10]
    assert found.taken_back == 0
    # All figures are those of the block that never had it.
    without = adjust_block(block.block, with_rejected_positions(block, (10,)).observations)
    for name in ("detectable", "external", "redundancy"):
        ours, theirs = (getattr(item.groups[GNSS], name) for item in (found, without))
        np.testing.assert_allclose(ours, theirs, rtol=1e-3)


def test_a_pass_rejects_no_two_neighbours_of_a_strip() -> None:
    block = scene(gnss_correlation_s=200.0)
    others = list(block.observations.others)
    gnss = others[GNSS - 1]
    observed = gnss.observed.copy()  # type: ignore[attr-defined]
    observed[[9, 10], 0] += (3.0, -3.0)
    others[GNSS - 1] = replace(gnss, observed=observed)  # type: ignore[type-var]
    system = System.of(block.block, Observations(block.observations.image_points, tuple(others)))
    solution = iterate(system, block.block.approximate_state(), 20)
    adjusted = Adjusted(system, solution, (solution.iterations,))
    for test in ("components", "observations"):
        rejected = np.flatnonzero(reject(adjusted, SnoopingRule(4.13, test)).rejected[GNSS])  # type: ignore[arg-type]
        assert len(rejected) >= 1
        assert np.diff(rejected).min(initial=2) >= 2


def test_rejections_that_join_other_exposures_leave_correct_redundancy_numbers() -> None:
    """Without four successive positions those on either side are neighbours, with nothing seen from both."""
    block = scene(gnss_correlation_s=200.0)
    adjuster = Adjuster(AdjustmentOptions(critical_value=4.13))
    system = System.of(block.block, block.observations)
    before = adjuster.adjust(system, block.block.approximate_state())
    gnss = block.observations.others[GNSS - 1]
    gone = np.isin(gnss.event, [2, 3, 4, 5])
    rays = block.observations.image_points
    others = tuple(group.without(gone) if group is gnss else group for group in block.observations.others)
    left = Observations(rays.without(np.arange(len(rays.image)) % 50 == 0), others)
    found, expected = adjuster.with_other_rejections(before, left), adjuster.again(before, left)
    assert expected.system.blocking is not before.system.blocking, "other exposures are joined"
    for one, other in zip(found.residuals, expected.residuals, strict=True):
        np.testing.assert_allclose(one.control, other.control, atol=0.05)


def test_an_error_of_the_detectable_size_is_found_four_times_in_five() -> None:
    """5,000 trials: one biased position or attitude each, correlated noise of all observations drawn anew."""
    block = scene(sigma_gnss_m=0.2, sigma_ins_rad=0.02 * DEGREE)
    result = adjust_block(block.block, block.observations)
    system = System.of(block.block, block.observations)
    full = Full.of(system, result.state)
    trials, random = 5_000, np.random.default_rng(7)
    testable, bias = [], []
    for number in (GNSS, INS):
        rows, group = full.rows_of(number), result.groups[number]
        good = (group.status == ObservationStatus.USED).ravel()
        testable.append(rows[good])
        bias.append(group.detectable.ravel()[good])
    places, sizes = np.concatenate(testable), np.concatenate(bias)
    chosen = random.integers(len(places), size=trials)
    errors = random.normal(size=(trials, len(full.kept))) @ np.linalg.cholesky(full.covariance).T
    errors[np.arange(trials), places[chosen]] += sizes[chosen] * random.choice((-1.0, 1.0), trials)
    # P v = −P Q_vv P e.
    pulled = np.einsum("tn,tn->t", full.scatter[places[chosen]], errors)
    w = pulled / np.sqrt(np.diagonal(full.scatter)[places[chosen]])
    assert np.mean(np.abs(w) > stats.norm.isf(0.0005)) == pytest.approx(0.80, abs=0.02)


def test_external_reliability_bounds_what_an_undetected_error_of_a_position_does() -> None:
    exact = scene(noise_seed=None, free={BORESIGHT: True, LEVER_ARM: [[True, True, False]]})
    clean = adjust_block(exact.block, exact.observations)
    gnss = exact.observations.others[GNSS - 1]
    group = clean.groups[GNSS]
    sigma = np.sqrt(np.diagonal(clean.cofactor.reduced.of_exposures, axis1=1, axis2=2))
    for row in (0, 5, 10):
        observed = gnss.observed.copy()  # type: ignore[attr-defined]
        axes = gnss.local_from_enu[row]  # type: ignore[attr-defined]
        observed[row] += axes[:, 0] * group.detectable[row, 0]
        others = list(exact.observations.others)
        others[GNSS - 1] = replace(gnss, observed=observed)  # type: ignore[type-var]
        biased = adjust_block(exact.block, replace(exact.observations, others=tuple(others)))
        moved = np.abs(biased.state.projection_centre - clean.state.projection_centre) / sigma[:, :3]
        assert moved.max() <= group.external[row, 0] * 1.01
        assert moved.max() >= 0.3 * group.external[row, 0], "the bound is of the right size"
