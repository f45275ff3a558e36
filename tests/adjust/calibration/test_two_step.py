"""Two-step calibration: closed cases, error rates, and recovery of what was put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, stats

from adjust.calibration import outlying_strips as outlying_strips_of
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.orientation_differences import (
    OrientationDifferences,
    OrientationPairs,
    misalignment_angles,
    orientation_differences,
)
from adjust.calibration.outlying_strips import extreme_deviates, outlying_strips
from adjust.calibration.robust_mean import robust_mean
from adjust.calibration.strip_means import direction_groups, height_groups, strip_means
from adjust.calibration.strip_offsets import body_fixed
from adjust.calibration.two_step import two_step_calibration
from adjust.camera.interior import nominal_mounting
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from tests.adjust.calibration.strips_flown import RULE

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
BORESIGHT = np.deg2rad([0.2, -0.3, 0.5])
LEVER_ARM = np.array([0.61, 0.34, -1.2])

# The 54 values of the example of Rosner (1983).
ROSNER = """
-0.25 0.68 0.94 1.15 1.20 1.26 1.26 1.34 1.38 1.43 1.49 1.49 1.55 1.56 1.58 1.65 1.69 1.70 1.76 1.77 1.81 1.91
1.94 1.96 1.99 2.06 2.09 2.10 2.14 2.15 2.23 2.24 2.26 2.35 2.37 2.40 2.47 2.54 2.62 2.64 2.90 2.92 2.92 2.93
3.21 3.26 3.30 3.59 3.68 4.30 4.64 5.34 5.42 6.01
"""


def flown(
    headings_deg: tuple[float, ...] = (0, 180, 0, 180, 90, 270, 0, 180),
    per_strip: int = 30,
    lever_arm: np.ndarray = LEVER_ARM,
    shift: np.ndarray | None = None,
    seed: int = 1,
    noise: float = 1.0,
    mount_deg: int = 90,
    with_covariance: bool = False,
) -> OrientationDifferences:
    """Differences of a flight: strips with errors of 1 cm and 0.002°, exposures 1 cm and 0.001°."""
    rng = np.random.default_rng(seed)
    strip = np.repeat(np.arange(len(headings_deg)), per_strip)
    n = len(strip)
    heading = np.deg2rad(np.array(headings_deg))[strip]
    angles = np.column_stack([heading, *np.deg2rad(rng.normal(0, 1.5, (2, n)))])
    local_from_body = ENU_FROM_NED @ rotation.ned_from_body(angles)
    body_from_camera = np.broadcast_to(nominal_mounting(mount_deg), (n, 3, 3))
    error = rng.normal(0, np.deg2rad(0.002), (len(headings_deg), 3))[strip]
    error = noise * (error + rng.normal(0, np.deg2rad(0.001), (n, 3)))
    offset = noise * (rng.normal(0, 0.01, (len(headings_deg), 3))[strip] + rng.normal(0, 0.01, (n, 3)))
    centre = rng.uniform(0, 5000, (n, 3))
    added = np.zeros(3) if shift is None else shift
    pairs = OrientationPairs(
        centre,
        local_from_body @ rotation.from_roll_pitch_yaw(BORESIGHT) @ rotation.exp(error) @ body_from_camera,
        centre + np.einsum("nij,nj->ni", local_from_body, lever_arm + offset) + added,
        local_from_body,
        body_from_camera,
        np.broadcast_to(np.eye(3), (n, 3, 3)),
    )
    covariance = np.diag([1e-10] * 3 + [1e-4] * 3) if with_covariance else None
    return orientation_differences(
        pairs,
        strip,
        np.zeros(n, dtype=np.int64),
        np.arange(n, dtype=np.float64),
        np.full(n, 2000.0),
        None if covariance is None else np.broadcast_to(covariance, (n, 6, 6)),
    )


@pytest.mark.parametrize("mount_deg", [0, 90, 180, 270])
def test_without_noise_boresight_and_lever_arm_come_back_exactly(mount_deg: int) -> None:
    result = two_step_calibration(flown(noise=0.0, mount_deg=mount_deg), RULE)
    for mean in (result.main.mean.plain, result.main.mean.robust):
        np.testing.assert_allclose(misalignment_angles(mean[:3]), BORESIGHT, atol=1e-12)
        np.testing.assert_allclose(mean[3:6], LEVER_ARM, atol=1e-9)
    assert result.offset.verdict == "body"
    assert not result.mountings.outlying.any()


def test_the_boresight_has_the_sign_of_the_conventions() -> None:
    """R_c = R_INS R_B T and antenna = X0 + R_b l: level, flying north, camera turned to the right."""
    body = ENU_FROM_NED[None]
    pairs = OrientationPairs(
        np.zeros((1, 3)),
        body @ rotation.about_z(0.01) @ nominal_mounting(0),
        np.array([[0.0, 0.3, 1.5]]),
        body,
        nominal_mounting(0)[None],
        np.eye(3)[None],
    )
    zero = np.zeros(1, dtype=np.int64)
    found = orientation_differences(pairs, zero, zero, np.zeros(1), np.ones(1))
    np.testing.assert_allclose(found.misalignment, [[0, 0, 0.01]], atol=1e-15)
    np.testing.assert_allclose(found.lever_arm, [[0.3, 0.0, -1.5]], atol=1e-15)
    np.testing.assert_allclose(found.shift, [[0.0, 0.3, 1.5]], atol=1e-15)


def test_the_shift_is_what_the_given_lever_arm_leaves() -> None:
    """Exactly, in every direction of flight; the lever arm is the whole one all the same."""
    headings = np.deg2rad([0.0, 90.0, 180.0, 250.0])
    body = rotation.about_z(-headings) @ ENU_FROM_NED
    none = np.zeros(4, dtype=np.int64)
    shift = np.array([0.3, -0.2, 0.1])
    mounting = np.broadcast_to(nominal_mounting(0), (4, 3, 3))
    enu = np.broadcast_to(np.eye(3), (4, 3, 3))
    pairs = OrientationPairs(np.zeros((4, 3)), body @ mounting, body @ LEVER_ARM + shift, body, mounting, enu)
    found = orientation_differences(
        pairs, none, none, np.arange(4.0), np.ones(4), given_lever_arm=np.asarray(LEVER_ARM)
    )
    np.testing.assert_allclose(found.shift, np.broadcast_to(shift, (4, 3)), atol=1e-12)
    np.testing.assert_allclose(np.mod(found.heading, 2.0 * np.pi), headings, atol=1e-12)
    found = orientation_differences(pairs, none, none, np.arange(4.0), np.ones(4))
    np.testing.assert_allclose(found.shift - shift, body @ LEVER_ARM, atol=1e-12)


@pytest.mark.parametrize(
    ("flights", "within"), [(30, (0.9, 2.0)), pytest.param(300, (1.15, 1.65), marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("with_covariance", [pytest.param(False, marks=pytest.mark.slow), True])
def test_errors_lie_within_the_stated_standard_deviations(
    with_covariance: bool, flights: int, within: tuple[float, float]
) -> None:
    """The mean square of (found − true)/σ of eight strips is that of Student's t, 7 / 5."""
    squares = []
    for seed in range(flights):
        mean = two_step_calibration(flown(seed=seed, with_covariance=with_covariance), RULE).groups[0].mean
        error = np.concatenate(
            [misalignment_angles(mean.robust[:3]) - BORESIGHT, mean.robust[3:6] - LEVER_ARM]
        )
        squares.append((error / mean.robust_sigma[:6]) ** 2)
    assert within[0] < np.mean(squares) < within[1]


