from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from adjust.adjustment import adjust_block
from adjust.arrays import Bools, Floats, Ints
from adjust.observations.control_point import ControlPoints
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, INTERIOR_ORIENTATION
from adjust.quality.control_checks import ControlCheck, predicted_without, spread_folds
from adjust.quality.joint_cofactor import joint_cofactors
from adjust.result import AdjustmentResult
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.gauss_newton import iterate
from adjust.solve.system import Observations, System
from tests.adjust.scenes import Scene, two_strips

FREE = {INTERIOR_ORIENTATION: True, BORESIGHT: True}
KINDS = ("full", "plan", "covariance", "full", "height", "covariance", "full", "full")


def test_a_mean_checks_each_measurement_by_the_mean_of_the_others() -> None:
    # Four points of which only the heights are observed, of one common value: H = 1/4 everywhere.
    observed = np.array([1.0, 2.0, 4.0, 9.0])
    mean = observed.mean()
    for k in range(4):
        residual = np.array([[0.0, 0.0, mean - observed[k]]])
        hat = np.zeros((3, 3))
        hat[2, 2] = 0.25
        found = predicted_without(residual, hat, np.array([True]))
        others = np.delete(observed, k)
        assert found.difference[0, 2] == pytest.approx(others.mean() - observed[k])
        # Variance of the measurement and of the mean of three.
        assert found.cofactor[0, 2, 2] == pytest.approx(1.0 + 1.0 / 3.0)


def test_two_left_out_together_are_checked_by_the_others_alone() -> None:
    observed = np.array([1.0, 2.0, 4.0, 9.0])
    residual = np.zeros((2, 3))
    residual[:, 2] = observed.mean() - observed[:2]
    hat = np.zeros((2, 3, 2, 3))
    hat[:, 2, :, 2] = 0.25
    found = predicted_without(residual, hat.reshape(6, 6), np.array([True, True]))
    assert found.difference[:, 2] == pytest.approx(6.5 - observed[:2])
    assert found.cofactor[:, 2, 2] == pytest.approx([1.5, 1.5])


def test_a_rejected_one_is_predicted_from_those_that_stay() -> None:
    # The mean of 1, 2, 4; 9 was rejected, and 1 is left out with it.
    observed = np.array([1.0, 9.0])
    residual = np.zeros((2, 3))
    residual[:, 2] = 7.0 / 3.0 - observed
    hat = np.zeros((2, 3, 2, 3))
    hat[:, 2, :, 2] = 1.0 / 3.0
    found = predicted_without(residual, hat.reshape(6, 6), np.array([True, False]))
    assert found.difference[:, 2] == pytest.approx(3.0 - observed)
    assert found.cofactor[:, 2, 2] == pytest.approx([1.5, 1.5])


def test_what_nothing_else_determines_has_no_prediction() -> None:
    hat = np.zeros((2, 3, 2, 3))
    hat[0, 2, 0, 2] = 1.0
    hat[1, 2, 1, 2] = 0.5
    residual = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.7]])
    found = predicted_without(residual, hat.reshape(6, 6), np.array([True, True]))
    assert np.isnan(found.difference[0]).all()
    assert np.isnan(found.cofactor[0]).all()
    assert found.difference[1, 2] == pytest.approx(1.4)


@given(st.integers(0, 1000), st.integers(1, 60), st.integers(2, 12))
def test_folds_are_of_equal_size_and_each_covers_the_area(seed: int, count: int, folds: int) -> None:
    xy = np.random.default_rng(seed).uniform(0, 5000, (count, 2))
    fold = spread_folds(xy, folds)
    sizes = np.bincount(fold)
    assert len(sizes) == min(folds, count)
    assert sizes.max() - sizes.min() <= 1


def test_a_regular_grid_in_four_folds_has_one_of_each_in_every_square() -> None:
    x, y = np.meshgrid(np.arange(8.0), np.arange(8.0))
    fold = spread_folds(np.column_stack([x.ravel(), y.ravel()]), 4).reshape(8, 8)
    for i in range(0, 8, 2):
        for j in range(0, 8, 2):
            assert sorted(fold[i : i + 2, j : j + 2].ravel().tolist()) == [0, 1, 2, 3]


# Against adjustments that really are without the points. All σ and all noise are a thousandth of what is
# usual: the equations are then linear to better than 1e-6 of σ. In a Cartesian frame, because heights above
# an ellipsoid are rounded to 1e-9 m.


