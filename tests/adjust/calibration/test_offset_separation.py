"""Lever arm, shift or both: nested tests against by-hand models, their error rates, and their power."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from scipy import stats

from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.offset_separation import OffsetSeparation, separated_offset
from adjust.calibration.strip_offsets import body_fixed, estimable, linear_fit, map_fixed, nested_test
from tests.adjust.calibration.strips_flown import remounted, strips_flown

BACK_AND_FORTH = (0.0, 180.0)


def separation(
    seed: int, lever_arm: Any = (0.0, 0.0), shift: Any = (0.0, 0.0), **more: Any
) -> OffsetSeparation:
    flights = more.pop("flights", (8,))
    more = {"position_m": 0.02, "headings_deg": BACK_AND_FORTH, "shifts": (shift,) * 3} | more
    strips = strips_flown(np.random.default_rng(seed), flights, lever_arm=lever_arm, **more)
    return separated_offset(strips, np.zeros(sum(flights), dtype=np.int64), 0.01)


def verdicts(trials: int, **more: Any) -> Counter[str]:
    return Counter(separation(seed, **more).verdict for seed in range(trials))


def test_a_shift_against_none_is_the_f_test_of_a_mean() -> None:
    values = np.random.default_rng(1).normal(0.3, 1.0, 12)
    found = nested_test(np.zeros((12, 0)), np.ones((12, 1)), values)
    assert (found.freedom, found.variance_freedom) == (1, 11)
    assert found.probability == pytest.approx(stats.ttest_1samp(values, 0.0).pvalue)
    assert found.chi_squared == pytest.approx(stats.ttest_1samp(values, 0.0).statistic ** 2)


def test_an_error_common_to_all_values_makes_the_test_of_their_mean_weaker() -> None:
    """Closed case: the variance of the mean of twelve is s²/12 and that of the common error."""
    values = np.random.default_rng(1).normal(0.3, 1.0, 12)
    found = nested_test(np.zeros((12, 0)), np.ones((12, 1)), values, np.full((12, 12), 0.2))
    statistic = values.mean() ** 2 / (values.var(ddof=1) / 12.0 + 0.2)
    assert found.chi_squared == pytest.approx(statistic)
    assert found.probability == pytest.approx(stats.f.sf(statistic, 1, 11))
    # What is each value's own is in the scatter already.
    own = nested_test(np.zeros((12, 0)), np.ones((12, 1)), values, 0.2 * np.eye(12))
    assert own.chi_squared == pytest.approx(stats.ttest_1samp(values, 0.0).statistic ** 2)


def test_known_errors_are_not_counted_twice_where_the_scatter_shows_them() -> None:
    """Closed case: residuals as large as s² and the known errors make them; s² Q and theirs are left."""
    random, variance = np.random.default_rng(2), 0.7
    design, known = random.normal(size=(12, 3)), 0.1 + np.diag(random.uniform(0.0, 1.0, 12))
    inverse = np.linalg.pinv(design)
    left = np.eye(12) - design @ inverse
    residual = left @ random.normal(size=12)
    residual *= np.sqrt(np.trace(left @ (variance * np.eye(12) + known)) / (residual @ residual))
    fit = linear_fit(design, design @ [1.0, 2.0, 3.0] + residual)
    expected = variance * inverse @ inverse.T + inverse @ known @ inverse.T
    np.testing.assert_allclose(fit.covariance(design, known), expected, atol=1e-12)


def test_forward_is_east_for_a_strip_flown_to_the_east() -> None:
    design = body_fixed(np.array([np.pi / 2]), np.array([0]))
    np.testing.assert_allclose(design @ [1.0, 0.0], [1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(design @ [0.0, 1.0], [0.0, -1.0], atol=1e-15)


def test_without_errors_both_come_back_exactly() -> None:
    found = separation(1, (0.3, -0.2), (0.5, 0.1), position_m=0.0)
    assert found.verdict == "both"
    np.testing.assert_allclose(found.lever_arm, [0.3, -0.2], atol=1e-12)
    np.testing.assert_allclose(found.shift, [0.5, 0.1], atol=1e-12)


def test_an_error_common_to_all_strips_is_one_of_the_shift_alone() -> None:
    strips = strips_flown(np.random.default_rng(3), (8,), headings_deg=BACK_AND_FORTH)
    covariance = np.zeros((8, 6, 8, 6))
    covariance[:, 3, :, 3], covariance[:, 4, :, 4] = 0.05**2, 0.02**2
    none = np.zeros(8, dtype=np.int64)
    plain, found = (separated_offset(strips, none, 0.01, of) for of in (None, StripErrors(covariance)))
    np.testing.assert_allclose(found.shift_sigma, np.hypot(plain.shift_sigma, [0.05, 0.02]))
    np.testing.assert_allclose(found.lever_arm_sigma, plain.lever_arm_sigma)


def test_both_lie_within_their_standard_deviations() -> None:
    """200 flights of 8 strips: the mean square of error/σ is that of Student's t with 12, 12 / 10."""
    squares = []
    for seed in range(200):
        found = separation(seed, (0.3, -0.2), (0.5, 0.1))
        squares.append(((found.lever_arm - [0.3, -0.2]) / found.lever_arm_sigma) ** 2)
        squares.append(((found.shift - [0.5, 0.1]) / found.shift_sigma) ** 2)
    assert np.mean(squares) == pytest.approx(1.2, abs=0.2)


