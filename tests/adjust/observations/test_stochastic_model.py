"""Weights of observations."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.errors import InconsistentBlockError
from adjust.observations.base import StochasticModel


def test_absent_components_have_no_weight() -> None:
    model = StochasticModel.from_sigma(np.array([[0.5, np.nan], [2.0, 4.0]]))
    np.testing.assert_array_equal(model.whitener, [[[2.0, 0.0], [0.0, 0.0]], [[0.5, 0.0], [0.0, 0.25]]])
    np.testing.assert_array_equal(model.present, [[True, False], [True, True]])


def test_a_diagonal_covariance_gives_the_weights_of_its_sigmas() -> None:
    sigma = np.array([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])
    covariance = np.stack([np.diag(row**2) for row in sigma])
    full = StochasticModel.from_covariance(covariance, np.ones((2, 3), dtype=bool))
    np.testing.assert_allclose(full.whitener, StochasticModel.from_sigma(sigma).whitener, rtol=1e-14)
    np.testing.assert_allclose(full.sigma, sigma)


def test_weight_of_a_full_covariance_is_its_inverse() -> None:
    covariance = np.array([[[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]])
    whitener = StochasticModel.from_covariance(covariance, np.ones((1, 3), dtype=bool)).whitener[0]
    np.testing.assert_allclose(whitener.T @ whitener, np.linalg.inv(covariance[0]), rtol=1e-13)


def test_an_absent_component_is_marginalised_not_conditioned() -> None:
    covariance = np.array([[[4.0, 1.0, np.nan], [1.0, 2.0, np.nan], [np.nan, np.nan, np.nan]]])
    whitener = StochasticModel.from_covariance(covariance, np.array([[True, True, False]])).whitener[0]
    np.testing.assert_allclose((whitener.T @ whitener)[:2, :2], np.linalg.inv(covariance[0, :2, :2]))
    assert not whitener[2].any()


@pytest.mark.parametrize("sigma", [0.0, -0.1])
def test_a_sigma_that_is_not_positive_is_refused(sigma: float) -> None:
    with pytest.raises(InconsistentBlockError, match="zero or negative"):
        StochasticModel.from_sigma(np.array([[1.0, sigma]]))


def test_a_covariance_that_is_not_positive_definite_is_refused() -> None:
    covariance = np.array([[[1.0, 2.0], [2.0, 1.0]]])
    with pytest.raises(InconsistentBlockError, match="not positive definite"):
        StochasticModel.from_covariance(covariance, np.ones((1, 2), dtype=bool))