def test_a_map_fixed_shift_is_told_from_a_lever_arm() -> None:
    shift = np.array([0.3, -0.2, 0.1])
    result = two_step_calibration(flown(lever_arm=np.zeros(3), shift=shift), RULE)
    assert result.offset.verdict == "map"
    assert result.rms_map < 0.03 < result.rms_body
    np.testing.assert_allclose(result.main.mean.robust[6:], shift, atol=0.015)
    assert result.mountings.mounting.max() == 0


def test_one_direction_of_flight_leaves_the_axes_undecided() -> None:
    result = two_step_calibration(flown(headings_deg=(10, 11, 9, 10, 10, 12)), RULE)
    assert result.offset.verdict == "undecided"
    assert result.directions == 1


def remounted(differences: OrientationDifferences, strips: list[int], move: list[float]) -> None:
    chosen = np.isin(differences.strip, strips)
    differences.lever_arm[chosen] += move
    turned = body_fixed(differences.heading[chosen], np.arange(int(chosen.sum())))
    differences.shift[chosen, :2] += (turned @ np.tile(move[:2], int(chosen.sum()))).reshape(-1, 2)


def test_strips_of_another_mounting_are_found_and_kept_out_of_the_mean() -> None:
    differences = flown(headings_deg=(0, 180) * 7)
    remounted(differences, [3, 4], [-0.3, -0.4, 0.0])
    remounted(differences, [9], [0.0, 0.5, 0.0])
    result = two_step_calibration(differences, RULE)
    np.testing.assert_array_equal(result.mountings.mounting, [0, 0, 0, 1, 1, 0, 0, 0, 0, 2, 0, 0, 0, 0])
    np.testing.assert_allclose(result.main.mean.plain[3:5], LEVER_ARM[:2], atol=0.01)
    other = next(g for g in result.groups if g.scope == "mounting" and g.number == 1)
    np.testing.assert_allclose(other.mean.plain[3:5], LEVER_ARM[:2] - np.array([0.3, 0.4]), atol=0.03)
    assert other.strips == 2