def test_an_offset_of_each_kind_is_called_what_it_is() -> None:
    """Four centimetres, strips of two: one of the two axes alone would not tell, or tell wrongly."""
    trials = 100
    assert verdicts(trials, lever_arm=(0.04, 0.0))["body"] > 0.85 * trials
    assert verdicts(trials, shift=(0.04, 0.0))["map"] > 0.85 * trials
    assert verdicts(trials, lever_arm=(0.04, 0.0), shift=(0.0, 0.04))["both"] > 0.85 * trials


@pytest.mark.parametrize("trials", [200, pytest.param(4000, marks=pytest.mark.slow)])
def test_without_an_offset_none_is_called_for_with_the_stated_probability(trials: int) -> None:
    """A lever arm and a shift in 2.5 % each; any other probability comes as often as it says."""
    found = [separation(seed) for seed in range(trials)]
    for name, of_it in (("lever_arm", ("body", "both")), ("shift", ("map", "both"))):
        probability = np.array([item.tests[name].probability for item in found])
        np.testing.assert_array_equal([item.verdict in of_it for item in found], probability < 0.025)
        assert stats.kstest(probability, "uniform").pvalue > 1e-3
    called = sum(item.verdict in ("body", "map", "both") for item in found)
    assert abs(called - 0.05 * trials) < 4.0 * np.sqrt(trials * 0.05 * 0.95)
    assert sum(item.verdict == "neither" for item in found) > 0.9 * trials


@pytest.mark.parametrize("flights", [70, pytest.param(200, marks=pytest.mark.slow)])
def test_a_lever_arm_is_found_with_the_power_that_the_strips_allow(flights: int) -> None:
    """10 strips with 3 cm of noise, test at 5 %: of 1,000 flights 3 cm in 0.76, 6 cm in all.

    Without a lever arm probabilities are uniform, see above.
    """

    def found(lever_arm: float, trials: int) -> float:
        tests = [
            separation(seed, (lever_arm, 0.0), flights=(10,), position_m=0.03).tests["lever_arm"]
            for seed in range(trials)
        ]
        return float(np.mean([test.probability < 0.05 for test in tests]))

    assert found(0.03, flights) > 0.76 - 3.6 * np.sqrt(0.76 * 0.24 / flights)
    assert found(0.06, flights) > 0.97


def test_in_one_direction_a_large_offset_stays_undecided() -> None:
    found = separation(3, (0.5, 0.0), headings_deg=(10.0,))
    assert found.verdict == "undecided"
    assert not found.tests["lever_arm"].testable
    assert found.tests["offset"].probability < 1e-6
    assert np.isnan(found.lever_arm).all()


def test_in_one_direction_no_offset_is_called_for_where_strips_are_enough_to_say_so() -> None:
    found = separation(3, headings_deg=(10.0,), flights=(8,))
    assert found.tests["offset"].probability > 0.025
    assert found.verdict == "neither"
    assert separation(3, headings_deg=(10.0,), flights=(1,)).verdict == "undecided"


def test_in_directions_that_hardly_differ_an_offset_stays_undecided() -> None:
    found = separation(3, shift=(0.06, 0.0), headings_deg=(10.0, 30.0))
    assert found.tests["lever_arm"].testable
    assert found.tests["shift"].testable
    assert found.tests["offset"].probability < 0.001
    assert found.verdict == "undecided"


