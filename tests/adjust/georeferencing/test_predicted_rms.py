"""Prediction of root mean square, mean and largest value of correlated errors."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
from scipy import stats

from adjust.arrays import Floats
from adjust.georeferencing.error_sources import CalibrationErrors
from adjust.georeferencing.predicted_rms import predicted_largest, predicted_rms, rms_of_covariance
from adjust.georeferencing.sensitivity import Sensitivity


def answering(parameters: Floats, factor: Floats | None = None) -> Sensitivity:
    """Quantities that answer to the calibration only."""
    q, k = parameters.shape
    nothing = scipy.sparse.csr_array((q, 0))
    return Sensitivity(
        nothing, nothing, scipy.sparse.csr_array(parameters), np.eye(k) if factor is None else factor
    )


def test_independent_errors_of_equal_size_have_as_many_degrees_of_freedom_as_there_are() -> None:
    found = predicted_rms(answering(np.zeros((50, 1))), np.full(50, 0.04))
    assert found.rms == pytest.approx(0.2)
    assert found.degrees_of_freedom == pytest.approx(50.0)
    assert found.sigma_of_mean == pytest.approx(0.2 / np.sqrt(50))
    low, high = found.limits(0.95)
    assert low == pytest.approx(0.2 * np.sqrt(stats.chi2.ppf(0.025, 50) / 50))
    assert high == pytest.approx(0.2 * np.sqrt(stats.chi2.ppf(0.975, 50) / 50))


def test_an_error_common_to_all_is_one_draw_however_many_points_show_it() -> None:
    found = predicted_rms(answering(np.full((84, 1), 0.03)), np.zeros(84))
    assert found.rms == pytest.approx(0.03)
    assert found.degrees_of_freedom == pytest.approx(1.0)
    assert found.sigma_of_mean == pytest.approx(0.03)


@pytest.mark.parametrize("q", [5, 60])
def test_traces_are_those_of_the_full_covariance(q: int) -> None:
    random = np.random.default_rng(q)
    matrix, own = random.normal(size=(q, 20)), random.uniform(0.1, 2.0, q)
    covariance = matrix @ matrix.T + np.diag(own)
    found = predicted_rms(answering(matrix), own)
    assert found.rms == pytest.approx(np.sqrt(np.trace(covariance) / q))
    assert found.degrees_of_freedom == pytest.approx(
        np.trace(covariance) ** 2 / np.trace(covariance @ covariance)
    )
    assert found.sigma_of_mean == pytest.approx(np.sqrt(covariance.sum()) / q)


def test_correlated_errors_keep_the_limits_as_often_as_promised() -> None:
    random = np.random.default_rng(8)
    matrix, own = random.normal(size=(40, 6)), np.full(40, 0.5)
    found = predicted_rms(answering(matrix), own)
    draws = matrix @ random.normal(size=(6, 20_000)) + np.sqrt(0.5) * random.normal(size=(40, 20_000))
    rms = np.sqrt(np.mean(draws**2, axis=0))
    low, high = found.limits(0.95)
    assert np.mean((rms > low) & (rms < high)) == pytest.approx(0.95, abs=0.015)
    assert np.std(draws.mean(axis=0)) == pytest.approx(found.sigma_of_mean, rel=0.02)


def test_the_largest_of_independent_errors_is_that_of_the_normal_distribution() -> None:
    found = [predicted_largest(answering(np.zeros((400, 1))), np.full(400, 4.0), seed) for seed in range(20)]
    median, limit = (np.array([getattr(item, name) for item in found]) for name in ("median", "limit"))
    # P(max |e| < x) = (2 Φ(x/σ) − 1)^q
    of_half, of_most = 2.0 * stats.norm.ppf(0.5 + 0.5 * np.array([0.5, 0.95]) ** (1 / 400))
    np.testing.assert_allclose(median, of_half, rtol=0.03)
    np.testing.assert_allclose(limit, of_most, rtol=0.07)
    assert median.mean() == pytest.approx(of_half, rel=0.006)
    assert limit.mean() == pytest.approx(of_most, rel=0.012)
    assert predicted_largest(answering(np.zeros((400, 1))), np.full(400, 4.0)) == found[0]


def test_nothing_to_predict_is_refused() -> None:
    with pytest.raises(ValueError, match="no quantity for which"):
        predicted_rms(answering(np.zeros((0, 1))), np.zeros(0))
    with pytest.raises(ValueError, match="no quantity for which"):
        predicted_rms(answering(np.zeros((3, 1))), np.zeros(3))


def test_a_covariance_with_perfect_correlations_has_a_factor() -> None:
    sigma = np.array([1e-6, 0.5, 3.0])
    correlation = np.array([[1.0, 1.0, 0.2], [1.0, 1.0, 0.2], [0.2, 0.2, 1.0]])
    covariance = correlation * np.outer(sigma, sigma)
    factor = CalibrationErrors({}, covariance).factor
    np.testing.assert_allclose(factor @ factor.T, covariance, rtol=1e-12, atol=1e-20)


def test_a_full_covariance_gives_the_same_prediction_as_the_sources_it_comes_from() -> None:
    random = np.random.default_rng(3)
    matrix, own = random.normal(size=(12, 4)), random.uniform(0.1, 2.0, 12)
    found = rms_of_covariance(matrix @ matrix.T + np.diag(own))
    expected = predicted_rms(answering(matrix), own)
    assert found.rms == pytest.approx(expected.rms)
    assert found.degrees_of_freedom == pytest.approx(expected.degrees_of_freedom)
    assert found.sigma_of_mean == pytest.approx(expected.sigma_of_mean)
    with pytest.raises(ValueError, match="no quantity for which"):
        rms_of_covariance(np.zeros((3, 3)))
