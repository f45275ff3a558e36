from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.arrays import Bools, Floats
from adjust.selection.correlation import correlation_matrix
from adjust.selection.elimination import (
    BLUH,
    DEFAULT,
    DMC_CERTIFICATE,
    PRESETS,
    Action,
    Criterion,
    EliminationRules,
    eliminate,
)
from adjust.selection.linear_estimate import LinearEstimate
from adjust.selection.significance import entering_t_values, t_values
from tests.adjust.calibration.designs import Design, random_design


def observed_directly(values: list[float], times: int = 100) -> LinearEstimate:
    """Uncorrelated parameters, each with σ = 0.1: t is ten times the value, σ0 very nearly 1."""
    g = len(values)
    matrix = np.repeat(np.eye(g), times, axis=0)
    noise = np.random.default_rng(1).normal(size=(g, times))
    noise -= noise.mean(axis=1, keepdims=True)
    noise *= np.sqrt((times * g - g) / np.sum(noise**2))
    observed = matrix @ np.array(values) + noise.ravel()
    design = Design(matrix, np.zeros((g * times, 0)), observed, np.full(g, np.nan), np.zeros(g))
    return LinearEstimate.of(design.normals)


def every(estimate: LinearEstimate) -> Bools:
    return np.ones(len(estimate.free), dtype=bool)


def test_the_least_significant_goes_first_and_every_step_says_why() -> None:
    estimate = observed_directly([0.05, 0.8, -0.15, 0.24, -0.31])
    found = eliminate(estimate, every(estimate), DEFAULT)
    assert [(item.name, item.action) for item in found.decisions] == [
        ("p0", Action.ELIMINATED),
        ("p2", Action.ELIMINATED),
        ("p3", Action.ELIMINATED),
        ("p1", Action.KEPT),
        ("p4", Action.KEPT),
    ]
    assert found.decisions[0].reason == "|t| = 0.50 is below 2.59 (two-sided, α = 1 %)"
    assert found.decisions[-1].reason.startswith("|t| = 3.0")
    assert found.kept.tolist() == [False, True, False, False, True]
    assert (found.kept ^ found.eliminated).all()


def test_certificates_say_it_in_their_words_and_at_95_per_cent() -> None:
    estimate = observed_directly([0.05, 0.8, -0.15, 0.24, -0.31])
    found = eliminate(estimate, every(estimate), DMC_CERTIFICATE)
    assert found.kept.tolist() == [False, True, False, True, True]
    assert [found.verdict(k) for k in (0, 3)] == ["is eliminated", "is significant"]
    assert {item.limit for item in found.decisions} == {1.96}


def test_bluh_keeps_what_exceeds_its_standard_deviation() -> None:
    estimate = observed_directly([0.05, 0.8, -0.15, 0.24, -0.31])
    assert eliminate(estimate, every(estimate), BLUH).kept.tolist() == [False, True, True, True, True]


def test_with_little_redundancy_fixed_limits_are_those_of_student() -> None:
    assert DMC_CERTIFICATE.limit(10_000) == DMC_CERTIFICATE.limit(None) == 1.96
    assert DMC_CERTIFICATE.limit(2) == pytest.approx(4.30, abs=0.01)
    assert BLUH.limit(10_000) == 1.0
    assert BLUH.limit(2) == pytest.approx(1.32, abs=0.01)
    # Two-sided at 0.5 %.
    assert DEFAULT.entry_limit(5) == pytest.approx(4.77, abs=0.01)
    assert DEFAULT.entry_limit(None) == pytest.approx(2.81, abs=0.01)


def test_with_a_known_sigma0_limits_are_those_of_the_normal_distribution() -> None:
    estimate = observed_directly([0.5, 8.0], times=3)
    found = eliminate(estimate, every(estimate), DEFAULT, sigma0=1.0)
    assert [item.limit for item in found.decisions] == pytest.approx([2.576, 2.576], abs=1e-3)
    # At 1 % with a redundancy of four, and of five without the first.
    limits = [item.limit for item in eliminate(estimate, every(estimate), DEFAULT).decisions]
    assert limits == pytest.approx([4.604, 4.032], abs=1e-3)