def test_two_strips_of_another_mounting_have_at_least_the_scatter_of_the_others() -> None:
    """Their own hides in one that two agree by chance; in plan it is that of one coordinate."""
    differences = flown(headings_deg=(0, 180) * 7)
    twins = differences.strip == 3, differences.strip == 5
    for values in (differences.misalignment, differences.lever_arm, differences.shift):
        values[twins[1]] = values[twins[0]]
    remounted(differences, [3, 5], [-0.3, -0.4, 0.0])
    result = two_step_calibration(differences, RULE)
    other, between = result.others[0], result.main.between
    of_main = result.strips.mean[result.mountings.mounting == 0]
    np.testing.assert_array_equal(between, of_main.std(axis=0, ddof=1))
    assert other.strips == 2
    in_plan = min(np.linalg.norm(between[3:5]), np.linalg.norm(between[6:8])) / np.sqrt(2.0)
    expected = np.concatenate([between[:3], [in_plan] * 2, between[5:6], [in_plan] * 2, between[8:]])
    np.testing.assert_allclose(other.sigma, expected / np.sqrt(2.0))
    np.testing.assert_array_equal(other.freedom, 11)
    np.testing.assert_array_equal(result.main.freedom, 11)
    np.testing.assert_array_equal(result.main.sigma, result.main.mean.robust_sigma)
    assert two_step_calibration(flown(headings_deg=(0, 180, 0, 180, 0)), RULE).mountings.tested


def test_one_strip_alone_has_the_scatter_of_its_exposures_and_the_errors_of_the_adjustment() -> None:
    differences = flown(headings_deg=(0,))
    known = np.array([1e-4, 2e-4, 3e-4, 0.02, 0.03, 0.04])
    errors = StripErrors(np.diag(known**2).reshape(1, 6, 1, 6))
    alone, found = (
        two_step_calibration(differences, RULE).main,
        two_step_calibration(differences, RULE, errors).main,
    )
    # Flown to the north, forward is north and right is east.
    np.testing.assert_allclose(found.known, known[[0, 1, 2, 4, 3, 5, 3, 4, 5]])
    np.testing.assert_allclose(found.sigma, np.hypot(alone.mean.robust_sigma, found.known), rtol=0.02)


