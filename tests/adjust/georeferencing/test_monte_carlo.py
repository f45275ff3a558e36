"""Predictions against 100 flights, 300 in the slow tests.

Noise, errors common to strips and those of the calibration are drawn for each; its seed is its number. All
limits below are passed by 99.9 % of correct programs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.georeferencing.error_sources import CalibrationErrors, ErrorSources
from adjust.georeferencing.predicted_rms import PredictedRms, predicted_largest, predicted_rms
from adjust.georeferencing.space_intersection import point_errors
from adjust.georeferencing.y_parallax import common_points, consecutive_images, y_parallaxes
from adjust.parameters import BORESIGHT, GNSS_SHIFT, INTERIOR_ORIENTATION
from tests.adjust.georeferencing.flights import Flight, fly, simulated
from tests.adjust.simulate.specifications import small_specification, without_noise

FEW, MANY = 100, 300
STRIP = np.array([0.03, 0.03, 0.04, *np.deg2rad([0.002, 0.002, 0.004])])


def calibration() -> CalibrationErrors:
    """Errors of c, x0, y0, boresight and shift as a calibration flight leaves them, c and s_z correlated."""
    sigma = np.array([1e-6, 0.5e-6, 0.5e-6, *np.deg2rad([0.002, 0.002, 0.004]), 0.02, 0.02, 0.04])
    correlation = np.eye(9)
    correlation[0, 8] = correlation[8, 0] = -0.8
    columns = {
        INTERIOR_ORIENTATION: np.array([[0, 1, 2]]),
        BORESIGHT: np.array([[3, 4, 5]]),
        GNSS_SHIFT: np.array([[6, 7, 8]]),
    }
    return CalibrationErrors(columns, correlation * np.outer(sigma, sigma))


@dataclass(frozen=True, eq=False)
class Predicted:
    """What the flight without noise predicts for its points and parallaxes, and what the flights show."""

    variance_of_points: Floats
    rms_of_points: tuple[PredictedRms, ...]
    variance_of_parallaxes: Floats
    rms_of_parallaxes: PredictedRms
    largest_parallax: tuple[float, float]
    errors_of_points: Floats
    parallaxes: Floats

    @property
    def flights(self) -> int:
        return len(self.parallaxes)

    def assert_variances(self, errors: Floats, variance: Floats) -> None:
        """The mean square of every error is χ² of the flights; so many share the alarm rate."""
        ratio = np.mean(errors**2, axis=0) / variance
        tail = 0.5e-3 / ratio.size
        low, high = stats.chi2.ppf([tail, 1.0 - tail], self.flights) / self.flights
        assert low < ratio.min()
        assert ratio.max() < high
        assert abs(ratio.mean() - 1.0) < 0.05 * np.sqrt(MANY / self.flights)


@pytest.fixture(scope="module", params=[FEW, pytest.param(MANY, marks=pytest.mark.slow)])
def found(request: pytest.FixtureRequest) -> Predicted:
    exact = fly(simulated(noise=without_noise(small_specification()).noise))
    noisy = simulated()
    sources = exact.sources(calibration(), STRIP)
    plan = exact.simulated.truth.plan
    models = consecutive_images(plan.strip, exact.simulated.truth.trajectory.time)
    common = common_points(exact.rays, models)
    truth = exact.intersected()
    axes = np.broadcast_to(np.eye(3), (len(truth), 3, 3))
    points = point_errors(exact.rays, sources, truth, axes)
    own = np.diagonal(points.by_image_points, axis1=1, axis2=2)
    rows = np.arange(len(truth))
    parallaxes = y_parallaxes(exact.rays, sources, common)
    largest = predicted_largest(parallaxes.sensitivity, parallaxes.by_image_points)
    errors, seen = [], []
    for number in range(request.param):
        flown = _flown(fly(noisy.measured_again(number)), sources, number)
        errors.append(flown.intersected() - truth)
        seen.append(
            y_parallaxes(flown.rays, replace(sources, orientations=flown.orientations), common).parallax
        )
    return Predicted(
        own + points.sensitivity.variance().reshape(-1, 3),
        tuple(predicted_rms(points.sensitivity.only(3 * rows + k), own[:, k]) for k in range(3)),
        parallaxes.variance(),
        predicted_rms(parallaxes.sensitivity, parallaxes.by_image_points),
        (largest.median, largest.limit),
        np.array(errors),
        np.array(seen),
    )


def _flown(flight: Flight, sources: ErrorSources, number: int) -> Flight:
    """A flight with errors common to strips in its observations, and with a wrong calibration."""
    random = np.random.default_rng((number, 1))
    common = (random.standard_normal((4, 6)) * STRIP)[flight.simulated.truth.plan.strip]
    shift = np.einsum("nij,nj->ni", flight.gnss.local_from_enu, common[:, :3])
    flight = replace(
        flight,
        gnss=replace(flight.gnss, observed=flight.gnss.observed + shift),
        ins=replace(flight.ins, observed=flight.ins.observed @ rotation.exp(common[:, 3:])),
    )
    wrong = sources.calibration.factor @ random.standard_normal(9)
    for family, columns in sources.calibration.columns.items():
        flight = flight.with_system(family, wrong[columns[0]])
    return flight


def inside(rms: Floats, predicted: PredictedRms, confidence: float = 0.95) -> float:
    """Share of root mean squares (k,) within their limits."""
    low, high = predicted.limits(confidence)
    return float(np.mean((rms > low) & (rms < high)))


def test_the_variances_of_points_are_those_predicted(found: Predicted) -> None:
    found.assert_variances(found.errors_of_points, found.variance_of_points)


def test_the_rms_of_points_keeps_its_limits_as_often_as_they_say(found: Predicted) -> None:
    for axis in range(3):
        rms = np.sqrt(np.mean(found.errors_of_points[:, :, axis] ** 2, axis=1))
        share = inside(rms, found.rms_of_points[axis])
        assert share == pytest.approx(0.95, abs=3.3 * np.sqrt(0.95 * 0.05 / found.flights))
        mean = found.errors_of_points[:, :, axis].mean(axis=1)
        statistic = np.sum((mean / found.rms_of_points[axis].sigma_of_mean) ** 2)
        low, high = stats.chi2.ppf([5e-4, 1.0 - 5e-4], found.flights)
        assert low < statistic < high


def test_points_counted_as_independent_would_promise_too_much(found: Predicted) -> None:
    """What is common to all images makes an RMS of 150 points worth that of a few."""
    points = found.errors_of_points.shape[1]
    for axis, predicted in enumerate(found.rms_of_points):
        rms = np.sqrt(np.mean(found.errors_of_points[:, :, axis] ** 2, axis=1))
        assert predicted.degrees_of_freedom < 0.2 * points
        assert inside(rms, replace(predicted, degrees_of_freedom=float(points))) < 0.6


def test_the_variances_of_parallaxes_are_those_predicted(found: Predicted) -> None:
    found.assert_variances(found.parallaxes, found.variance_of_parallaxes)
    rms = np.sqrt(np.mean(found.parallaxes**2, axis=1))
    assert inside(rms, found.rms_of_parallaxes) == pytest.approx(
        0.95, abs=3.3 * np.sqrt(0.95 * 0.05 / found.flights)
    )


def test_the_largest_parallax_exceeds_its_median_in_half_of_the_flights(found: Predicted) -> None:
    largest = np.abs(found.parallaxes).max(axis=1)
    median, limit = found.largest_parallax
    # The prediction itself is from 200 draws.
    assert np.mean(largest > median) == pytest.approx(
        0.5, abs=3.3 * np.sqrt(0.25 / found.flights + 0.25 / 200)
    )
    assert np.mean(largest > limit) == pytest.approx(
        0.05, abs=3.3 * np.sqrt(0.05 * 0.95 * (1 / found.flights + 1 / 200))
    )
