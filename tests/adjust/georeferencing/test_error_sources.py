"""What calibrated parameters take from the sources of error of a flight, against full matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources, SharedErrors
from adjust.georeferencing.space_intersection import point_errors
from adjust.parameters import BORESIGHT, GNSS_SHIFT
from tests.adjust.georeferencing.flights import Flight, fly, simulated
from tests.adjust.georeferencing.test_correlated_noise import correlated

OF_STRIPS = np.array([0.02, 0.03, 0.04, 1e-4, 2e-4, 3e-4])


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(simulated())


def noise_of(flight: Flight) -> Floats:
    """(6 n, 6 n) errors of positions and attitudes from independent ones of unit variance."""
    n = flight.orientations.images
    sigma = np.hstack([flight.gnss.stochastic.sigma, flight.ins.stochastic.sigma]).ravel()
    process = flight.gnss.stochastic.over_time
    if process is None:
        return np.diag(sigma)
    age = np.abs(np.subtract.outer(process.time, process.time)) / process.correlation_time
    covariance = np.where(np.equal.outer(process.strip, process.strip), np.exp(-age), 0.0)
    order = np.lexsort((process.time, process.strip))
    root = np.zeros((n, n))
    root[np.ix_(order, order)] = np.linalg.cholesky(covariance[np.ix_(order, order)])
    return sigma[:, None] * np.kron(root, np.eye(6))


@pytest.mark.parametrize("seconds", [None, 20.0])
def test_parameters_take_from_every_source_what_their_adjustment_made_of_it(
    flight: Flight, seconds: float | None
) -> None:
    """Its standard deviations are not those of the prediction: K is of these, what is left is of those."""
    flown = flight if seconds is None else correlated(flight, seconds)
    random, k, c = np.random.default_rng(5), 3, 4
    strip, n = flight.simulated.truth.plan.strip, flown.orientations.images
    s = int(strip.max()) + 1
    shared = SharedErrors(
        of_images=random.normal(size=(k, n, 6)),
        of_survey=random.normal(size=(k, c, 3)),
        survey_spread=0.02 * np.tril(random.normal(size=(c, 3, 3))),
        in_adjustment=random.uniform(0.5, 2.0, (n, 6)),
        strips_in_adjustment=random.uniform(0.5, 2.0, (s, 6)) * OF_STRIPS,
        survey_in_adjustment=random.uniform(0.5, 2.0, (c, 3)),
    )
    noise, members = noise_of(flown), (strip[:, None] == np.arange(s)).astype(float)

    def by_sources(images: Floats, strips: Floats, survey: Floats) -> Floats:
        """(k, 6 n + 6 s + 3 c) with factors (n, 6), σ (s, 6) and factors (c, 3)."""
        of_images = (shared.of_images * images).reshape(k, -1) @ noise
        of_strips = np.einsum("kni,ns->ksi", shared.of_images, members) * strips
        spread = [shared.of_survey[:, j] * survey[j] @ shared.survey_spread[j] for j in range(c)]
        return np.hstack([of_images, of_strips.reshape(k, -1), *spread])

    known = by_sources(shared.in_adjustment, shared.strips_in_adjustment, shared.survey_in_adjustment)
    rest = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, -1.0], [0.0, -1.0, 2.0]])
    errors = CalibrationErrors({}, known @ known.T + rest, shared)
    sources = ErrorSources(flown.orientations, strip, OF_STRIPS, errors)
    taken = by_sources(np.ones((n, 6)), np.tile(OF_STRIPS, (s, 1)), np.ones((c, 3)))
    np.testing.assert_allclose(sources.taken, taken, atol=1e-9 * np.abs(taken).max())
    np.testing.assert_allclose(sources.factor @ sources.factor.T, rest, atol=1e-6)


def test_parameters_without_an_error_have_no_part_in_the_covariance(flight: Flight) -> None:
    """Some have a standard deviation of zero, others no place in the covariance at all."""
    points = flight.intersected()
    axes = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    columns = {BORESIGHT: np.array([[0, 1, 2]]), GNSS_SHIFT: np.array([[3, 4, 5]])}
    sigma = np.array([1e-4, 0.0, 2e-4, 0.05, 0.0, 0.1])
    covariance = np.diag(sigma**2)
    covariance[0, 3] = covariance[3, 0] = 0.6 * sigma[0] * sigma[3]
    full = CalibrationErrors(columns, covariance)
    np.testing.assert_allclose(full.factor @ full.factor.T, covariance, atol=1e-18)
    kept = np.flatnonzero(sigma)
    place = np.full(6, -1)
    place[kept] = np.arange(len(kept))
    fewer = CalibrationErrors(
        {family: place[column] for family, column in columns.items()}, covariance[np.ix_(kept, kept)]
    )
    one, other = (
        point_errors(flight.rays, flight.sources(errors), points, axes).sensitivity.variance_by_calibration()
        for errors in (full, fewer)
    )
    assert one.min() > 1e-6
    np.testing.assert_allclose(other, one, rtol=1e-9)


def test_sources_of_many_strips_are_counted(flight: Flight) -> None:
    assert flight.sources().strips == int(flight.simulated.truth.plan.strip.max()) + 1
    assert replace(flight.sources(), strip=np.full(3, -1)).strips == 0
