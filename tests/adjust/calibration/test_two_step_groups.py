"""Groups of a two-step calibration: which exposures each has, and that its mean and σ are those of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Bools, Floats
from adjust.calibration.adjusted_strips import StripErrors
from adjust.calibration.mean_variance import mean_sigma, widening
from adjust.calibration.offset_separation import separated_offset
from adjust.calibration.orientation_differences import OrientationDifferences
from adjust.calibration.robust_mean import robust_mean
from adjust.calibration.strip_means import strip_means
from adjust.calibration.strip_offsets import body_fixed
from adjust.calibration.two_step import GroupMean, TwoStep, two_step_calibration
from tests.adjust.calibration.strips_flown import RULE
from tests.adjust.calibration.test_two_step import flown

#: Strips of three days; on the second the camera is remounted, and before the last line put back as it was.
FLIGHT = np.repeat([0, 1, 2], [8, 6, 5])
MOUNTING = np.isin(np.arange(19), [9, 10, 11, 12]).astype(np.int64)
#: Line 12 alone is flown to the north-east.
DIRECTION = np.where(np.arange(19) == 12, 45, np.array([0, 180, 90, 270] * 5)[:19])
#: The last four lines are flown low.
LOW = np.arange(19) >= 15
#: Strips have numbers, not places in a list.
NAME = 3 * np.arange(19) + 2


def three_days() -> OrientationDifferences:
    """Strips of six exposures, of which the last strip has lost two."""
    found = flown(tuple(DIRECTION), per_strip=6)
    strip, random = found.strip, np.random.default_rng(3)
    moved = MOUNTING[strip] == 1
    move = np.array([0.3, -0.4])
    found.lever_arm[moved, :2] += move
    turned = body_fixed(found.heading[moved], np.arange(int(moved.sum())))
    found.shift[moved, :2] += (turned @ np.tile(move, int(moved.sum()))).reshape(-1, 2)
    # Gross errors of exposures, so that robust and plain values differ.
    found.lever_arm[::17] += 0.3
    found.shift[::17] += 0.3
    found = replace(
        found,
        strip=NAME[strip],
        flight=FLIGHT[strip],
        height=np.where(LOW, 900.0, 2000.0)[strip] + random.exponential(20.0, len(strip)),
        # The same direction in other turns.
        heading=found.heading
        + 1e-3 * random.normal(size=len(strip))
        + 2.0 * np.pi * (np.arange(len(strip)) % 2),
    )
    return found.only(np.arange(len(strip)) < len(strip) - 2)


@pytest.fixture(scope="module")
def errors() -> StripErrors:
    """Of the adjustment, half as large as those of the strips."""
    size = np.concatenate([np.full(3, np.deg2rad(0.001)), np.full(3, 0.005)])
    half = np.tile(size, 19)[:, None] * np.random.default_rng(5).normal(size=(114, 114)) / 11.0
    return StripErrors((half @ half.T).reshape(19, 6, 19, 6))


def chosen(differences: OrientationDifferences) -> dict[tuple[str, int], tuple[int, Bools]]:
    """Mounting and exposures (n,) of every group, from how the strips were flown."""
    row = np.searchsorted(NAME, differences.strip)
    mounting, flight = MOUNTING[row], FLIGHT[row]
    main, direction = mounting == 0, DIRECTION[row]
    return {
        ("all", 0): (-1, np.ones(len(row), dtype=bool)),
        ("mounting", 0): (0, main),
        ("mounting", 1): (1, ~main),
        ("flight", 0): (0, flight == 0),
        ("flight", 1): (1, (flight == 1) & ~main),
        ("flight", 2): (0, flight == 2),
        **{("heading", k): (0, main & (direction == 90 * k - 90 * (k > 0))) for k in (0, 2, 3, 4)},
        ("height", 0): (0, main & LOW[row]),
        ("height", 1): (0, main & ~LOW[row]),
    }


def scattered(group: GroupMean, result: TwoStep) -> Floats:
    """(9,) σ of a mean of a few strips that scatter as those of the main mounting do."""
    between = result.main.between
    in_plan = min(np.hypot(*between[3:5]), np.hypot(*between[6:8])) / np.sqrt(2.0)
    scatter = np.concatenate([between[:3], [in_plan] * 2, between[5:6], [in_plan] * 2, between[8:]])
    return np.asarray(np.hypot(scatter / np.sqrt(group.strips), np.nan_to_num(group.known)))


@pytest.mark.parametrize("with_errors", [False, True])
def test_every_group_is_the_mean_of_its_own_exposures(errors: StripErrors, with_errors: bool) -> None:
    differences = three_days()
    if with_errors:
        # Errors of strips are averages of exposures that count alike, whatever their covariances are.
        size = np.random.default_rng(6).uniform(0.1, 9.0, len(differences.strip))
        differences = replace(differences, covariance=np.eye(9) * size[:, None, None])
    result = two_step_calibration(differences, RULE, errors if with_errors else None)
    np.testing.assert_array_equal(result.mountings.mounting, MOUNTING)
    expected = chosen(differences)
    assert [(group.scope, group.number) for group in result.groups] == list(expected)
    for group in result.groups:
        mounting, own = expected[group.scope, group.number]
        row = np.unique(np.searchsorted(NAME, differences.strip[own]))
        strips = np.isin(np.arange(19), row)
        assert (group.mounting, group.images, group.strips) == (mounting, own.sum(), len(row))
        assert group.height == np.median(differences.height[own])
        if group.scope == "heading":
            turned = np.exp(1j * differences.heading[own]).mean() * np.exp(-1j * group.heading)
            assert abs(np.angle(turned)) < 1e-12
        of_strips = result.strips.mean[strips]
        np.testing.assert_allclose(group.between, of_strips.std(axis=0, ddof=1), rtol=1e-12)
        mean = robust_mean(differences.components[own], differences.strip[own])
        np.testing.assert_array_equal(group.mean.robust, mean.robust)
        sigma = np.column_stack([mean.robust_sigma, np.full(9, len(row) - 1.0)])
        if with_errors:
            known = errors.only(strips).of_components(result.strips.heading[strips])
            count = np.array([6.0] * 18 + [4.0])[strips]
            items = [mean_sigma(of_strips[:, c], known[c], count) for c in range(9)]
            sigma = np.array([(item.sigma, item.freedom) for item in items])
            np.testing.assert_allclose(group.known, [item.known for item in items], rtol=1e-9)
        else:
            assert np.isnan(group.known).all()
        if group.scope in ("mounting", "flight") and len(row) < 5:
            of_few = scattered(group, result)
            larger = of_few > sigma[:, 0]
            assert larger.any()
            sigma[larger] = np.column_stack([of_few, np.full(9, 14.0)])[larger]
        np.testing.assert_allclose(np.column_stack([group.sigma, group.freedom]), sigma, rtol=1e-9)


def test_the_result_is_that_of_the_main_mounting() -> None:
    differences = three_days()
    result = two_step_calibration(differences, RULE)
    main, (other,) = result.main, result.others
    assert (main.scope, main.number, other.scope, other.number) == ("mounting", 0, "mounting", 1)
    own = chosen(differences)["mounting", 0][1]
    for found, values in ((result.rms_body, differences.lever_arm), (result.rms_map, differences.shift)):
        place = slice(3, 5) if values is differences.lever_arm else slice(6, 8)
        left = values[own, :2] - main.mean.robust[place]
        assert found == pytest.approx(np.sqrt(np.mean(np.sum(left**2, axis=1))))
    np.testing.assert_array_equal(result.weight[own], main.mean.weight)
    np.testing.assert_array_equal(result.weight[~own], other.mean.weight)
    assert main.mean.weight.min() < 0.5
    np.testing.assert_array_equal(main.widened, main.sigma * widening(main.freedom, 0.975))
    assert result.strips.heading_group.max() == 4
    assert result.directions == 4


@pytest.mark.parametrize("with_errors", [False, True])
def test_the_offset_is_that_of_the_strips_of_the_main_mounting(
    errors: StripErrors, with_errors: bool
) -> None:
    known = errors if with_errors else None
    result = two_step_calibration(three_days(), RULE, known)
    expected = separated_offset(result.strips, MOUNTING, RULE.error_probability, known)
    assert RULE.error_probability < expected.tests["shift_by_flight"].probability < 0.5
    assert result.offset.tests.keys() == expected.tests.keys()
    for name, test in expected.tests.items():
        assert result.offset.tests[name].probability == test.probability
    np.testing.assert_array_equal(result.offset.lever_arm_sigma, expected.lever_arm_sigma)


def test_strips_alone_have_the_scatter_of_their_exposures_or_that_of_the_others() -> None:
    """One strip to the east; one exposure to the west; one exposure with the camera remounted."""
    found = flown((0, 180) * 4 + (90, 270, 0), per_strip=6)
    found.lever_arm[found.strip == 10, 0] += 1.0
    found.shift[found.strip == 10, 1] += 1.0
    first = np.append(True, np.diff(found.strip) > 0)
    result = two_step_calibration(found.only(first | (found.strip < 9)), RULE)
    assert result.mountings.mounting.tolist() == [0] * 10 + [1]
    east, west = (group for group in result.groups if group.scope == "heading" and group.number in (1, 3))
    np.testing.assert_array_equal(east.sigma, east.mean.robust_sigma)
    np.testing.assert_array_equal(east.freedom, 5.0)
    assert np.isnan(west.sigma).all()
    np.testing.assert_array_equal(west.freedom, 1.0)
    other = result.others[0]
    assert np.isnan(other.mean.robust_sigma).all()
    np.testing.assert_allclose(other.sigma, scattered(other, result))
    np.testing.assert_array_equal(other.freedom, 9.0)


def test_strips_are_described_by_their_own_exposures() -> None:
    differences = three_days()
    size = np.random.default_rng(6).uniform(0.1, 9.0, len(differences.strip))
    differences = replace(
        differences,
        covariance=np.eye(9) * size[:, None, None],
        place=differences.place + np.random.default_rng(7).uniform(0.0, 0.9, len(size)),
    )
    found = strip_means(differences)
    np.testing.assert_array_equal(found.strip, NAME)
    np.testing.assert_array_equal(found.flight, FLIGHT)
    for k, name in enumerate(NAME):
        own = differences.only(differences.strip == name)
        mean = robust_mean(own.components, own.strip)
        np.testing.assert_array_equal(found.mean[k], mean.robust)
        np.testing.assert_array_equal(found.sigma[k], mean.robust_sigma)
        assert found.count[k] == len(own.strip)
        assert found.place[k] == np.median(own.place)
        assert found.height[k] == np.median(own.height)
        assert found.heading[k] == pytest.approx(np.angle(np.exp(1j * own.heading).mean()))


@pytest.mark.parametrize("exposures", [1, 2, 3])
def test_a_line_through_a_strip_and_its_sigma_need_three_exposures(exposures: int) -> None:
    found = strip_means(flown((0,), per_strip=exposures))
    assert np.isfinite(found.drift).all() == np.isfinite(found.drift_sigma).all() == (exposures == 3)
    assert np.isfinite(found.scatter).all() == (exposures > 1)
    nowhere = strip_means(replace(flown((0,)), place=np.zeros(30)))
    assert np.isnan(nowhere.drift).all()


def test_few_strips_scatter_in_plan_as_the_others_do_in_the_axes_in_which_they_agree() -> None:
    """A shift of 5 m is no scatter in the map, whatever it is along the axes of the aircraft."""
    headings = (0, 180, 90, 270, 0, 180, 90, 270, 0, 90, 180)
    found = flown(headings, lever_arm=np.zeros(3), shift=np.array([5.0, -3.0, 0.0]))
    result = two_step_calibration(replace(found, flight=(found.strip > 7).astype(np.int64)), RULE)
    day = next(group for group in result.groups if (group.scope, group.number) == ("flight", 1))
    assert result.main.between[3:5].min() > 1.0
    assert day.sigma[6:8].max() < 0.05