def test_lever_arm_and_shift_are_averaged_apart_whatever_they_have_in_common() -> None:
    differences = flown(with_covariance=True)
    assert differences.covariance is not None
    size = np.random.default_rng(6).uniform(0.5, 2.0, len(differences.strip))
    differences = replace(differences, covariance=differences.covariance * size[:, None, None])
    apart = [differences.covariance[:, part][:, :, part] for part in (slice(0, 6), slice(6, 9))]
    mean = two_step_calibration(differences, RULE).groups[0].mean
    for part, covariance in zip((slice(0, 6), slice(6, 9)), apart, strict=True):
        expected = robust_mean(differences.components[:, part], differences.strip, covariance)
        np.testing.assert_allclose(mean.robust[part], expected.robust, rtol=1e-6)


def test_a_strip_with_a_gnss_error_of_some_centimetres_is_outlying_and_no_mounting() -> None:
    differences = flown(headings_deg=(0, 180) * 7)
    remounted(differences, [5], [0.10, 0.0, 0.0])
    found = two_step_calibration(differences, RULE).mountings
    assert found.outlying[5, 3]
    assert found.mounting.max() == 0


def test_four_strips_are_too_few_to_call_one_outlying() -> None:
    differences = flown(headings_deg=(0, 180, 0, 180))
    remounted(differences, [1], [1.0, 0.0, 0.0])
    result = two_step_calibration(differences, RULE)
    assert not result.mountings.tested
    assert not result.mountings.outlying.any()
    np.testing.assert_array_equal(result.main.sigma, result.main.mean.robust_sigma)


@pytest.mark.parametrize(
    ("strips", "blocks", "expected"),
    [
        # A probability of an eighth shows.
        (20, 400, 0.05),
        pytest.param(20, 1000, 0.05, marks=pytest.mark.slow),
        # Rosner's critical values are approximate: from some 30 strips on they keep what they state.
        pytest.param(20, 5000, 0.059, marks=pytest.mark.slow),
        pytest.param(30, 5000, 0.0525, marks=pytest.mark.slow),
        pytest.param(60, 3000, 0.05, marks=pytest.mark.slow),
    ],
)
def test_strips_of_one_mounting_are_called_outlying_with_the_stated_probability(
    strips: int, blocks: int, expected: float
) -> None:
    rng = np.random.default_rng(6)
    alarms = sum(bool(outlying_strips(rng.normal(size=(strips, 6)), 0.05).any()) for _ in range(blocks))
    assert abs(alarms - expected * blocks) < 4.0 * np.sqrt(blocks * expected * (1.0 - expected))


def test_extreme_deviates_agree_with_the_example_of_rosner() -> None:
    """Rosner (1983), 54 values: three outliers at 5 %, although the second alone would not be one."""
    values = np.fromstring(ROSNER, sep=" ")
    assert sorted(values[extreme_deviates(values, 0.05)]) == [5.34, 5.42, 6.01]


def test_critical_values_are_those_of_the_nist_handbook() -> None:
    """Section 1.3.5.17.3, 54 values, 5 %, for one to ten outliers."""
    expected = [
        3.158794,
        3.151430,
        3.143890,
        3.136165,
        3.128247,
        3.120128,
        3.111796,
        3.103243,
        3.094456,
        3.085425,
    ]
    found = [outlying_strips_of._critical(54, number, 0.05) for number in range(1, 11)]
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_a_single_outlier_is_called_one_beyond_the_critical_value_of_grubbs() -> None:
    """Grubbs (1969): 2.709 of 20 values at 5 %, two-sided."""
    others = stats.norm.ppf((np.arange(19) + 0.5) / 19)

    def deviate(value: float) -> float:
        values = np.append(others, value)
        return float((value - values.mean()) / values.std(ddof=1))

    for size, outlying in ((2.704, False), (2.714, True)):
        value = optimize.brentq(lambda value, size=size: deviate(value) - size, 2.0, 20.0)
        assert bool(extreme_deviates(np.append(others, value), 0.05).any()) is outlying


