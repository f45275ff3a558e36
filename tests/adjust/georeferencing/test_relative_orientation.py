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


def test_models_with_few_points_are_not_tested(flight: Flight) -> None:
    found = parallaxes_of(flight)
    few = np.flatnonzero(found.common.model == 0)[:7]
    kept = replace(
        found,
        common=replace(
            found.common,
            model=found.common.model[few],
            left=found.common.left[few],
            right=found.common.right[few],
        ),
        parallax=found.parallax[few],
        by_image_points=found.by_image_points[few],
        sensitivity=found.sensitivity.only(few),
        of_relative_orientation=found.of_relative_orientation[few],
    )
    relative = relative_orientation(kept, CRITICAL)
    assert np.isnan(relative.residual).all()
    assert not relative.is_gross_error.any()