def quiet(**switches: object) -> Scene:
    return two_strips(
        control=KINDS,
        frame="cartesian",
        noise_seed=31,
        sigma_image_m=2e-9,
        sigma_gnss_m=5e-5,
        sigma_control_m=3e-5,
        sigma_ins_rad=1e-7,
        **switches,
    )


def control_of(observations: Observations) -> tuple[int, ControlPoints]:
    return next((k, g) for k, g in enumerate(observations.others) if isinstance(g, ControlPoints))


def really_without(scene: Scene, result: AdjustmentResult, left_out: Bools) -> tuple[Floats, Floats]:
    """Differences (n, 3) and cofactors (n, 3, 3) at all control points of an adjustment without some."""
    place, control = control_of(scene.observations)
    others = list(scene.observations.others)
    others[place] = control.without(left_out)
    again = replace(scene, observations=replace(scene.observations, others=tuple(others)))
    state = result.state
    for _ in range(2):
        block = replace(
            again.block,
            projection_centre=state.projection_centre,
            local_from_camera=state.local_from_camera,
            object_point=state.object_point,
        )
        found = adjust_block(block, again.observations)
        state = found.state
    equations = control.linearize(state)
    jacobian = equations.terms[0].jacobian
    spread = jacobian @ found.cofactor.of_points[control.point] @ np.swapaxes(jacobian, 1, 2)
    unwhitener = control.stochastic.unwhitener
    return -equations.misclosure, spread + unwhitener @ np.swapaxes(unwhitener, 1, 2)


def assert_is(check: ControlCheck, rows: Ints, difference: Floats, cofactor: Floats, present: Bools) -> None:
    """Equal to 1e-6 of σ, and σ to a millionth."""
    for row in rows:
        own = np.flatnonzero(present[row])
        sigma = np.sqrt(np.diagonal(cofactor[row]))[own]
        assert np.abs((check.difference[row, own] - difference[row, own]) / sigma).max() < 1e-6
        found = check.cofactor[row][np.ix_(own, own)]
        error = found - cofactor[row][np.ix_(own, own)]
        assert np.abs(error / np.outer(sigma, sigma)).max() < 1e-6
        assert np.isnan(check.difference[row][~present[row]]).all()


@pytest.mark.parametrize("switches", [{"free": FREE}, {"gnss": False, "ins": False}])
def test_leaving_one_out_is_the_adjustment_without_it(switches: dict[str, object]) -> None:
    scene = quiet(**switches)
    result = adjust_block(scene.block, scene.observations)
    assert result.left_out_singly is not None
    _, control = control_of(scene.observations)
    for row in range(len(KINDS)):
        without = really_without(scene, result, np.arange(len(KINDS)) == row)
        assert_is(result.left_out_singly, np.array([row]), *without, control.stochastic.present)


@pytest.mark.parametrize("switches", [{"free": FREE}, {"gnss": False, "ins": False}])
def test_leaving_out_a_fold_is_the_adjustment_without_it(switches: dict[str, object]) -> None:
    scene = quiet(**switches)
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(control_folds=3))
    check = result.left_out_by_fold
    assert check is not None
    _, control = control_of(scene.observations)
    assert np.bincount(check.fold).tolist() == [3, 3, 2]
    for number in range(3):
        rows = np.flatnonzero(check.fold == number)
        without = really_without(scene, result, check.fold == number)
        assert_is(check, rows, *without, control.stochastic.present)


def test_as_many_folds_as_points_leave_one_out() -> None:
    scene = quiet(free=FREE)
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(control_folds=100))
    assert result.left_out_singly is not None
    assert result.left_out_by_fold is not None
    np.testing.assert_allclose(
        result.left_out_by_fold.difference, result.left_out_singly.difference, rtol=1e-6
    )
    np.testing.assert_allclose(
        result.left_out_by_fold.cofactor, result.left_out_singly.cofactor, rtol=1e-6, atol=1e-16
    )


def test_a_fold_whose_points_are_not_used_has_no_prediction() -> None:
    """A point known in height only that no image shows is no unknown; the others are predicted as ever."""
    scene = two_strips(control=("full", "full", "full", "height"), noise_seed=3)
    _, control = control_of(scene.observations)
    rays = scene.observations.image_points
    unseen = rays.without(rays.point == control.point[3])
    result = adjust_block(
        scene.block, replace(scene.observations, image_points=unseen), AdjustmentOptions(control_folds=4)
    )
    check = result.left_out_by_fold
    assert check is not None
    assert result.left_out_singly is not None
    assert not result.active_point[control.point[3]]
    assert np.isnan(check.difference[3]).all()
    np.testing.assert_allclose(check.difference, result.left_out_singly.difference, atol=1e-9)


