"""Edges adjusted to their pixels: right on average, and as precise as they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.image_quality.edge_fit import VARIANCE, EdgeFit, fit_edge, straightness
from adjust.image_quality.edge_model import edge_values, resolution_factor
from adjust.image_quality.edge_samples import EdgeLine, samples_of
from tests.adjust.image_quality.synthetic_edges import Kind, edge_image
from tests.grids import diagonal_daily

EDGES = 20


def fits_of(kind: Kind, seed: int, count: int = EDGES) -> list[EdgeFit]:
    rng = np.random.default_rng(seed)
    fits = [fit_edge(samples_of(*edge_image(kind, rng))) for _ in range(count)]
    assert all(fit.converged for fit in fits)
    return fits


@pytest.mark.parametrize(
    ("slant", "blur", "noise"),
    diagonal_daily([3.0, 8.0, 15.0, 26.57, 40.0], [0.3, 0.4, 0.6, 0.8], [1.0, 5.0]),
)
def test_the_mean_factor_of_twenty_edges_is_right(slant: float, blur: float, noise: float) -> None:
    fits = fits_of(Kind(blur, slant, noise), seed=20)
    factors = np.array([fit.factor for fit in fits])
    error = factors.mean() - resolution_factor(np.array([blur]))[0]
    of_mean = np.sqrt(np.mean([fit.sigma_factor**2 for fit in fits]) / EDGES)
    assert abs(error) < (0.02 if slant <= 15.0 else 0.04)
    # And it is noise, not a bias: 16 samples across a pixel leave less than 0.001.
    assert abs(error) < 3.9 * of_mean + 0.001


def test_the_stated_covariance_is_that_of_white_noise_in_the_pixels() -> None:
    """Closed case: σ² (JᵀJ)⁻¹ with derivatives J of the model by differences, and σ of the residuals."""
    image, line = edge_image(Kind(0.5, 11.0, 2.0), np.random.default_rng(5))
    fit = fit_edge(samples_of(image + 0.5 * np.arange(image.shape[0])[:, None], line))

    def model(values: Floats) -> Floats:
        offset, angle, variance, dark, step, trend = values
        edge = edge_values(fit.samples.across(angle, offset), variance, angle).value
        return np.asarray(dark + step * edge + trend * fit.samples.along(angle))

    def by_differences(function: Callable[[Floats], Any], steps: Floats) -> Floats:
        moves = np.diag(steps)
        return np.stack([(function(fit.values + m) - function(fit.values - m)) for m in moves], -1) / (
            2.0 * steps
        )

    np.testing.assert_allclose(fit.residual, fit.samples.grey - model(fit.values), atol=1e-9)
    assert fit.noise**2 == pytest.approx(float(fit.residual @ fit.residual) / (len(fit.residual) - 6))
    steps = np.array([1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-4])
    jacobian = by_differences(model, steps)
    expected = fit.noise**2 * np.linalg.inv(jacobian.T @ jacobian)
    sigma = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(
        fit.covariance / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=0.01
    )
    assert fit.sigma_blur == pytest.approx(sigma[VARIANCE] / (2.0 * fit.blur), rel=0.01)
    slope = by_differences(
        lambda values: resolution_factor(np.sqrt(values[VARIANCE : VARIANCE + 1]))[0], steps
    )
    assert fit.sigma_factor == pytest.approx(slope[VARIANCE] * sigma[VARIANCE], rel=0.01)


@pytest.mark.parametrize("count", [50, pytest.param(120, marks=pytest.mark.slow)])
@pytest.mark.parametrize("noise", [pytest.param(1.0, marks=pytest.mark.slow), 5.0])
def test_the_stated_sigmas_are_those_of_the_scatter(noise: float, count: int) -> None:
    fits = fits_of(Kind(0.5, 11.0, noise), seed=7, count=count)
    for scatter, stated in (
        ([fit.factor for fit in fits], [fit.sigma_factor for fit in fits]),
        ([fit.blur for fit in fits], [fit.sigma_blur for fit in fits]),
    ):
        ratio = np.std(scatter, ddof=1) / np.sqrt(np.mean(np.square(stated)))
        # 120 values know their standard deviation to 6.5 %, 50 to 10 %.
        assert ratio == pytest.approx(1.0, abs=3.1 / np.sqrt(2.0 * count))


def test_the_noise_is_that_of_the_image() -> None:
    assert np.mean([fit.noise for fit in fits_of(Kind(0.5, 8.0, 3.0), 1)]) == pytest.approx(3.0, rel=0.05)


def test_a_straight_edge_is_straight_and_a_bent_one_is_not() -> None:
    straight = [straightness(fit).statistic for fit in fits_of(Kind(0.5, 8.0, 3.0), 2)]
    assert np.mean(straight) == pytest.approx(1.0, abs=0.15)
    row, column = np.mgrid[:60, :60].astype(np.float64)
    bow = column - 30.0 - 0.15 * (row - 30.0) + 1.0 * ((row - 30.0) / 16.0) ** 2
    image = 80.0 + 100.0 * np.clip(0.5 + bow / 1.6, 0.0, 1.0)
    line = EdgeLine(30.0, 30.0, float(-np.arctan(0.15)), 32.0)
    bend = straightness(fit_edge(samples_of(image, line))).bend
    assert bend == pytest.approx(1.0, abs=0.2)


def test_turning_the_image_by_a_quarter_changes_nothing() -> None:
    image, line = edge_image(Kind(0.5, 9.0, 2.0), np.random.default_rng(3))
    turned = EdgeLine(line.row, image.shape[1] - 1 - line.column, line.angle - 0.5 * np.pi, line.length)
    here, there = fit_edge(samples_of(image, line)), fit_edge(samples_of(np.rot90(image), turned))
    assert there.factor == pytest.approx(here.factor, abs=1e-6)
    assert there.contrast == pytest.approx(here.contrast, abs=1e-4)


def test_a_slope_of_brightness_along_the_edge_changes_nothing() -> None:
    image, line = edge_image(Kind(0.5, 9.0, 0.0), np.random.default_rng(3))
    row, column = np.mgrid[: image.shape[0], : image.shape[1]]
    along = (row - line.row) * np.cos(line.angle) - (column - line.column) * np.sin(line.angle)
    here, there = fit_edge(samples_of(image, line)), fit_edge(samples_of(image + 0.5 * along, line))
    assert there.factor == pytest.approx(here.factor, abs=2e-3)


def test_a_slice_is_shifted_to_the_bright_side_where_its_pixels_are_darker() -> None:
    image, line = edge_image(Kind(0.6, 6.0, 0.2), np.random.default_rng(4))
    fit = fit_edge(samples_of(image, line))
    along = fit.samples.along(fit.angle)
    slices = np.floor(along - along.min()).astype(int)
    move = 0.02 * np.sin(slices)
    slope = fit.contrast * edge_values(fit.distance, float(fit.values[VARIANCE]), fit.angle).slope
    found = straightness(replace(fit, residual=-slope * move))
    known = np.isin(np.round(np.bincount(slices, along) / np.bincount(slices), 9), np.round(found.along, 9))
    np.testing.assert_allclose(found.shift, 0.02 * np.sin(np.flatnonzero(known)), atol=1e-12)
