"""Errors correlated over time: closed forms, and the sparse algebra against matrices in full."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adjust.arrays import Floats
from adjust.errors import InconsistentBlockError
from adjust.observations.base import StochasticModel
from adjust.observations.gauss_markov import GaussMarkov
from adjust.solve.design_matrix import full_covariance


def along_one_strip(sigma: Floats, time: list[float], tau: float) -> StochasticModel:
    process = GaussMarkov(np.zeros(len(time), dtype=np.int64), np.array(time), tau)
    return StochasticModel.from_sigma(sigma).correlated(process)


@st.composite
def models(draw: st.DrawFn) -> StochasticModel:
    """Up to 12 observations in any order of time in up to 3 strips, any of them rejected, any covariance."""
    n, m = draw(st.integers(1, 12)), draw(st.integers(1, 3))
    seed = draw(st.integers(0, 2**32 - 1))
    tau = draw(st.sampled_from([0.1, 3.0, 20.0, 500.0]))
    generator = np.random.default_rng(seed)
    root = np.tril(generator.uniform(-0.5, 0.5, (n, m, m))) + np.eye(m)
    covariance = generator.uniform(0.1, 3.0, (n, 1, 1)) * root @ np.swapaxes(root, 1, 2)
    process = GaussMarkov(
        generator.integers(0, 3, n), generator.permutation(n) * 2.0 + generator.uniform(0.0, 1.0, n), tau
    )
    model = StochasticModel.from_covariance(covariance, np.ones((n, m), dtype=bool)).correlated(process)
    return model.without(generator.uniform(size=n) < 0.3)


def dense_part(model: StochasticModel) -> tuple[Floats, Floats]:
    """Scalars that take part, and their covariance matrix from its definition."""
    kept = np.flatnonzero(model.present.ravel())
    return kept, full_covariance(model)[np.ix_(kept, kept)]


def as_matrix(model: StochasticModel, operation: str) -> Floats:
    """What a method does to vectors, column by column."""
    n, m = model.present.shape
    columns = [getattr(model, operation)(unit.reshape(n, m)).ravel() for unit in np.eye(n * m)]
    return np.stack(columns, axis=1)


def test_two_observations_are_whitened_as_the_textbook_has_it() -> None:
    phi = np.exp(-5.0 / 20.0)
    model = along_one_strip(np.array([[2.0], [0.5]]), [100.0, 105.0], 20.0)
    errors = np.array([[3.0], [-1.0]])
    first, second = 3.0 / 2.0, (-1.0 / 0.5 - phi * 3.0 / 2.0) / np.sqrt(1.0 - phi**2)
    np.testing.assert_allclose(model.whitened(errors).ravel(), [first, second], rtol=1e-14)
    covariance = np.array([[4.0, phi], [phi, 0.25]])
    np.testing.assert_allclose(
        model.weighted(errors).ravel(), np.linalg.inv(covariance) @ errors.ravel(), rtol=1e-13
    )


@pytest.mark.parametrize("n", [2, 3, 40])
def test_the_mean_of_a_strip_has_the_variance_of_the_closed_form(n: int) -> None:
    """Least squares mean of n equidistant observations: σ² (1 + φ)/(n − (n − 2) φ)."""
    tau, step, sigma = 30.0, 4.0, 0.05
    phi = np.exp(-step / tau)
    model = along_one_strip(np.full((n, 1), sigma), [step * k for k in range(n)], tau)
    ones = np.ones((n, 1))
    variance = 1.0 / np.sum(ones * model.weighted(ones))
    assert variance == pytest.approx(sigma**2 * (1.0 + phi) / (n - (n - 2) * phi), rel=1e-12)
    assert variance > sigma**2 / n


@given(models())
@settings(max_examples=60, deadline=None)
def test_whitened_errors_have_the_unit_matrix_as_covariance(model: StochasticModel) -> None:
    kept, covariance = dense_part(model)
    whitener = as_matrix(model, "whitened")
    assert not np.delete(whitener, kept, axis=0).any()
    part = whitener[np.ix_(kept, kept)]
    np.testing.assert_allclose(part @ covariance @ part.T, np.eye(len(kept)), atol=1e-9)


@given(models())
@settings(max_examples=60, deadline=None)
def test_weights_are_the_inverse_of_the_covariance(model: StochasticModel) -> None:
    kept, covariance = dense_part(model)
    inverse = np.linalg.inv(covariance)
    weights = as_matrix(model, "weighted")
    scale = np.sqrt(np.outer(np.diagonal(inverse), np.diagonal(inverse)))
    assert np.all(np.abs(weights[np.ix_(kept, kept)] - inverse) <= 1e-9 * scale)
    np.testing.assert_allclose(model.weight_diagonal().ravel()[kept], np.diagonal(inverse), rtol=1e-9)
    assert not np.delete(model.weight_diagonal().ravel(), kept).any()


@given(models())
@settings(max_examples=60, deadline=None)
def test_errors_come_back_from_their_whitened_values(model: StochasticModel) -> None:
    errors = np.where(model.present, np.random.default_rng(1).normal(size=model.present.shape), 0.0)
    np.testing.assert_allclose(model.unwhitened(model.whitened(errors)), errors, atol=1e-10)


@given(models())
@settings(max_examples=30, deadline=None)
def test_the_inverse_of_the_whitening_and_its_transpose_belong_together(model: StochasticModel) -> None:
    neighbours = model.neighbours
    assert neighbours is not None
    one, other = np.random.default_rng(2).normal(size=(2, len(model.present), 1))
    one, other = (np.where(neighbours.taking_part[:, None], vector, 0.0) for vector in (one, other))
    left = np.sum(neighbours.correlated(one) * other)
    right = np.sum(one * neighbours.correlated(other, transposed=True))
    assert left == pytest.approx(right, rel=1e-9, abs=1e-9)


def test_rejecting_an_observation_links_its_neighbours_over_both_intervals() -> None:
    """Gone from the matrices and from the marginal covariance alike: what is left is its submatrix."""
    model = along_one_strip(np.full((5, 2), 0.1), [0.0, 4.0, 9.0, 11.0, 20.0], 8.0)
    rejected = np.array([False, True, True, False, False])
    left = model.without(rejected)
    assert left.neighbours is not None
    assert left.neighbours.before[3] == 0
    assert left.neighbours.of_before[3] == pytest.approx(np.exp(-11.0 / 8.0), rel=1e-14)
    # What was rejected knows between which it would stand.
    assert (left.neighbours.before[1], left.neighbours.after[1]) == (0, 3)
    kept = np.flatnonzero(left.present.ravel())
    submatrix = full_covariance(model)[np.ix_(kept, kept)]
    found = as_matrix(left, "weighted")[np.ix_(kept, kept)]
    np.testing.assert_allclose(found, np.linalg.inv(submatrix), rtol=1e-12, atol=1e-12)


def test_strips_have_nothing_to_do_with_each_other() -> None:
    process = GaussMarkov(np.array([7, 7, 3, 3]), np.array([0.0, 1.0, 1.0, 0.0]), 50.0)
    model = StochasticModel.from_sigma(np.full((4, 1), 1.0)).correlated(process)
    weights = as_matrix(model, "weighted")
    assert not weights[:2, 2:].any()
    np.testing.assert_allclose(weights[2:, 2:], weights[:2, :2], rtol=1e-12)


def test_a_vanishing_correlation_time_is_no_correlation() -> None:
    sigma = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    white, almost = StochasticModel.from_sigma(sigma), along_one_strip(sigma, [0.0, 3.0, 7.0], 1e-3)
    errors = np.random.default_rng(3).normal(size=sigma.shape)
    for operation in ("whitened", "weighted", "unwhitened"):
        expected = getattr(white, operation)(errors)
        np.testing.assert_allclose(getattr(almost, operation)(errors), expected, rtol=1e-12)


def test_rescaling_keeps_the_correlations() -> None:
    model = along_one_strip(np.full((4, 2), 0.1), [0.0, 4.0, 9.0, 11.0], 8.0)
    factor = np.array([[2.0, 0.5], [1.0, 1.0], [3.0, 3.0], [0.1, 4.0]])
    scaled = full_covariance(model) * np.outer(factor.ravel(), factor.ravel())
    np.testing.assert_allclose(full_covariance(model.rescaled(factor)), scaled, rtol=1e-12)
    weights = as_matrix(model.rescaled(factor), "weighted")
    np.testing.assert_allclose(weights @ scaled, np.eye(8), atol=1e-10)


def test_exposures_almost_at_the_same_time_lose_no_digits() -> None:
    """1 − φ² of neighbours 1e-9 τ apart is 2e-9, to the last digits."""
    model = along_one_strip(np.ones((2, 1)), [0.0, 1e-7], 100.0)
    assert model.neighbours is not None
    assert model.neighbours.free_of_before[1] == pytest.approx(2e-9, rel=1e-8)


def test_the_derivative_of_the_weights_is_that_of_differences() -> None:
    time, tau, step = [0.0, 4.0, 9.0, 11.0, 20.0], 8.0, 1e-6
    model = along_one_strip(np.ones((5, 1)), time, tau).without(np.arange(5) == 2)
    neighbours, process = model.neighbours, model.over_time
    assert neighbours is not None
    assert process is not None
    age_before = np.abs(process.time - process.time[neighbours.before]) / tau
    age_after = np.abs(process.time - process.time[neighbours.after]) / tau
    # dφ/d log τ = φ Δt/τ.
    stencil = neighbours.weights_derivative(
        neighbours.of_before * age_before, neighbours.of_after * age_after
    )
    found = np.stack([neighbours.combined(stencil, unit) for unit in np.eye(5)], axis=1)
    beyond, below = (
        as_matrix(model.with_correlation_time(tau * np.exp(change)), "weighted") for change in (step, -step)
    )
    kept = np.flatnonzero(neighbours.taking_part)
    np.testing.assert_allclose(
        found[np.ix_(kept, kept)], ((beyond - below) / (2.0 * step))[np.ix_(kept, kept)], atol=1e-7
    )


@pytest.mark.parametrize(
    ("time", "tau", "message"),
    [
        ([0.0, np.nan], 5.0, "not known"),
        ([1.0, 1.0], 5.0, "same time"),
        ([0.0, 1.0], 0.0, "positive and finite"),
        ([0.0, 1.0], np.inf, "positive and finite"),
    ],
)
def test_what_cannot_be_is_refused(time: list[float], tau: float, message: str) -> None:
    with pytest.raises(InconsistentBlockError, match=message):
        along_one_strip(np.ones((2, 1)), time, tau)


def test_half_an_observation_is_refused() -> None:
    process = GaussMarkov(np.zeros(2, dtype=np.int64), np.array([0.0, 1.0]), 5.0)
    with pytest.raises(InconsistentBlockError, match="must be complete"):
        StochasticModel.from_sigma(np.array([[1.0, np.nan], [1.0, 1.0]])).correlated(process)


def test_interval_and_length_of_strips() -> None:
    process = GaussMarkov(np.array([0, 1, 0, 1, 0]), np.array([0.0, 50.0, 4.0, 57.0, 9.0]), 5.0)
    assert process.interval == 5.0
    assert process.longest_strip == 9.0
    assert process.exposures_of_a_strip == 2.5
    alone = GaussMarkov(np.arange(3), np.zeros(3), 5.0)
    assert np.isnan(alone.interval)
    assert alone.longest_strip == 0.0
    assert alone.exposures_of_a_strip == 1.0
    assert replace(process, correlation_time=7.0).correlation_time == 7.0