def test_what_is_no_candidate_stays_however_insignificant() -> None:
    estimate = observed_directly([0.05, 0.02, 0.8])
    found = eliminate(estimate, np.array([False, True, True]), DEFAULT)
    assert found.estimate.free.tolist() == [True, False, True]
    assert [item.name for item in found.decisions] == ["p1", "p2"]


def correlated_pair(first: float, second: float, angle_deg: float) -> LinearEstimate:
    """Two parameters whose effects enclose an angle; their correlation is −cos of it."""
    generator = np.random.default_rng(2)
    basis, _ = np.linalg.qr(generator.normal(size=(400, 3)))
    c, s = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    matrix = np.column_stack([basis[:, 0], c * basis[:, 0] + s * basis[:, 1], basis[:, 2]])
    noise = generator.normal(size=400)
    noise -= basis @ (basis.T @ noise)
    noise *= np.sqrt(397 / np.sum(noise**2))
    observed = matrix @ np.array([first, second, 50.0]) + noise
    design = Design(matrix, np.zeros((400, 0)), observed, np.full(3, np.nan), np.zeros(3))
    return LinearEstimate.of(design.normals)


def test_of_a_correlated_pair_the_one_with_the_smaller_t_goes() -> None:
    estimate = correlated_pair(40.0, 30.0, 20.0)
    assert correlation_matrix(estimate.cofactor)[0, 1] == pytest.approx(-np.cos(np.deg2rad(20.0)))
    assert np.abs(t_values(estimate)).min() > 9.0
    # Both are significant by far; the entry test would bring the second one back again and again.
    found = eliminate(estimate, every(estimate), replace(DEFAULT, entry=None))
    first = found.decisions[0]
    assert (first.name, first.criterion) == ("p1", Criterion.CORRELATION)
    assert first.reason.startswith("correlated 94 % with p0, whose |t| =")
    assert found.kept.tolist() == [True, False, True]
    # 88 % are less than the 90 % of the rule.
    assert eliminate(correlated_pair(40.0, 30.0, 28.0), every(estimate), DEFAULT).kept.all()


def test_a_parameter_comes_back_once_and_is_then_judged_like_the_others() -> None:
    found = eliminate(correlated_pair(40.0, 30.0, 20.0), np.ones(3, dtype=bool), DEFAULT)
    about_p1 = [(item.action, item.criterion) for item in found.decisions if item.name == "p1"]
    assert about_p1 == [
        (Action.ELIMINATED, Criterion.CORRELATION),
        (Action.TAKEN_BACK, Criterion.SIGNIFICANCE),
        (Action.ELIMINATED, Criterion.CORRELATION),
    ]


def test_total_correlation_removes_only_what_is_not_significant_by_default() -> None:
    rules = replace(DEFAULT, pairwise=None, total=0.9)
    both = eliminate(correlated_pair(40.0, 30.0, 20.0), np.ones(3, dtype=bool), rules)
    assert both.kept.all()
    weak = eliminate(correlated_pair(40.0, 2.0, 20.0), np.ones(3, dtype=bool), rules)
    first = weak.decisions[0]
    assert (first.name, first.criterion) == ("p1", Criterion.TOTAL_CORRELATION)
    assert first.reason == "total correlation 0.940 with the other additional parameters exceeds 0.900"
    strict = eliminate(
        correlated_pair(40.0, 30.0, 20.0),
        np.ones(3, dtype=bool),
        replace(rules, total_spares_significant=False, entry=None),
    )
    assert strict.kept.tolist() == [True, False, True]


def test_a_parameter_masked_by_another_is_found_again() -> None:
    # y = x1 − x2 with nearly parallel x1, x2: each alone explains hardly anything, both together do. What was
    # dropped must be tested again once the rival of its partner has gone.
    generator = np.random.default_rng(3)
    base = generator.normal(size=300)
    first = base + 0.5 * generator.normal(size=300)
    second = base + 0.5 * generator.normal(size=300)
    mixture = 0.6 * first + 0.4 * second + 0.15 * generator.normal(size=300)
    observed = first - 0.9 * second + generator.normal(size=300)
    matrix = np.column_stack([first, second, mixture])
    design = Design(matrix, np.zeros((300, 0)), observed, np.full(3, np.nan), np.zeros(3))
    estimate = LinearEstimate.of(design.normals)
    start = estimate.without(0)
    assert abs(entering_t_values(start)[0]) > 1.0
    found = eliminate(start, np.ones(3, dtype=bool), replace(DEFAULT, pairwise=None))
    assert Action.TAKEN_BACK in {item.action for item in found.decisions}
    assert found.kept[[0, 1]].all()
    assert not found.kept[2]