def test_in_one_direction_shifts_that_differ_by_flight_do_not_decide() -> None:
    shifts = ((0.3, 0.0), (-0.2, 0.0))
    found = separation(3, headings_deg=(10.0,), flights=(8, 8), shifts=shifts)
    assert found.tests["shift_by_flight"].probability < 1e-6
    assert found.verdict == "undecided"


def test_shifts_of_two_flights_do_not_pass_for_scatter() -> None:
    """Half a metre apart: taken for one shift they would hide a lever arm of 5 cm."""
    shifts = ((0.3, 0.0), (-0.2, 0.0))
    found = separation(4, (0.05, 0.0), flights=(8, 8), shifts=shifts)
    assert found.tests["shift_by_flight"].probability < 1e-6
    assert found.verdict == "both"
    assert found.tests["lever_arm_by_flight"].probability > 0.01


def test_mountings_are_tested_against_each_other() -> None:
    strips = strips_flown(np.random.default_rng(5), (8, 8))
    remounted(strips, strips.flight == 1, (0.004, 0.0, 0.0), (0.2, 0.0))
    tests = separated_offset(strips, strips.flight, 0.01).tests
    assert tests["roll_by_mounting"].probability < 1e-6
    assert tests["lever_arm_by_mounting"].probability < 1e-6
    assert tests["pitch_by_mounting"].probability > 1e-3