def test_a_drift_is_the_change_over_the_strip() -> None:
    differences = flown(noise=0.0, headings_deg=(0,))
    differences.misalignment[:, 2] += np.linspace(0.0, 1e-4, 30)
    found = strip_means(differences)
    assert found.drift[0, 2] == pytest.approx(1e-4, rel=1e-9)
    assert abs(found.drift[0, 1]) < 1e-12


def test_drift_and_scatter_of_a_strip_are_those_of_a_regression() -> None:
    places = np.array([2.0, 0.5, 9.0, 4.0, 3.5, 11.0, 1.0])
    differences = replace(flown(headings_deg=(0,), per_strip=7), place=places)
    found = strip_means(differences)
    for component, values in enumerate(differences.components.T):
        fit = stats.linregress(differences.place, values)
        assert found.drift[0, component] == pytest.approx(10.5 * fit.slope)
        assert found.drift_sigma[0, component] == pytest.approx(10.5 * fit.stderr)
        assert found.scatter[0, component] == pytest.approx(values.std(ddof=1))


def test_covariances_of_the_components_follow_from_those_of_the_pairs() -> None:
    turn = rotation.exp(np.array([[0.3, -0.2, 1.1], [-0.1, 0.2, -2.0]]))
    enu = rotation.exp(np.array([[0.1, 0.05, 0.4], [0.0, -0.1, 0.2]]))
    mounting = np.broadcast_to(nominal_mounting(90), (2, 3, 3))
    half = np.random.default_rng(3).normal(size=(2, 6, 6))
    covariance = half @ np.swapaxes(half, 1, 2)
    none = np.zeros(2, dtype=np.int64)

    def found(position: np.ndarray) -> OrientationDifferences:
        pairs = OrientationPairs(np.zeros((2, 3)), turn @ mounting, position, turn, mounting, enu)
        return orientation_differences(pairs, none, none, np.zeros(2), np.ones(2), covariance)

    start = found(np.zeros((2, 3)))
    moved = [found(np.tile(step, (2, 1))).components - start.components for step in np.eye(3)]
    derivative = np.concatenate([np.zeros((2, 9, 3)), np.stack(moved, axis=2)], axis=2)
    derivative[:, :3, :3] = np.eye(3)
    assert start.covariance is not None
    np.testing.assert_allclose(
        start.covariance, derivative @ covariance @ np.swapaxes(derivative, 1, 2), atol=1e-12
    )


def test_headings_are_grouped_across_north() -> None:
    np.testing.assert_array_equal(direction_groups(np.deg2rad([359, 181, 2, 179, 90])), [0, 2, 0, 2, 1])
    np.testing.assert_array_equal(direction_groups(np.deg2rad([5.0, 8.0])), [0, 0])
    assert len(set(direction_groups(np.deg2rad(np.arange(0, 360, 20.0))))) == 1
    np.testing.assert_array_equal(direction_groups(np.deg2rad([10.0, 45.0, 70.0])), [0, 1, 1])


def test_heights_are_grouped_by_gaps_of_a_tenth() -> None:
    np.testing.assert_array_equal(height_groups(np.array([2340.0, 780, 800, 2300])), [1, 0, 0, 1])
    np.testing.assert_array_equal(height_groups(np.array([1000.0, 1090, 1210])), [0, 0, 1])


def test_the_mean_of_equal_strips_has_the_scatter_of_their_means() -> None:
    """Closed case: σ = standard deviation of the strip means / √number of strips."""
    rng = np.random.default_rng(2)
    of_strip = rng.normal(size=6)
    found = robust_mean(np.repeat(of_strip, 4)[:, None], np.repeat(np.arange(6), 4))
    assert found.plain_sigma[0] == pytest.approx(of_strip.std(ddof=1) / np.sqrt(6))


