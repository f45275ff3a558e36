"""σ and degrees of freedom of two-step means: closed cases, and flights that are adjusted on control alone.

Error over σ of a few strips follows Student's t, whose mean square does not exist with four strips. So it is
turned into what a normal variable would have in its place, z = Φ⁻¹(F_t,ν(error/σ)), with the ν that is
stated; the root mean square of z over R flights lies in √(χ²_R/R).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from adjust.arrays import Floats
from adjust.calibration.mean_variance import _mixture, mean_sigma, widening
from adjust.calibration.orientation_differences import OrientationDifferences
from adjust.calibration.two_step import two_step_calibration
from tests.adjust.calibration.strips_flown import RULE
from tests.adjust.calibration.two_step_flights import TwoStepFlight, two_step_flight

FIRST_SEED = 1_000


def test_without_known_errors_sigma_is_the_scatter_and_has_one_freedom_less_than_strips() -> None:
    strips = np.random.default_rng(1).normal(size=5)
    found = mean_sigma(strips, np.zeros((5, 5)), np.full(5, 7))
    assert found.sigma == pytest.approx(strips.std(ddof=1) / np.sqrt(5), rel=1e-4)
    assert found.freedom == pytest.approx(4.0, rel=1e-3)
    assert found.known == 0.0
    # Strips weigh with their exposures.
    weighted = mean_sigma(strips, np.zeros((5, 5)), np.array([1, 1, 2, 3, 9]))
    assert weighted.sigma == pytest.approx(strips.std(ddof=1) * np.sqrt(96.0) / 16.0, rel=1e-4)
    equal = mean_sigma(np.zeros(4), np.zeros((4, 4)), np.ones(4))
    assert (equal.sigma, equal.freedom, equal.known) == (0.0, 3.0, 0.0)
    two = mean_sigma(np.array([1.0, 3.0]), np.zeros((2, 2)), np.ones(2))
    assert (two.sigma, two.freedom) == pytest.approx((1.0, 1.0), rel=1e-3)


@pytest.mark.parametrize("freedom", [6, 60, 2000])
def test_the_variances_of_strips_are_those_of_the_inverse_chi_squared_distribution(freedom: int) -> None:
    """Closed case without known errors: mean Σ / (ν − 2), relative variance 2 / (ν − 4)."""
    variance, mass = _mixture(np.full(freedom, 2.0), np.zeros(freedom))
    mean = float(mass @ variance)
    assert mean == pytest.approx(2.0 * freedom / (freedom - 2.0), rel=1e-3)
    relative = float(mass @ (variance / mean - 1.0) ** 2)
    assert relative == pytest.approx(2.0 / (freedom - 4.0), rel=0.02)


def test_the_stated_intervals_hold_what_they_say_of_the_mixture() -> None:
    """Strips of unlike weights and a full matrix of known errors, without contrasts or eigenvectors.

    Each value of χ² belongs to the s² at which dᵀ (V⁻¹ − V⁻¹ 1 1ᵀ V⁻¹ / 1ᵀ V⁻¹ 1) d with V = s² I + Q has it.
    """
    random = np.random.default_rng(4)
    half = random.normal(size=(4, 4))
    strips, covariance = 2.0 * random.normal(size=4), half @ half.T
    count = np.array([3, 9, 5, 1])
    variances = np.geomspace(1e-6, 1e6, 1000)
    inverse = np.linalg.inv(variances[:, None, None] * np.eye(4) + covariance)
    of_one = inverse.sum(axis=2)
    squares = strips @ inverse @ strips - (of_one @ strips) ** 2 / of_one.sum(axis=1)
    chi = stats.chi2.ppf((np.arange(4000) + 0.5) / 4000, 3)
    variance = np.exp(np.interp(-chi, -squares, np.log(variances)))
    share = count / 18.0
    sigma = np.sqrt(variance * (share @ share) + share @ covariance @ share)
    found = mean_sigma(strips, covariance, count)
    assert found.known == pytest.approx(np.sqrt(share @ covariance @ share))
    for level in (stats.norm.cdf(1.0), 0.975):
        limit = found.sigma * stats.t.ppf(level, found.freedom)
        assert stats.norm.cdf(limit / sigma).mean() == pytest.approx(level, abs=5e-4)


def test_an_error_common_to_all_strips_adds_to_the_variance_and_not_to_the_scatter() -> None:
    strips = np.random.default_rng(2).normal(size=6)
    alone = mean_sigma(strips, np.zeros((6, 6)), np.ones(6))
    small = mean_sigma(strips, np.full((6, 6), 1e-4), np.ones(6))
    large = mean_sigma(strips, np.full((6, 6), 100.0), np.ones(6))
    assert small.sigma == pytest.approx(alone.sigma, rel=1e-3)
    assert large.sigma == pytest.approx(10.0, rel=0.01)
    assert large.known == pytest.approx(10.0)
    assert large.freedom > 100.0
    # Without any scatter nothing else is left.
    known = mean_sigma(np.ones(6), np.full((6, 6), 4.0), np.ones(6))
    assert known.sigma == pytest.approx(2.0)
    assert known.freedom > 1e5


def test_known_errors_of_each_strip_alone_are_found_in_the_scatter_again() -> None:
    """Strips that scatter as much as the adjustment says have nothing more of their own."""
    random = np.random.default_rng(3)
    strips, known = random.normal(size=400), np.eye(400)
    assert mean_sigma(strips, known, np.ones(400)).sigma == pytest.approx(1.0 / 20.0, rel=0.05)


def test_what_widens_a_sigma_is_students_quantile() -> None:
    assert widening(3.0) == pytest.approx(3.18245 / 1.95996, rel=1e-5)
    assert widening(1.0) == pytest.approx(12.7062 / 1.95996, rel=1e-5)
    assert widening(3.0, 0.995) == pytest.approx(5.84091 / 2.57583, rel=1e-5)
    np.testing.assert_array_equal(widening(np.array([np.inf, np.nan])), 1.0)


def normal_scores(
    flight: TwoStepFlight, all_differences: list[OrientationDifferences], *, known: bool
) -> tuple[Floats, Floats]:
    """z (R, 9) of the means of flights whose true values are zero, and plain error over σ."""
    scores, ratios = [], []
    for differences in all_differences:
        mean = two_step_calibration(differences, RULE, flight.errors if known else None).groups[0]
        ratio = mean.mean.robust / mean.sigma
        scores.append(stats.norm.ppf(stats.t.cdf(ratio, mean.freedom)))
        ratios.append(ratio)
    return np.array(scores), np.array(ratios)


def flown(flight: TwoStepFlight, flights: int) -> list[OrientationDifferences]:
    """The differences of so many flights, each with errors of its own."""
    seeds = range(FIRST_SEED, FIRST_SEED + flights)
    return [flight.differences(flight.simulated.flown_again(seed)) for seed in seeds]


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def test_sigma_of_four_strips_holds_with_the_errors_they_have_in_common() -> None:
    flight, flights = two_step_flight(4), 20
    differences = flown(flight, flights)
    scores, _ = normal_scores(flight, differences, known=True)
    without, _ = normal_scores(flight, differences, known=False)
    high = np.sqrt(stats.chi2.ppf(1.0 - 5e-4, flights) / flights)
    assert np.all(_rms(scores) < high)
    assert np.all(_rms(scores) > 0.6)
    # In height all strips have it in common, and Student's t alone does not cover it.
    assert _rms(without)[8] > _rms(scores)[8]


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("strips", [4, 8, 20])
def test_errors_over_sigma_stay_within_their_band(strips: int) -> None:
    flights = 200
    flight = two_step_flight(strips)
    scores, ratios = normal_scores(flight, flown(flight, flights), known=True)
    low, high = np.sqrt(stats.chi2.ppf([0.005, 0.995], flights) / flights)
    print(strips, "strips: z", np.round(_rms(scores), 3), "error/σ", np.round(_rms(ratios), 3))
    assert np.all(_rms(scores) < high)
    # Four strips leave open what they have of their own beside the adjustment: where that is little, σ is too
    # large, see docs/theory/two-step.md.
    assert np.all(_rms(scores) > (0.8 if strips == 4 else low))
    beyond = np.abs(scores) > stats.norm.ppf(0.995)
    print("beyond the 99 % limits:", beyond.sum(axis=0), "of", flights)
    assert np.all(beyond.sum(axis=0) <= stats.binom.ppf(0.9995, flights, 0.01))
