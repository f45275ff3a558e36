"""Predictions for a calibration from the same flight and from another one, against flights flown anew.

Errors of GNSS, INS, strips, control and image points are drawn for every flight; it is calibrated, and then
georeferenced directly with what its own calibration, or that of another flight, has found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.parameters import BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS, INTERIOR_ORIENTATION
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.system import SystemSpecification
from tests.adjust.georeferencing.calibrated_flights import CalibratedFlight, calibrated_flight
from tests.adjust.simulate.specifications import small_specification
from tests.adjust.simulate.test_calibration_covariances import calibration_flight

FIRST_SEED = 2_000
BIAS = 0.03
SYSTEM = SystemSpecification(
    boresight=(2e-3, -1e-3, 4e-3), gnss_shift=(-0.26, 0.12, 0.29), strip_bias=(BIAS, BIAS, BIAS)
)
FREE = (BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS)


def _calm(flown: SimulatedBlock) -> SimulatedBlock:
    """The flight without noise and without biases of its strips."""
    noise = replace(flown.specification.noise, level=0.0)
    state = flown.truth.state
    system = {**state.system, GNSS_STRIP_BIAS: np.zeros_like(state.system[GNSS_STRIP_BIAS])}
    truth = replace(flown.truth, state=replace(state, system=system))
    specification = replace(flown.specification, noise=noise)
    return replace(flown, specification=specification, truth=truth).measured_again(0)


@dataclass(frozen=True, eq=False)
class Flown:
    """Errors (R, m, 3) of the points of R flights; of their control against its survey (R, c, 3)."""

    calibrated: CalibratedFlight
    own: Floats
    others: Floats
    at_control: Floats

    @property
    def chance(self) -> float:
        """What the number of flights leaves to it, against 60 of them."""
        return float(np.sqrt(60 / len(self.own)))

    def ratio(self, errors: Floats, variance: Floats) -> Floats:
        """Root mean square of all points and flights over its prediction, by coordinate."""
        return np.asarray(np.sqrt(np.mean(errors**2, axis=(0, 1)) / np.mean(variance, axis=0)))

    def ratio_of_means(self, errors: Floats, *, same_flight: bool) -> Floats:
        """The same of the means over all points of a flight."""
        _, sensitivity = self.calibrated.predicted(same_flight=same_flight)
        m = errors.shape[1]
        predicted = [sensitivity.only(3 * np.arange(m) + k).variance_of_sum() / m**2 for k in range(3)]
        return np.asarray(np.sqrt(np.mean(errors.mean(axis=1) ** 2, axis=0) / predicted))


def _fly(flown: SimulatedBlock, free: tuple[str, ...], flights: int) -> Flown:
    calibrated = calibrated_flight(_calm(flown), free)
    truth, control = flown.truth, np.flatnonzero(~flown.truth.is_check)
    own, others, survey = [], [], []
    for seed in range(FIRST_SEED, FIRST_SEED + 2 * flights, 2):
        one, other = flown.flown_again(seed), flown.flown_again(seed + 1)
        own.append(calibrated.points(one, one))
        others.append(calibrated.points(one, other))
        true = truth.state.object_point[truth.surveyed[control]]
        survey.append(one.measured.surveyed[control] - true)
    errors = np.array(own)
    at_control = errors[:, calibrated.control] - np.array(survey)
    return Flown(calibrated, errors, np.array(others), at_control)


def _variance(flown: Flown, *, same_flight: bool) -> Floats:
    by_image_points, sensitivity = flown.calibrated.predicted(same_flight=same_flight)
    return by_image_points + sensitivity.variance().reshape(-1, 3)


@pytest.fixture(scope="module", params=[30, pytest.param(60, marks=pytest.mark.slow)])
def flown(request: pytest.FixtureRequest) -> Flown:
    return _fly(simulate_block(small_specification(system=SYSTEM)), FREE, request.param)


def test_the_prediction_knows_what_a_calibration_of_the_same_flight_has_seen(flown: Flown) -> None:
    joint, independent = (_variance(flown, same_flight=same) for same in (True, False))
    # Sixty flights leave 1 to 3 % to chance: all points of a flight share its errors.
    assert np.all(np.abs(flown.ratio(flown.own, joint) - 1.0) < 0.1 * flown.chance)
    assert np.all(np.abs(flown.ratio(flown.others, independent) - 1.0) < 0.1 * flown.chance)
    assert np.all(flown.ratio(flown.own, independent)[:2] < 0.9)
    assert np.all(np.abs(flown.ratio_of_means(flown.own, same_flight=True) - 1.0) < 0.3 * flown.chance)
    assert np.all(flown.ratio_of_means(flown.own, same_flight=False)[:2] < 0.5)


def test_differences_at_control_know_that_the_calibration_has_seen_its_survey(flown: Flown) -> None:
    by_image_points, sensitivity = flown.calibrated.predicted(same_flight=True, at_control=True)
    joint = by_image_points + sensitivity.variance().reshape(-1, 3)
    survey = np.array(flown.calibrated.simulated.specification.noise.control) ** 2
    independent = _variance(flown, same_flight=False)[flown.calibrated.control] + survey
    assert np.all(np.abs(flown.ratio(flown.at_control, joint) - 1.0) < 0.1 * flown.chance)
    assert np.all(flown.ratio(flown.at_control, independent)[:2] < 0.85)


def test_traces_and_sums_with_shared_sources_are_those_of_the_full_covariance(flown: Flown) -> None:
    _, every = flown.calibrated.predicted(same_flight=True, at_control=True)
    few = every.only(np.arange(12))
    matrix = few.matrix().toarray()
    covariance = matrix @ matrix.T
    np.testing.assert_allclose(few.variance(), np.diagonal(covariance), rtol=1e-9)
    assert few.trace_of_square() == pytest.approx(np.trace(covariance @ covariance), rel=1e-9)
    assert few.variance_of_sum() == pytest.approx(covariance.sum(), rel=1e-9)
    drawn = few.draws(np.random.default_rng(4), 20_000)
    np.testing.assert_allclose(np.mean(drawn**2, axis=1), np.diagonal(covariance), rtol=0.06)


def test_a_calibration_keeps_its_covariance_whatever_it_shares(flown: Flown) -> None:
    _, sensitivity = flown.calibrated.predicted(same_flight=True)
    covariance = flown.calibrated.errors.covariance
    scale = np.sqrt(np.diagonal(covariance))
    found = sensitivity.covariance_of_calibration / np.outer(scale, scale)
    np.testing.assert_allclose(found, covariance / np.outer(scale, scale), atol=1e-6)


def _calibration_flight() -> tuple[SimulatedBlock, tuple[str, ...]]:
    return calibration_flight(), (INTERIOR_ORIENTATION, *FREE)


def _small_flight() -> tuple[SimulatedBlock, tuple[str, ...]]:
    return simulate_block(small_specification(system=SYSTEM)), FREE


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("fly", [_small_flight, _calibration_flight])
def test_actual_over_predicted_is_one_to_five_per_cent(fly: object) -> None:
    assert callable(fly)
    found = _fly(*fly(), 200)
    own = found.ratio(found.own, _variance(found, same_flight=True))
    others = found.ratio(found.others, _variance(found, same_flight=False))
    wrong = found.ratio(found.own, _variance(found, same_flight=False))
    print("same", np.round(own, 3), "other", np.round(others, 3), "as independent", np.round(wrong, 3))
    for ratio in (own, others):
        assert np.all(np.abs(ratio - 1.0) < 0.05)
