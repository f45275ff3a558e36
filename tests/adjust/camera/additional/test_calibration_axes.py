"""Sets are defined in calibration axes, which may be turned against those of the image."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, Tiles
from adjust.camera.additional.calibration_axes import calibration_from_image, format_in_calibration_axes
from adjust.camera.additional.register import additional_parameters
from adjust.camera.interior import nominal_mounting

TURNS = (0, 90, 180, 270)
UCE = ImageFormat(34.008e-3, 52.026e-3, Tiles((-11e-3, 10e-3), (-18e-3, 16e-3), 1e-3))
SELECTION = "bluh:1-12+29-32+34-73+80-88+brown:K1,P1,P2,B1,B2"


def anywhere(count: int) -> Floats:
    return np.random.default_rng(2).uniform(-1.0, 1.0, (count, 2)) * [UCE.half_x, UCE.half_y]


@pytest.mark.parametrize("turn_deg", TURNS)
def test_a_turn_of_the_image_turns_the_corrections_with_it(turn_deg: int) -> None:
    xy, turn = anywhere(2500), calibration_from_image(turn_deg)
    straight = additional_parameters(SELECTION, UCE).basis(xy)
    turned = additional_parameters(SELECTION, UCE, turn_deg).basis(xy @ turn)
    np.testing.assert_array_equal(turned, np.einsum("ji,njk->nik", turn, straight))


def test_image_axes_turned_counter_clockwise_give_calibration_axes() -> None:
    # After a quarter turn, calibration x lies along image y.
    np.testing.assert_array_equal(calibration_from_image(90) @ [0.0, 1.0], [1.0, 0.0])
    np.testing.assert_array_equal(calibration_from_image(90) @ [1.0, 0.0], [0.0, -1.0])
    for turn_deg in TURNS:
        assert set(np.unique(calibration_from_image(turn_deg))) <= {-1.0, 0.0, 1.0}
        assert np.linalg.det(calibration_from_image(turn_deg)) == 1.0


@pytest.mark.parametrize("mount_deg", TURNS)
def test_a_turn_by_the_negative_mounting_puts_x_forward_and_y_to_the_left(mount_deg: int) -> None:
    image_from_calibration = calibration_from_image(-mount_deg % 360).T
    for in_calibration, in_body in (([1.0, 0.0], [1.0, 0.0, 0.0]), ([0.0, 1.0], [0.0, -1.0, 0.0])):
        in_image = image_from_calibration @ in_calibration
        np.testing.assert_array_equal(nominal_mounting(mount_deg) @ [*in_image, 0.0], in_body)


@pytest.mark.parametrize(("turn_deg", "expected"), [(0, (5.0, 3.0)), (90, (3.0, 5.0)), (270, (3.0, 5.0))])
def test_the_format_turns_with_the_axes(turn_deg: int, expected: tuple[float, float]) -> None:
    image_format = format_in_calibration_axes((5.0, 3.0), turn_deg, UCE.tiles)
    assert (image_format.half_x, image_format.half_y) == expected
    assert image_format.tiles == UCE.tiles


def test_a_turn_between_the_quarters_is_refused() -> None:
    with pytest.raises(ValueError, match="turn_deg must be 0, 90, 180 or 270, not 45"):
        additional_parameters("bluh12", UCE, 45)


@pytest.mark.parametrize("count", [0, 1, 999, 1000, 1001, 2500])
def test_points_are_evaluated_alike_however_many_there_are(count: int) -> None:
    parameters = additional_parameters("bluh12+uc", UCE, 90)
    basis = parameters.basis(anywhere(2500)[:count])
    assert basis.shape == (count, 2, 44)
    one_by_one = [parameters.basis(point[None])[0] for point in anywhere(2500)[:count:97]]
    np.testing.assert_allclose(basis[::97], np.reshape(one_by_one, (-1, 2, 44)), rtol=1e-13, atol=1e-18)


def test_nothing_selected_corrects_nothing() -> None:
    assert additional_parameters("none", UCE).basis(anywhere(3)).shape == (3, 2, 0)