def test_what_a_design_leaves_open_is_not_estimable() -> None:
    heading, one = np.zeros(4), np.zeros(4, dtype=np.int64)
    design = np.hstack([map_fixed(one), body_fixed(heading, one)])
    # A lever arm to the right is a shift to the east of strips flown to the north.
    contrasts = np.array([[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(estimable(design, contrasts), [False, True])
    assert linear_fit(design, np.ones(8)).freedom == 6
    # Of two flights in one direction the shifts go with the lever arm, however many strips each has.
    design = np.hstack(
        [map_fixed(np.repeat([0, 1], [2, 9])), body_fixed(np.full(11, 0.3), np.zeros(11, int))]
    )
    moved = np.hstack(
        [np.kron(np.eye(2), np.eye(2)), np.tile(body_fixed(np.array([0.3]), np.zeros(1)), (2, 1))]
    )
    assert estimable(design, moved).all()
    assert estimable(design, moved[:2] - moved[2:]).all()
    assert not estimable(design, moved + 0.01 * np.eye(4, 6, 2)).any()


def test_a_lever_arm_is_estimated_next_to_the_shifts_that_flights_have() -> None:
    """Half a metre apart and more strips to the north than to the south: one shift would move it by 4 cm."""
    shifts, true, squares = np.array([[0.3, -0.1], [-0.2, 0.2]]), [0.3, -0.2], []
    for seed in range(100):
        more = {"flights": (5, 4), "headings_deg": (0.0, 180.0, 0.0), "shifts": shifts}
        found = separation(seed, true, **more)
        assert (found.verdict, found.freedom) == ("both", 12)
        assert np.all(found.lever_arm_sigma < 0.02)
        squares.append(((found.lever_arm - true) / found.lever_arm_sigma) ** 2)
        np.testing.assert_allclose(found.shift, np.array([5, 4]) @ shifts / 9.0, atol=0.03)
        # How flights differ is a part of what is not known of the shift of all.
        assert np.all(found.shift_sigma > 0.03)
    assert np.mean(squares) == pytest.approx(12.0 / 10.0, abs=0.3)


def test_shifts_of_flights_in_one_direction_each_leave_no_lever_arm() -> None:
    """North, south, north: with a shift of each flight there is none, and with one for all a wrong one."""
    heading = np.repeat([0.0, 180.0, 0.0], 5)
    shifts = ((0.3, 0.0), (-0.2, 0.0), (0.1, 0.3))
    found = separation(2, (0.3, 0.0), flights=(5, 5, 5), headings_deg=heading, shifts=shifts)
    assert found.tests["shift_by_flight"].probability < 1e-6
    assert found.verdict == "undecided"
    for values in (found.lever_arm, found.lever_arm_sigma, found.shift, found.shift_sigma):
        assert np.isnan(values).all()


@pytest.mark.parametrize(("apart_deg", "separable"), [(4.4, False), (4.8, True)])
def test_two_directions_separate_lever_arm_and_shift_from_some_degrees_on(
    apart_deg: float, separable: bool
) -> None:
    """Their singular values have the ratio tan(δ/4); 2 % are 4.6°."""
    heading, one = np.deg2rad(np.tile([20.0, 20.0 + apart_deg], 5)), np.zeros(10, dtype=np.int64)
    design = np.hstack([map_fixed(one), body_fixed(heading, one)])
    assert linear_fit(design, np.ones(20)).freedom == (16 if separable else 18)
    assert estimable(design, np.array([[0.0, 0.0, 1.0, 0.0]]))[0] == separable


def test_scatter_is_told_from_rounding() -> None:
    """Values of ten kilometres that scatter by a millimetre are tested; those that do not are certain."""
    random = np.random.default_rng(7)
    one, line = np.ones((12, 1)), np.column_stack([np.ones(12), np.arange(12.0)])
    values = 1e4 + 1e-3 * random.normal(size=12)
    expected = stats.linregress(np.arange(12.0), values)
    found = nested_test(one, line, values)
    assert found.probability == pytest.approx(expected.pvalue, rel=1e-4)
    assert nested_test(one, line, np.full(12, 1e4 / 3.0)).probability == 1.0
    assert nested_test(one, line, 1e4 + np.arange(12.0) / 3.0).probability == 0.0


def test_known_errors_larger_than_the_scatter_leave_no_variance_of_their_own() -> None:
    design, values = np.random.default_rng(2).normal(size=(12, 3)), np.random.default_rng(3).normal(size=12)
    inverse = np.linalg.pinv(design)
    known = 100.0 * np.eye(12)
    found = linear_fit(design, values).covariance(design, known)
    np.testing.assert_allclose(found, inverse @ known @ inverse.T)
    assert np.isnan(linear_fit(design[:3], values[:3]).variance)


@pytest.mark.parametrize("in_decrease", [True, False])
def test_known_errors_enlarge_the_variance_by_what_they_add_to_the_decrease(in_decrease: bool) -> None:
    """By projectors of pseudo-inverses: three unknowns more, and errors in their space or beyond it."""
    random = np.random.default_rng(8)
    larger, values = random.normal(size=(14, 5)) * [1.0, 5.0, 0.2, 1.0, 3.0], random.normal(size=14)
    smaller = larger[:, :2]
    of_large, of_small = (design @ np.linalg.pinv(design) for design in (larger, smaller))
    seen = larger if in_decrease else np.linalg.svd(larger)[0][:, 5:]
    half = 0.3 * (seen @ random.normal(size=(seen.shape[1], 9)) + 0.1 * random.normal(size=(14, 9)))
    known = half @ half.T
    left = values - of_large @ values
    added = np.trace((of_large - of_small) @ known) / 3.0 - np.trace(known - of_large @ known) / 9.0
    assert (added > 0.0) == in_decrease
    variance = left @ left / 9.0 + max(added, 0.0)
    expected = values @ (of_large - of_small) @ values / variance
    found = nested_test(smaller, larger, values, known)
    assert found.chi_squared == pytest.approx(expected)
    assert found.probability == pytest.approx(stats.f.sf(expected / 3.0, 3, 9))


def test_without_redundancy_nothing_is_tested() -> None:
    random = np.random.default_rng(9)
    found = nested_test(random.normal(size=(4, 2)), np.eye(4), random.normal(size=4))
    assert (found.testable, found.freedom, found.variance_freedom) == (False, 2, 0)


@pytest.mark.parametrize("with_errors", [False, True])
@pytest.mark.parametrize("second", [(0.33, -0.1), (-0.2, 0.2)])
def test_every_test_is_that_of_designs_written_down(second: tuple[float, float], with_errors: bool) -> None:
    """Two flights with one shift or two, three strips of another mounting, errors of the adjustment."""
    random, k = np.random.default_rng(31), 17
    headings = (0.0, 180.0, 90.0, 270.0)
    strips = strips_flown(random, (8, 9), headings, lever_arm=(0.02, 0.01), shifts=((0.3, -0.1), second))
    strips.mean[:, :3] += np.deg2rad(0.001) * random.normal(size=(k, 3))
    mounting = np.isin(np.arange(k), [2, 9, 12]).astype(np.int64)
    size = np.tile(np.append(np.deg2rad([0.002, 0.001, 0.003]), [0.03, 0.02, 0.05]), k)
    half = size[:, None] * random.normal(size=(6 * k, 20)) / 4.0
    # Errors that the strips have in common, in the map and along their directions.
    half[:, 0] = np.tile([0.0, 0.0, 0.0, 0.05, 0.05, 0.0], k)
    half[3::6, 1], half[4::6, 1] = 0.05 * np.sin(strips.heading), 0.05 * np.cos(strips.heading)
    covariance = (half @ half.T).reshape(k, 6, k, 6)
    errors = StripErrors(covariance) if with_errors else None
    found = separated_offset(strips, mounting, 0.01, errors)

    def shift(of: Any) -> Any:
        return np.kron(np.asarray(of, float)[:, None], np.eye(2))

    def arm(of: Any) -> Any:
        sine, cosine = np.sin(strips.heading), np.cos(strips.heading)
        turn = np.stack([np.stack([sine, cosine], 1), np.stack([cosine, -sine], 1)], 1)
        return (np.asarray(of, float)[:, None, None] * turn).reshape(-1, 2)

    def stacked(*parts: Any) -> Any:
        return np.hstack([np.zeros((2 * k, 0)), *parts])

    def of_plan(rows: Any, smaller: Any, larger: Any) -> Any:
        chosen = np.repeat(rows, 2)
        known = covariance[:, 3:5, :, 3:5].reshape(2 * k, 2 * k)[np.ix_(chosen, chosen)]
        offset = strips.mean[:, 6:8].ravel()[chosen]
        return nested_test(smaller[chosen], larger[chosen], offset, known if with_errors else None)

    def of_angle(axis: int, rows: Any, group: Any) -> Any:
        larger = np.column_stack([1.0 - group, group])[rows]
        known = covariance[:, axis, :, axis][np.ix_(rows, rows)] if with_errors else None
        return nested_test(np.ones((int(rows.sum()), 1)), larger, strips.mean[rows, axis], known)

    every, flight = np.ones(k, dtype=bool), strips.flight
    main, one, of_flights = mounting == 0, shift(every), stacked(shift(flight == 0), shift(flight == 1))
    expected = {"shift_by_flight": of_plan(main, stacked(one, arm(every)), stacked(of_flights, arm(every)))}
    differ = expected["shift_by_flight"].probability < 0.01
    assert differ == (second == (-0.2, 0.2))
    assert expected["shift_by_flight"].probability < 0.5
    used = of_flights if differ else one
    together = stacked(used, arm(every))
    expected |= {
        "offset": of_plan(main, stacked(), together),
        "lever_arm": of_plan(main, used, together),
        "shift": of_plan(main, arm(every), together),
        "lever_arm_by_flight": of_plan(
            main, stacked(of_flights, arm(every)), stacked(of_flights, arm(flight == 0), arm(flight == 1))
        ),
        "lever_arm_by_mounting": of_plan(
            every,
            stacked(of_flights, arm(every)),
            stacked(of_flights, arm(mounting == 0), arm(mounting == 1)),
        ),
    }
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        expected[f"{name}_by_flight"] = of_angle(axis, main, flight)
        expected[f"{name}_by_mounting"] = of_angle(axis, every, mounting)
    assert found.tests.keys() == expected.keys()
    for name, test in expected.items():
        assert found.tests[name].probability == pytest.approx(test.probability), name
        assert found.tests[name].freedom == test.freedom
    chosen = np.repeat(main, 2)
    known = covariance[:, 3:5, :, 3:5].reshape(2 * k, 2 * k)[np.ix_(chosen, chosen)] if with_errors else None
    offset = strips.mean[:, 6:8].ravel()[chosen]
    for design, of, values in (
        (together[chosen], slice(-2, None), (found.lever_arm, found.lever_arm_sigma)),
        (stacked(one, arm(every))[chosen], slice(0, 2), (None, found.shift_sigma)),
    ):
        fit = linear_fit(design, offset)
        sigma = np.sqrt(np.diagonal(fit.covariance(design, known)))[of]
        np.testing.assert_allclose(values[1], sigma)
        if values[0] is not None:
            np.testing.assert_allclose(values[0], fit.solution[of])
