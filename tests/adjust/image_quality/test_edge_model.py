"""The step seen by square pixels, its derivatives, and the factor of effective resolution."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.image_quality.edge_model import (
    edge_values,
    factor_by_variance,
    line_spread,
    resolution_factor,
    transfer,
)
from tests.adjust.image_quality.synthetic_edges import Kind, blurred_step

ANGLES = (0.0, 5e-4, 2e-3, 0.1, 0.7, np.pi / 4, 2.2, -2.9)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_step_is_that_of_pixels_sampled_densely(angle: float) -> None:
    distance = np.linspace(-4.0, 4.0, 33)
    expected = blurred_step(distance, Kind(0.4, 0.0, 0.0), angle)
    # 16 samples across a pixel miss 1/16² of its second moment.
    np.testing.assert_allclose(edge_values(distance, 0.16, angle).value, expected, atol=3e-4)


@pytest.mark.parametrize("angle", ANGLES)
def test_the_derivatives_are_those_of_differences(angle: float) -> None:
    distance, step = np.linspace(-3.0, 3.0, 25), 1e-4
    values = edge_values(distance, 0.25, angle)
    ahead, behind = (edge_values(distance + s, 0.25, angle).value for s in (step, -step))
    more, less = (edge_values(distance, 0.25 + s, angle).value for s in (step, -step))
    np.testing.assert_allclose(values.slope, (ahead - behind) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(values.by_variance, (more - less) / (2 * step), atol=1e-7)


def test_the_factor_is_that_of_the_reference() -> None:
    factors = resolution_factor(np.array([0.2, 0.4, 0.6, 0.8, 1.0]))
    np.testing.assert_allclose(factors, [1.006, 1.208, 1.583, 2.009, 2.454], atol=1e-3)


def test_a_sharp_image_has_the_factor_one_and_a_very_soft_one_that_of_its_blur() -> None:
    assert resolution_factor(np.array([0.0]))[0] == pytest.approx(1.0, abs=1e-6)
    assert resolution_factor(np.array([20.0]))[0] == pytest.approx(
        20.0 * 2.0 * np.sqrt(2 * np.log(2)), rel=1e-3
    )


def test_at_half_the_width_the_line_spread_function_is_half_as_high() -> None:
    sigma = np.linspace(0.05, 3.0, 40)
    half = line_spread(0.5 * resolution_factor(sigma), sigma)
    np.testing.assert_allclose(half, 0.5 * line_spread(np.zeros(40), sigma), rtol=1e-9)


def test_the_derivative_of_the_factor_is_that_of_differences() -> None:
    variance, step = np.linspace(0.05, 2.0, 20), 1e-5
    ahead, behind = (resolution_factor(np.sqrt(variance + s)) for s in (step, -step))
    np.testing.assert_allclose(factor_by_variance(variance), (ahead - behind) / (2 * step), rtol=1e-5)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
def test_the_transfer_is_the_transform_of_the_line_spread_function(angle: float) -> None:
    distance = np.arange(-12.0, 12.0, 0.01)
    spread = edge_values(distance, 0.25, angle).slope * 0.01
    frequency = np.linspace(0.0, 1.0, 21)
    transformed = np.cos(2.0 * np.pi * np.outer(frequency, distance)) @ spread
    np.testing.assert_allclose(transfer(frequency, 0.25, angle), transformed, atol=1e-5)
