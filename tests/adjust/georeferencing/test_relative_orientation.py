"""Gross errors among y-parallaxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Ints
from adjust.georeferencing.relative_orientation import RelativeOrientation, relative_orientation
from adjust.georeferencing.y_parallax import YParallaxes
from adjust.simulate.object_points import PointSpecification
from tests.adjust.georeferencing.flights import Flight, fly, simulated
from tests.adjust.georeferencing.test_y_parallax import parallaxes_of

CRITICAL = 4.13


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(simulated(points=PointSpecification(count=500)))


def wrong(flight: Flight, chosen: Ints, error_um: float) -> Flight:
    """Image points moved across the flight (the strips run east, west, north and south)."""
    xy = flight.rays.xy.copy()
    xy[chosen] += error_um * 1e-6
    return replace(flight, rays=replace(flight.rays, xy=xy))


def screened(flight: Flight) -> tuple[YParallaxes, RelativeOrientation]:
    found = parallaxes_of(flight)
    return found, relative_orientation(found, CRITICAL)


def test_errors_of_orientations_are_taken_for_no_gross_errors(flight: Flight) -> None:
    found, relative = screened(flight)
    sigma = np.sqrt(found.by_image_points)
    assert np.sqrt(np.mean((found.parallax / sigma) ** 2)) > 3.0
    assert not relative.is_gross_error.any()
    assert relative.scale < 1.15


def test_what_is_left_is_the_noise_of_the_image_coordinates(flight: Flight) -> None:
    found, relative = screened(flight)
    known = np.isfinite(relative.residual)
    models = len(np.unique(found.common.model[known]))
    squares = np.sum((relative.residual[known] ** 2) / found.by_image_points[known])
    redundancy = known.sum() - 5 * models
    # χ² with this redundancy: 1 ± 3.3 √(2/r); image points in two models are no further observations.
    assert abs(squares / redundancy - 1.0) < 3.3 * np.sqrt(2.0 / redundancy) * 1.5


def test_mismatched_points_are_found_and_nothing_else(flight: Flight) -> None:
    in_models = parallaxes_of(flight).common.left[::37]
    found, relative = screened(wrong(flight, in_models, 30.0))
    hit = np.isin(found.common.left, in_models) | np.isin(found.common.right, in_models)
    assert hit.sum() >= len(in_models)
    # 30 µm in x and y show with 30 µm in the parallax or with 30 √2 µm, far above 4.13 σ √2 = 8.8 µm.
    missed = hit & ~relative.is_gross_error
    assert missed.sum() <= 0.1 * hit.sum()
    assert not np.any(relative.is_gross_error & ~hit)


def only(found: YParallaxes, rows: Ints) -> YParallaxes:
    """Some of the parallaxes."""
    common = found.common
    return replace(
        found,
        common=replace(common, model=common.model[rows], left=common.left[rows], right=common.right[rows]),
        parallax=found.parallax[rows],
        by_image_points=found.by_image_points[rows],
        sensitivity=found.sensitivity.only(rows),
        of_relative_orientation=found.of_relative_orientation[rows],
    )


@pytest.mark.parametrize(("points", "tested"), [(7, False), (8, True)])
def test_models_with_few_points_are_not_tested(flight: Flight, points: int, *, tested: bool) -> None:
    found = parallaxes_of(flight)
    relative = relative_orientation(only(found, np.flatnonzero(found.common.model == 0)[:points]), CRITICAL)
    assert np.isfinite(relative.residual).tolist() == [tested] * points
    assert not relative.is_gross_error.any()


def test_residuals_are_those_of_least_squares_in_each_model(flight: Flight) -> None:
    found, relative = screened(flight)
    for model in np.unique(found.common.model):
        own = found.common.model == model
        if np.isnan(relative.residual[own]).any():
            continue
        weight = 1.0 / np.sqrt(found.by_image_points[own])
        design = weight[:, None] * found.of_relative_orientation[own]
        solution = np.linalg.lstsq(design, weight * found.parallax[own])[0]
        expected = found.parallax[own] - found.of_relative_orientation[own] @ solution
        np.testing.assert_allclose(relative.residual[own], expected, atol=1e-11)


@pytest.mark.parametrize(("factor", "scale"), [(0.4, 2.5), (2.0, 1.0)])
def test_what_all_residuals_exceed_their_sigma_by_makes_none_a_gross_error(
    flight: Flight, factor: float, scale: float
) -> None:
    """And σ that are too large hide none: the scale is 1 at least."""
    found = parallaxes_of(flight)
    relative = relative_orientation(
        replace(found, by_image_points=factor**2 * found.by_image_points), CRITICAL
    )
    assert not relative.is_gross_error.any()
    assert relative.scale == pytest.approx(scale, rel=0.15 if factor < 1.0 else 0.0)
