"""Statistics of one, two and three components, known and estimated σ0, on one scale."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.quality.snooping_statistic import (
    EstimatedVariance,
    directional_statistic,
    normal_equivalent,
)

VALUES = np.array([0.1, 1.0, 4.0, 12.0, 30.0, 200.0])


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_statistic_has_the_probability_of_its_equivalent(dimension: int) -> None:
    found = normal_equivalent(VALUES, np.full(len(VALUES), dimension))
    np.testing.assert_allclose(2.0 * stats.norm.sf(found), stats.chi2.sf(VALUES, dimension), rtol=1e-9)


def test_huge_statistics_neither_overflow_nor_lose_their_order() -> None:
    for dimension in (1, 2, 3):
        for variance in (None, EstimatedVariance(1e10, 500)):
            found = normal_equivalent(np.geomspace(10.0, 1e9, 40), np.full(40, dimension), variance)
            assert np.isfinite(found).all()
            assert (np.diff(found) > 0.0).all()


def test_nothing_controlled_gives_nothing() -> None:
    assert normal_equivalent(np.array([0.0]), np.array([0])) == 0.0


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_where_all_degrees_of_freedom_are_its_own_nothing_is_there_to_compare_with(dimension: int) -> None:
    variance = EstimatedVariance(40.0, dimension)
    assert normal_equivalent(np.array([40.0]), np.array([dimension]), variance) == 0.0


def test_one_component_with_estimated_variance_is_the_tau_test() -> None:
    f, sigma0_squared = 80, 1.7
    variance = EstimatedVariance(f * sigma0_squared, f)
    statistic = np.array([0.5, 4.0, 20.0, 60.0])
    tau = np.sqrt(statistic / sigma0_squared)
    t = tau * np.sqrt((f - 1) / (f - tau**2))
    found = normal_equivalent(statistic, np.ones(4, dtype=int), variance)
    np.testing.assert_allclose(2.0 * stats.norm.sf(found), 2.0 * stats.t.sf(t, f - 1), rtol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_several_components_with_estimated_variance_are_the_f_test_against_all_others(dimension: int) -> None:
    f, squares, statistic = 80, 136.0, np.array([0.5, 4.0, 20.0, 60.0])
    ratio = (statistic / dimension) / ((squares - statistic) / (f - dimension))
    found = normal_equivalent(statistic, np.full(4, dimension), EstimatedVariance(squares, f))
    np.testing.assert_allclose(
        2.0 * stats.norm.sf(found), stats.f.sf(ratio, dimension, f - dimension), rtol=1e-9
    )


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_what_is_nearly_all_of_the_squares_is_more_suspicious_than_any_smaller_part(dimension: int) -> None:
    """From three quarters of them on the probability underflows."""
    statistic = np.linspace(10.0, 990.0, 99)
    found = normal_equivalent(statistic, np.full(99, dimension), EstimatedVariance(1000.0, 1000))
    assert np.all(np.diff(found[:70]) > 0.0)
    assert np.all(np.diff(found) >= 0.0)


def test_the_critical_tau_of_the_literature_is_met() -> None:
    """f = 819, 1485 observations at 5 %: τ = 4.13 where the normal distribution has 4.15."""
    normal = stats.norm.isf(0.5 * 0.05 / 1485)
    variance = EstimatedVariance(819.0, 819)
    assert normal == pytest.approx(4.15, abs=0.005)
    below, above = normal_equivalent(np.array([4.12, 4.14]) ** 2, np.ones(2, dtype=int), variance)
    assert below < normal < above


def test_simulated_residuals_exceed_as_often_as_the_value_says() -> None:
    """Residuals v = −R e of a small adjustment, tested two by two, σ0 known and not."""
    random = np.random.default_rng(3)
    design = random.normal(size=(40, 15))
    remainder = np.eye(40) - design @ np.linalg.pinv(design)
    noise = random.normal(size=(20_000, 40))
    residual = -(noise @ remainder)
    pairs = residual.reshape(-1, 20, 2)
    own = np.stack([remainder[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(20)])
    statistic, dimension = directional_statistic(
        pairs.reshape(-1, 2), np.tile(own, (len(noise), 1, 1)).reshape(-1, 2, 2)
    )
    known = normal_equivalent(statistic, dimension)
    tail = np.mean(known > 2.576)
    assert tail == pytest.approx(0.01, abs=5 * np.sqrt(0.01 / len(known)))
    squares = np.sum(residual[:1_000] ** 2, axis=1)
    # 1.7 is the true σ0, and nobody knows it.
    for scale in (1.0, 1.7):
        found = np.concatenate(
            [
                normal_equivalent(scale**2 * t, d, EstimatedVariance(scale**2 * float(s), 25))
                for t, d, s in zip(
                    statistic.reshape(-1, 20)[:1_000], dimension.reshape(-1, 20)[:1_000], squares, strict=True
                )
            ]
        )
        assert np.mean(found > 2.576) == pytest.approx(0.01, abs=5 * np.sqrt(0.01 / len(found)))


def test_a_direction_that_nobody_controls_takes_no_part() -> None:
    remainder = np.array([[[0.5, 0.5], [0.5, 0.5]], [[0.5, 0.0], [0.0, 0.05]]])
    whitened = np.array([[1.0, 1.0], [1.0, 100.0]])
    statistic, dimension = directional_statistic(whitened, remainder)
    np.testing.assert_allclose(statistic, [2.0, 2.0])
    assert dimension.tolist() == [1, 1]
