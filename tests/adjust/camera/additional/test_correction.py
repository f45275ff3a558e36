"""Measured image points from ideal ones and back."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.correction import (
    correction,
    distortion_at,
    ideal_from_measured,
    measured_from_ideal,
)
from adjust.camera.additional.effect import sigma_of_effect
from adjust.camera.additional.register import additional_parameters

UCE = ImageFormat(34.008e-3, 52.026e-3)
XY = np.random.default_rng(6).uniform(-1.0, 1.0, (200, 2)) * [UCE.half_x, UCE.half_y]


def test_the_correction_is_linear_in_the_values() -> None:
    parameters = additional_parameters("bluh12+uc+legendre(3)", UCE)
    a, b = np.random.default_rng(7).standard_normal((2, len(parameters.names)))
    a, b = (values * sigma_of_effect(parameters, 1e-6) for values in (a, b))
    together = correction(parameters, 2.0 * a - 3.0 * b, XY)
    apart = 2.0 * correction(parameters, a, XY) - 3.0 * correction(parameters, b, XY)
    np.testing.assert_allclose(together, apart, atol=1e-19)


def test_an_affinity_is_undone_exactly() -> None:
    parameters = additional_parameters("bluh:2", UCE)
    measured, found = measured_from_ideal(parameters, np.array([1e-3]), XY)
    assert found.all()
    np.testing.assert_allclose(measured, XY / [1.0 - 1e-3, 1.0 + 1e-3], atol=1e-15)


def test_a_lens_with_three_percent_of_distortion_is_inverted() -> None:
    """The red head of a DMC: 715 µm at 22.15 mm."""
    parameters = additional_parameters("brown:K1", ImageFormat(18e-3, 13e-3))
    values = np.array([-715e-6 / 22.15e-3**3])
    ideal = np.random.default_rng(1).uniform(-1.0, 1.0, (100, 2)) * [18e-3, 13e-3]
    measured, found = measured_from_ideal(parameters, values, ideal)
    assert found.all()
    np.testing.assert_allclose(ideal_from_measured(parameters, values, measured), ideal, atol=1e-15)
    assert np.abs(measured - ideal).max() > 450e-6


@pytest.mark.parametrize("part", [0.3, 0.5, 0.7])
def test_a_barrel_distortion_of_a_large_part_of_the_image_is_inverted(part: float) -> None:
    """Ideal − measured is this part of the radius in the corner of the measured image."""
    parameters = additional_parameters("brown:K1", ImageFormat(6.6e-3, 4.4e-3))
    values = np.array([part / (6.6e-3**2 + 4.4e-3**2)])
    measured = np.random.default_rng(1).uniform(-1.0, 1.0, (200, 2)) * [6.6e-3, 4.4e-3]
    ideal = ideal_from_measured(parameters, values, measured)
    again, found = measured_from_ideal(parameters, values, ideal)
    assert found.all()
    np.testing.assert_allclose(again, measured, atol=1e-14)


def test_points_that_fall_into_the_gap_between_tiles_are_not_found() -> None:
    """The front tile is moved outwards by 20 µm in the ideal image: nothing is imaged into the gap."""
    parameters = additional_parameters("bluh:56", UCE)
    values = -20e-6 / correction(parameters, np.array([-1.0]), np.array([[20e-3, 0.0]]))[0, :1]
    seam = 11.004e-3
    assert correction(parameters, values, np.array([[20e-3, 0.0]]))[0, 0] > 0.0
    ideal = np.array([[seam - 1e-6, 0.0], [seam + 10e-6, 0.0], [seam + 21e-6, 0.0]])
    measured, found = measured_from_ideal(parameters, values, ideal)
    np.testing.assert_array_equal(found, [True, False, True])
    np.testing.assert_allclose(measured[[0, 2], 0], [seam - 1e-6, seam + 1e-6], atol=1e-15)


def test_values_without_a_contraction_find_nothing_rather_than_something_wrong() -> None:
    parameters = additional_parameters("bluh:2", UCE)
    _, found = measured_from_ideal(parameters, np.array([2.0]), XY)
    assert not found.any()


def test_an_offset_is_added_where_the_adjustment_adds_it() -> None:
    """x̄ + Δ + offset = x_id + D, also with a distortion of 1 mm."""
    image_format = format_in_calibration_axes((UCE.half_x, UCE.half_y), 0, None, 0.08)
    parameters = additional_parameters("brown:K1+brown-forward:k1", image_format)
    values = np.array([0.2, -0.03])
    offset = np.random.default_rng(8).normal(0.0, 2e-6, XY.shape)
    ideal = ideal_from_measured(parameters, values, XY, offset)
    delta = correction(parameters.only("correction"), values[:1], XY)
    np.testing.assert_allclose(
        ideal + distortion_at(parameters, values, ideal), XY + delta + offset, rtol=0, atol=1e-14
    )
    assert np.abs(ideal - ideal_from_measured(parameters, values, XY)).max() > 1e-6