def test_without_the_last_points_that_hold_the_datum_there_is_no_prediction() -> None:
    scene = two_strips(control=("full",) * 3, gnss=False, ins=False, noise_seed=3)
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(control_folds=2))
    assert result.left_out_singly is not None
    assert result.left_out_by_fold is not None
    assert np.isnan(result.left_out_singly.difference).all()
    assert np.isnan(result.left_out_by_fold.difference).all()
    four = two_strips(control=("full",) * 4, gnss=False, ins=False, noise_seed=3)
    check = adjust_block(four.block, four.observations).left_out_singly
    assert check is not None
    assert np.isfinite(check.difference).all()


def test_a_rejected_control_point_is_predicted_and_spoils_no_other() -> None:
    scene = two_strips(control=("full",) * 7, free=FREE, noise_seed=5)
    clean = adjust_block(scene.block, scene.observations, AdjustmentOptions(control_folds=3))
    place, control = control_of(scene.observations)
    given = control.given.copy()
    given[2, 0] += 2.0
    others = list(scene.observations.others)
    others[place] = replace(control, given=given)
    observations = replace(scene.observations, others=tuple(others))
    options = AdjustmentOptions(critical_value=4.13, control_folds=3)
    result = adjust_block(scene.block, observations, options)
    assert result.groups[1 + place].rejected == 1
    for now, before in (
        (result.left_out_singly, clean.left_out_singly),
        (result.left_out_by_fold, clean.left_out_by_fold),
    ):
        assert now is not None
        assert before is not None
        assert now.difference[2, 0] == pytest.approx(before.difference[2, 0] - 2.0, abs=5e-3)
        np.testing.assert_allclose(now.cofactor[2], before.cofactor[2], rtol=0.02, atol=1e-5)


def test_no_control_no_check() -> None:
    scene = two_strips(control=())
    result = adjust_block(scene.block, scene.observations, AdjustmentOptions(control_folds=3))
    assert result.left_out_singly is None
    assert result.left_out_by_fold is None


def test_joint_cofactors_are_those_of_the_inverse_of_the_full_normal_equations() -> None:
    scene = two_strips(cameras=2, flights=2, free={**FREE, GNSS_SHIFT: [[False], [True]]}, noise_seed=3)
    system = System.of(scene.block, scene.observations)
    solution = iterate(system, scene.block.approximate_state(), 20)
    points = np.array([40, 3, 17])
    joint = joint_cofactors(system, solution, points)
    design = design_matrix(system, solution.state)
    inverse = full_cofactor(design)
    rows = design.point_columns[points]
    expected = inverse[np.ix_(rows.ravel(), rows.ravel())].reshape(3, 3, 3, 3)
    np.testing.assert_allclose(joint, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("runs", [24, pytest.param(60, marks=pytest.mark.slow)])
def test_predicted_standard_deviations_are_those_of_the_predictions(runs: int) -> None:
    squares: dict[str, list[Floats]] = {"singly": [], "fold": []}
    for seed in range(runs):
        scene = two_strips(control=KINDS, free=FREE, noise_seed=1000 + seed)
        result = adjust_block(scene.block, scene.observations, AdjustmentOptions(control_folds=3))
        for name, check in (("singly", result.left_out_singly), ("fold", result.left_out_by_fold)):
            assert check is not None
            variance = np.diagonal(check.cofactor, axis1=1, axis2=2)
            squares[name].append(check.difference**2 / variance)
    for found in squares.values():
        normalized = np.array(found)
        known = np.isfinite(normalized).all(axis=0)
        # 20 components, hardly correlated: the mean of 1,200 χ²₁ in 60 runs has a standard deviation of .04.
        spread = np.sqrt(2.0 / (20 * runs))
        assert normalized[:, known].mean() == pytest.approx(1.0, abs=3.0 * spread)
        # Each component by itself; in 60 runs between 0.5 and 1.7.
        each = normalized[:, known].mean(axis=0)
        low, high = stats.chi2.ppf([5e-4, 1.0 - 5e-4], runs) / runs
        assert low < each.min()
        assert each.max() < high