def test_the_robust_mean_is_that_of_huber_with_the_scatter_about_the_median() -> None:
    values = np.random.default_rng(8).exponential(size=31)
    found = robust_mean(values[:, None], np.arange(31))
    spread = np.median(np.abs(values - np.median(values))) / stats.norm.ppf(0.75)
    influence = np.clip((values - found.robust[0]) / spread, -1.5, 1.5)
    assert np.abs(influence).max() == 1.5
    assert influence.sum() == pytest.approx(0.0, abs=1e-6)
    assert found.scatter[0] == pytest.approx(spread)
    # Of one strip the exposures are all there is.
    alone = robust_mean(values[:, None], np.zeros(31, dtype=np.int64))
    assert alone.plain_sigma[0] == pytest.approx(values.std(ddof=1) / np.sqrt(31))
    assert alone.robust_sigma[0] == pytest.approx(found.robust_sigma[0])


def test_a_tenth_of_gross_errors_moves_the_robust_mean_by_less_than_its_scatter() -> None:
    values = np.random.default_rng(3).normal(size=(500, 2))
    values[:50] += 1000.0
    found = robust_mean(values, np.arange(500))
    assert np.all(found.plain > 99.0)
    assert np.all(np.abs(found.robust) < 0.35)
    assert np.all(found.weight[:50] < 0.01)


def test_the_robust_mean_of_normal_values_has_the_efficiency_of_huber() -> None:
    """k = 1.5 costs 3.6 % of the variance; the stated σ is that of the means of 400 trials."""
    rng = np.random.default_rng(4)
    found = [robust_mean(rng.normal(size=(200, 1)), np.arange(200)) for _ in range(400)]
    spread = np.std([item.robust[0] for item in found]) * np.sqrt(200)
    stated = np.mean([item.robust_sigma[0] for item in found]) * np.sqrt(200)
    assert spread == pytest.approx(np.sqrt(1.037), abs=0.09)
    assert stated == pytest.approx(np.sqrt(1.037), abs=0.03)


def test_weights_come_from_the_covariances() -> None:
    """Two values of σ 1 and 2: the weighted mean is (4 a + b) / 5 as long as none is doubted."""
    covariance = np.array([1.0, 4.0] * 20)[:, None, None]
    values = np.array([0.0, 1.0] * 20)[:, None]
    found = robust_mean(values, np.arange(40), covariance)
    assert found.robust[0] == pytest.approx(0.2, abs=1e-9)


def huber(residual: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, float]:
    """Factors of residuals, and their scale, by the definition."""
    scale = np.median(np.abs(residual / size - np.median(residual / size))) / stats.norm.ppf(0.75)
    return np.minimum(1.0, 1.5 * scale * size / np.abs(residual)), float(scale)


def test_the_robust_mean_of_values_of_unlike_sigma_and_its_own_are_those_of_the_definition() -> None:
    random = np.random.default_rng(12)
    cluster, size = np.repeat(np.arange(7), 6), np.exp(random.normal(size=42))
    values = 5.0 + size * (stats.t.rvs(2, size=42, random_state=1) + random.normal(size=7)[cluster])
    found = robust_mean(values[:, None], cluster, 9.0 * size[:, None, None] ** 2)
    residual = values - found.robust[0]
    factor = np.minimum(1.0, 1.5 * huber(values - np.median(values), size)[1] * size / np.abs(residual))
    assert 0.3 < np.mean(factor == 1.0) < 0.9
    weight = factor / size**2
    np.testing.assert_allclose(found.weight[:, 0], factor, rtol=1e-6)
    assert weight @ residual == pytest.approx(0.0, abs=1e-6 * np.sum(weight * np.abs(residual)))
    # Sums of influences over strips; only residuals that count in full determine the mean.
    of_strips = (
        np.bincount(cluster, weight * residual) / weight.sum() * factor.mean() / np.mean(factor == 1.0)
    )
    assert found.robust_sigma[0] == pytest.approx(np.sqrt(7.0 / 6.0 * np.sum(of_strips**2)), rel=1e-6)
    assert found.rms[0] == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert found.scatter[0] == pytest.approx(huber(residual, np.ones(42))[1])
    assert abs(found.rms[0] / residual.std() - 1.0) > 1e-3


