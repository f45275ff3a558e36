from __future__ import annotations

import numpy as np

from adjust.adjustment import adjust_block
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT
from adjust.result import ObservationStatus
from adjust.simulate.block import simulate_block
from adjust.simulate.gross_errors import GrossErrorSpecification
from adjust.simulate.object_points import PointSpecification
from tests.adjust.simulate.specifications import CAMERA, small_specification, without_noise

WRONG = GrossErrorSpecification(
    image_rate=0.02, image_size=(40e-6, 300e-6), control_swaps=2, wrong_strips=1, time_error=0.5
)


def test_gross_errors_lie_where_the_list_says_and_nowhere_else() -> None:
    block = simulate_block(without_noise(small_specification(gross_errors=WRONG)))
    truth, measured, wrong = block.truth, block.measured, block.measured.gross_errors
    change = measured.xy - truth.xy
    np.testing.assert_allclose(change[wrong.image_points], wrong.displacement, atol=1e-16)
    others = np.setdiff1d(np.arange(len(change)), wrong.image_points)
    assert not change[others].any()
    size = np.hypot(*wrong.displacement.T)
    assert len(size) > 5
    assert size.min() >= 40e-6
    assert size.max() <= 300e-6


def test_no_gross_error_leaves_its_image() -> None:
    wrong = GrossErrorSpecification(image_rate=0.5, image_size=(1e-3, 5e-3))
    points = PointSpecification(count=400, margin=0.0)
    block = simulate_block(without_noise(small_specification(gross_errors=wrong, points=points)))
    assert np.all(np.abs(block.measured.xy) <= CAMERA.half_format)
    size = np.hypot(*block.measured.gross_errors.displacement.T)
    assert size.min() >= 1e-3


def test_swapped_control_points_have_each_others_coordinates() -> None:
    block = simulate_block(without_noise(small_specification(gross_errors=WRONG)))
    true = block.truth.state.object_point[block.truth.surveyed]
    swapped = block.measured.gross_errors.swapped
    assert len(np.unique(swapped)) == 4
    np.testing.assert_array_equal(block.measured.surveyed[swapped], true[swapped[:, ::-1]])
    others = np.setdiff1d(np.arange(len(true)), swapped)
    np.testing.assert_array_equal(block.measured.surveyed[others], true[others])


def test_a_strip_with_a_wrong_time_is_shifted_along_its_flight() -> None:
    right = simulate_block(without_noise(small_specification()))
    block = simulate_block(without_noise(small_specification(gross_errors=WRONG)))
    shift = block.measured.positions - right.measured.positions
    of_strip = np.isin(block.truth.plan.strip, block.measured.gross_errors.strips)
    assert of_strip.sum() == 5
    assert not shift[~of_strip].any()
    velocity = block.truth.trajectory.velocity[of_strip]
    np.testing.assert_allclose(shift[of_strip], 0.5 * velocity, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(velocity, axis=1), 75.0, rtol=0.05)


def test_rejection_finds_large_wrong_image_points() -> None:
    wrong = GrossErrorSpecification(image_rate=0.01, image_size=(80e-6, 200e-6))
    simulated = simulate_block(small_specification(gross_errors=wrong))
    block = simulated.block((BORESIGHT, GNSS_SHIFT))
    result = adjust_block(block, simulated.observations(block), AdjustmentOptions(critical_value=4.13))
    rejected = np.flatnonzero((result.groups[0].status == ObservationStatus.REJECTED).any(axis=1))
    listed = simulated.measured.gross_errors.image_points
    # With 50 σ and three good rays beside them they stand out.
    many = np.bincount(simulated.truth.point)[simulated.truth.point[listed]] >= 4
    assert many.sum() >= 3
    assert set(listed[many]) <= set(rejected)