def mixed_up(seed: int = 4) -> Design:
    """Eight parameters, p5 a combination of p2 and p3 but for a thousandth, p7 just p0."""
    design = random_design(seed, priors=False)
    matrix = design.of_parameters / np.linalg.norm(design.of_parameters, axis=0)
    matrix[:, 5] = matrix[:, 2] + matrix[:, 3] + 1e-3 * matrix[:, 5]
    matrix[:, 7] = 3.0 * matrix[:, 0]
    return replace(design, of_parameters=matrix)


def test_what_is_not_determinable_is_named_and_goes_first() -> None:
    candidates = np.arange(8) >= 4
    estimate = LinearEstimate.of(mixed_up().normals, last=candidates)
    found = eliminate(estimate, candidates, DEFAULT)
    first, second = found.decisions[:2]
    assert (first.name, first.criterion) == ("p7", Criterion.DETERMINABILITY)
    assert first.reason == "not determinable in this block: it cannot be separated from p0"
    assert np.isnan(first.t)
    assert (second.name, second.criterion) == ("p5", Criterion.DETERMINABILITY)
    assert "p2 and p3" in second.reason or "p3 and p2" in second.reason
    assert np.isfinite(found.estimate.cofactor).all()
    assert found.estimate.free[:4].all()


def test_a_parameter_known_by_its_prior_alone_goes_and_the_prior_is_named() -> None:
    design = random_design(2)
    matrix = design.of_parameters.copy()
    matrix[:, 4] *= 1e-3
    estimate = LinearEstimate.of(replace(design, of_parameters=matrix).normals)
    first = eliminate(estimate, every(estimate), DEFAULT).decisions[0]
    assert (first.name, first.criterion) == ("p4", Criterion.DETERMINABILITY)
    assert first.reason == "not determinable: its σ is 100 % of the prior σ"


@given(st.integers(0, 10_000), st.sampled_from(sorted(PRESETS)), st.booleans())
def test_after_a_selection_no_rule_is_violated_and_nothing_significant_was_left_out(
    seed: int, preset: str, priors: bool
) -> None:
    design, rules = random_design(seed, priors=priors), PRESETS[preset]
    candidates = np.arange(8) >= 2
    found = eliminate(LinearEstimate.of(design.normals), candidates, rules)
    estimate = found.estimate
    change, cofactor, squares, redundancy = design.solved(estimate.free)
    assert estimate.weighted_squares == pytest.approx(squares, rel=1e-8)
    assert estimate.redundancy == redundancy
    kept = np.flatnonzero(found.kept)
    t = np.abs(change[kept]) / np.sqrt(squares / redundancy * np.diagonal(cofactor)[kept])
    assert np.all(t > rules.limit(redundancy) - 1e-6)
    assert largest_correlation(cofactor, kept) <= (rules.pairwise or 1.0)
    assert {item.parameter for item in found.decisions if item.action == Action.KEPT} == set(kept.tolist())
    for item in found.decisions:
        assert candidates[item.parameter]
        assert item.reason
    unreturned = np.flatnonzero(found.eliminated)
    limit = rules.entry_limit(redundancy)
    if limit is not None:
        again = {item.parameter for item in found.decisions if item.action == Action.TAKEN_BACK}
        for d in set(unreturned.tolist()) - again:
            assert not abs(entering_t_values(estimate)[d]) > limit


def largest_correlation(cofactor: Floats, kept: np.ndarray) -> float:
    if len(kept) < 2:
        return 0.0
    correlation = np.abs(correlation_matrix(cofactor[np.ix_(kept, kept)]))
    return float(np.max(correlation - np.eye(len(kept))))


def test_nothing_is_dropped_without_candidates() -> None:
    estimate = observed_directly([0.05, 0.02])
    found = eliminate(estimate, np.zeros(2, dtype=bool), DEFAULT)
    assert found.estimate is estimate
    assert found.decisions == ()


def test_the_presets_go_by_their_names() -> None:
    assert {name: type(rules) for name, rules in PRESETS.items()} == dict.fromkeys(
        ("default", "bluh", "dmc_certificate"), EliminationRules
    )
