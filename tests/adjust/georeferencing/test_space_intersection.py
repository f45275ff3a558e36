"""Errors of intersected points: derivatives against differences, common errors, propagation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources
from adjust.georeferencing.space_intersection import PointErrors, point_errors, rays_of
from adjust.parameters import ADDITIONAL_PARAMETERS, GNSS_SHIFT, OBJECT_POINT
from adjust.simulate.block import SimulatedBlock
from tests.adjust.georeferencing.flights import CALIBRATED, Flight, calibration_errors, fly, simulated
from tests.adjust.simulate.specifications import on_the_earth, small_specification, without_noise

STEPS = {
    "boresight": 1e-5,
    "lever_arm": 1e-2,
    "gnss_shift": 1e-2,
    "time_offset": 1e-4,
    "interior_orientation": 1e-6,
    ADDITIONAL_PARAMETERS: 1e-6,
}


@pytest.fixture(scope="module")
def exact() -> SimulatedBlock:
    noise = without_noise(small_specification()).noise
    return simulated(noise=noise, frame=on_the_earth(small_specification()).frame)


@pytest.fixture(scope="module")
def flight(exact: SimulatedBlock) -> Flight:
    return fly(exact, with_additional=True)


@pytest.fixture(scope="module")
def distorted(exact: SimulatedBlock) -> Flight:
    return fly(exact, with_additional=True, distorted=True)


def errors_of(flight: Flight, sources: ErrorSources, axes: Floats | None = None) -> PointErrors:
    points = flight.intersected()
    along = np.broadcast_to(np.eye(3), (len(points), 3, 3)) if axes is None else axes
    return point_errors(flight.rays, sources, points, along)


def test_without_noise_the_intersections_are_the_true_points() -> None:
    exact = fly(simulated(noise=without_noise(small_specification()).noise))
    assert np.abs(exact.intersected() - exact.simulated.truth.state.object_point).max() < 1e-8


@pytest.mark.parametrize("family", STEPS)
@pytest.mark.parametrize("name", ["flight", "distorted"])
def test_sensitivities_to_the_calibration_are_those_of_differences(
    name: str, family: str, request: pytest.FixtureRequest
) -> None:
    flight: Flight = request.getfixturevalue(name)
    parameters = flight.system[family].shape[1]
    unit = CalibrationErrors({family: np.arange(parameters)[None, :]}, np.eye(parameters))
    matrix = errors_of(flight, flight.sources(unit)).sensitivity.parameters.toarray()
    for component in range(parameters):
        change = np.zeros(parameters)
        change[component] = STEPS[family]
        ahead, behind = (flight.with_system(family, sign * change).intersected() for sign in (1.0, -1.0))
        numeric = (ahead - behind) / (2.0 * STEPS[family])
        found = matrix[:, component].reshape(-1, 3)
        # The weights stay while the geometry moves, which is of second order in the residuals.
        assert np.abs(numeric - found).max() < 2e-4 * np.abs(found).max(), (family, component)


def test_measured_points_with_a_distortion_lead_to_the_true_points(distorted: Flight) -> None:
    """But for the corrections, which are not in the measurements."""
    true = distorted.simulated.truth.state.object_point
    assert np.abs(distorted.intersected() - true).max() < 0.02
    plain = replace(distorted.rays, self_calibration=None)
    assert np.abs(replace(distorted, rays=plain).intersected() - true).max() > 1.0


def test_the_part_of_the_image_coordinates_is_that_of_their_weights(flight: Flight) -> None:
    """(Aᵀ P A)⁻¹ of coordinates of unlike σ, along other axes."""
    rays, points = flight.rays, flight.intersected()
    rays = replace(rays, sigma=np.random.default_rng(4).uniform(1e-6, 4e-6, rays.sigma.shape))
    axes = rotation.exp(np.random.default_rng(5).normal(size=(len(points), 3)))
    found = point_errors(rays, flight.sources(), points, axes).by_image_points
    equations = rays.linearize(replace(flight.orientations.state, object_point=points))
    jacobian = next(term.jacobian for term in equations.terms if term.block == OBJECT_POINT)
    for point in range(0, len(points), 7):
        own = np.flatnonzero(rays.point == point)
        matrix = (jacobian[own] / rays.sigma[own][:, :, None]).reshape(-1, 3) @ axes[point]
        np.testing.assert_allclose(found[point], np.linalg.inv(matrix.T @ matrix), rtol=1e-9)


def test_rays_that_are_given_to_other_points_keep_their_corrections(flight: Flight) -> None:
    offset = np.random.default_rng(4).normal(0.0, 1e-6, flight.rays.xy.shape)
    index = np.array([3, 9, 4])
    some = rays_of(replace(flight.rays, offset=offset), index, np.array([0, 0, 1]))
    np.testing.assert_array_equal(some.offset, offset[index])
    np.testing.assert_array_equal(some.xy, flight.rays.xy[index])


def test_sensitivities_to_gnss_and_ins_are_those_of_differences(flight: Flight) -> None:
    matrix = errors_of(flight, flight.sources()).sensitivity.images.toarray()
    image = 7
    step = np.array([1e-2, -1e-2, 2e-2])
    shifted = flight.gnss.observed.copy()
    shifted[image] += flight.gnss.local_from_enu[image] @ step
    ahead = replace(flight, gnss=replace(flight.gnss, observed=shifted)).intersected()
    predicted = matrix[:, 6 * image : 6 * image + 3] @ (step / flight.gnss.stochastic.sigma[image])
    numeric = (ahead - flight.intersected()).ravel()
    assert np.abs(numeric).max() > 1e-3
    assert np.abs(numeric - predicted).max() < 1e-3 * np.abs(numeric).max()


def test_a_shift_moves_all_points_alike_and_against_it(flight: Flight) -> None:
    shift = CalibrationErrors({GNSS_SHIFT: np.arange(3)[None, :]}, np.diag([0.02, 0.03, 0.05]) ** 2)
    points = errors_of(flight, flight.sources(shift))
    dense = points.sensitivity.parameters.toarray().reshape(-1, 3, 3)
    np.testing.assert_allclose(dense, np.broadcast_to(-np.eye(3), dense.shape), atol=1e-6)
    by_calibration = points.sensitivity.variance_by_calibration().reshape(-1, 3)
    np.testing.assert_allclose(
        by_calibration, np.tile([4e-4, 9e-4, 25e-4], (len(by_calibration), 1)), rtol=1e-5
    )


def test_errors_common_to_a_strip_do_not_average_out_within_it(flight: Flight) -> None:
    sources = flight.sources(strip=np.array([0.03, 0.03, 0.03, 0.0, 0.0, 0.0]))
    of_first_strip = flight.simulated.truth.plan.strip[flight.rays.image] == 0
    counts = np.bincount(flight.rays.point[of_first_strip], minlength=len(flight.intersected()))
    chosen = np.flatnonzero(of_first_strip & (counts >= 2)[flight.rays.point])
    name, point = np.unique(flight.rays.point[chosen], return_inverse=True)
    points = flight.intersected()[name]
    axes = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    alone = point_errors(rays_of(flight.rays, chosen, point), sources, points, axes).sensitivity
    # The verticals at the images of a strip differ by a base over the radius of the earth.
    np.testing.assert_allclose(alone.variance_by_strips(), 9e-4, rtol=1e-3)
    # Strips that cross pull in different ways, and their errors average out.
    together = errors_of(flight, sources).sensitivity.variance_by_strips().reshape(-1, 3)
    assert np.all(together[name, :2].mean(axis=0) < 0.7 * 9e-4)


def test_covariances_are_the_sum_of_their_parts_in_the_axes_asked_for(flight: Flight) -> None:
    sources = flight.sources(calibration_errors(CALIBRATED, 1e-4), np.full(6, 1e-5))
    local = errors_of(flight, sources)
    axes = np.array(flight.simulated.specification.frame.local_from_enu(flight.intersected()))
    enu = errors_of(flight, sources, axes)
    turned = np.swapaxes(axes, 1, 2) @ local.covariance() @ axes
    np.testing.assert_allclose(enu.covariance(), turned, rtol=1e-9, atol=1e-12)
    total = enu.sensitivity.variance().reshape(-1, 3)
    own = np.diagonal(enu.by_image_points, axis1=1, axis2=2)
    np.testing.assert_allclose(np.diagonal(enu.covariance(), axis1=1, axis2=2), own + total, rtol=1e-9)


def test_two_rays_of_a_point_are_its_intersection_in_a_model(flight: Flight) -> None:
    chosen = np.flatnonzero(flight.rays.point == 4)[:2]
    pair = rays_of(flight.rays, chosen, np.zeros(2, dtype=np.int64))
    point = flight.intersected()[4:5]
    all_rays = errors_of(flight, flight.sources())
    two_rays = point_errors(pair, flight.sources(), point, np.eye(3)[None])
    assert np.all(np.diagonal(two_rays.by_image_points[0]) >= np.diagonal(all_rays.by_image_points[4]))
