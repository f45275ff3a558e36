"""What additional parameters do to the image."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.effect import effects, image_error_field, sigma_of_effect
from adjust.camera.additional.register import additional_parameters

UCE = ImageFormat(34.008e-3, 52.026e-3)
HALF_DIAGONAL = np.hypot(UCE.half_x, UCE.half_y)


def test_effects_of_an_affinity_are_known() -> None:
    """|Δ| = r: at most half the diagonal; its mean square over a rectangle is (h_x² + h_y²)/3."""
    found = effects(additional_parameters("bluh:1,2+brown:B1", UCE))
    np.testing.assert_allclose(found.largest, [HALF_DIAGONAL, HALF_DIAGONAL, UCE.half_x], rtol=1e-12)
    np.testing.assert_allclose(
        found.rms, np.array([HALF_DIAGONAL, HALF_DIAGONAL, UCE.half_x]) / np.sqrt(3.0), rtol=5e-5
    )


def test_a_turn_of_the_axes_leaves_effects_as_they_are() -> None:
    straight, turned = (effects(additional_parameters("bluh12+uc", UCE, turn)) for turn in (0, 90))
    np.testing.assert_allclose(turned.largest, straight.largest, rtol=1e-12)
    np.testing.assert_allclose(turned.rms, straight.rms, rtol=1e-12)


def test_a_value_of_one_sigma_has_the_effect_asked_for() -> None:
    parameters = additional_parameters("bluh12+corner+brown:K2", UCE)
    sigma = sigma_of_effect(parameters, 5e-6)
    np.testing.assert_allclose(effects(parameters).largest * sigma, 5e-6, rtol=1e-12)
    assert sigma[12] == pytest.approx(5e-3)  # of a corner: millimetres in the corner


def test_the_image_error_is_the_negative_of_the_correction() -> None:
    parameters = additional_parameters("bluh:81-88", UCE)
    field = image_error_field(parameters, np.eye(8)[0] * 1e-3, columns=5, rows=7)
    assert field.xy.shape == field.error.shape == (35, 2)
    upper_right = np.argmax(field.xy.sum(axis=1))
    np.testing.assert_allclose(field.xy[upper_right], [UCE.half_x, UCE.half_y])
    np.testing.assert_allclose(field.error[upper_right], [1e-6, 0.0], atol=1e-18)
    assert field.largest == pytest.approx(1e-6)


def test_the_total_error_of_an_affinity_has_a_known_size() -> None:
    parameters = additional_parameters("bluh:1,2", UCE)
    field = image_error_field(parameters, np.array([3e-5, 4e-5]), columns=101, rows=101)
    # (y, x) and (x, −y) are perpendicular and of equal length r everywhere.
    assert field.largest == pytest.approx(5e-5 * HALF_DIAGONAL)
    assert field.rms == pytest.approx(5e-5 * HALF_DIAGONAL / np.sqrt(3.0), rel=2e-4)


def test_the_grid_of_a_turned_camera_covers_its_own_format() -> None:
    field = image_error_field(additional_parameters("bluh:1", UCE, 90), np.array([1e-5]))
    np.testing.assert_allclose(np.abs(field.xy).max(axis=0), [UCE.half_y, UCE.half_x])