def test_correlated_components_are_averaged_together() -> None:
    """The root of their weight 0 … 1 stands on both sides of the inverse of the covariance."""
    random = np.random.default_rng(13)
    half = random.normal(size=(40, 2, 2)) + 2.0 * np.eye(2)
    covariance = half @ np.swapaxes(half, 1, 2)
    values = np.einsum("nij,nj->ni", half, stats.t.rvs(3, size=(40, 2), random_state=2))
    found = robust_mean(values, np.arange(40), covariance)
    size = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    scale = np.array([huber(of - np.median(of), own)[1] for of, own in zip(values.T, size.T, strict=True)])
    residual = values - found.robust
    root = np.sqrt(np.minimum(1.0, 1.5 * scale * size / np.abs(residual)))
    weight = root[:, :, None] * np.linalg.inv(covariance) * root[:, None, :]
    balance = np.einsum("nij,nj->ni", weight, residual)
    assert np.all(np.abs(balance.sum(axis=0)) < 1e-6 * np.abs(balance).sum(axis=0))
    inside = np.mean(root == 1.0, axis=0)
    influence = balance @ np.linalg.inv(weight.sum(axis=0)) * np.mean(root**2, axis=0) / inside
    sigma = np.sqrt(40.0 / 39.0 * np.sum(influence**2, axis=0))
    np.testing.assert_allclose(found.robust_sigma, sigma, rtol=1e-6)
    # The first component twice: a singular covariance.
    twice = [0, 1, 0]
    of_three = robust_mean(values[:, twice], np.arange(40), covariance[:, twice][:, :, twice])
    np.testing.assert_allclose(of_three.robust, found.robust[twice], rtol=1e-9)


def test_of_few_or_equal_values_the_mean_is_the_plain_one() -> None:
    # Half of them are equal: their ordinary standard deviation, 0.47, is the scale.
    found = robust_mean(np.repeat([0.0, 1.0], [6, 3])[:, None], np.arange(9))
    assert found.robust[0] == pytest.approx(1.0 / 3.0)
    assert found.scatter[0] == pytest.approx(np.sqrt(2.0) / 3.0)
    two = robust_mean(np.array([[1.0], [1.0], [3.0]]), np.array([4, 4, 9]))
    assert two.plain_sigma[0] == pytest.approx(np.sqrt(2.0 * 2.0 * (4.0 / 9.0) ** 2))
    one = robust_mean(np.array([[1.0]]), np.zeros(1, dtype=np.int64))
    assert np.isnan([one.plain_sigma[0], one.robust_sigma[0]]).all()


@given(st.floats(-100, 100), st.floats(0.1, 10), st.integers(0, 1000))
def test_the_robust_mean_follows_shift_and_scale(shift: float, scale: float, seed: int) -> None:
    values = stats.t.rvs(2, size=(40, 2), random_state=seed)
    cluster = np.repeat(np.arange(8), 5)
    one, other = robust_mean(values, cluster), robust_mean(shift + scale * values, cluster)
    np.testing.assert_allclose(other.robust, shift + scale * one.robust, atol=1e-6)
    np.testing.assert_allclose(other.robust_sigma, scale * one.robust_sigma, rtol=1e-4)


def test_no_pair_is_refused() -> None:
    nothing = OrientationPairs(
        *(np.zeros((0, *shape)) for shape in ((3,), (3, 3), (3,), (3, 3), (3, 3), (3, 3)))
    )
    none = np.zeros(0, dtype=np.int64)
    with pytest.raises(InconsistentBlockError, match="no image"):
        orientation_differences(nothing, none, none, np.zeros(0), np.zeros(0))
