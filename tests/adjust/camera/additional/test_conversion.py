"""Conversion between sets of additional parameters, with its misfit."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.conversion import NOTEWORTHY, converted
from adjust.camera.additional.correction import ideal_from_measured, measured_from_ideal
from adjust.camera.additional.register import additional_parameters
from adjust.errors import AdditionalParametersError

#: A drone's camera, 13.2 mm × 8.8 mm, c = 8.8 mm.
FORMAT = ImageFormat(6.6e-3, 4.4e-3, focal_length=8.8e-3)
FORWARD = additional_parameters("brown-forward:k1-k3,p1,p2", FORMAT)
VALUES = np.array([-0.011, 0.012, -0.007, 2e-4, -1e-4])


def test_a_set_converts_to_itself() -> None:
    found = converted(FORWARD, VALUES, FORWARD)
    np.testing.assert_allclose(found.values, VALUES, rtol=1e-9)
    assert found.largest < 1e-13


def test_metres_and_millimetres_convert_by_powers_of_ten() -> None:
    metres = additional_parameters("brown", FORMAT)
    values = np.array([300.0, 1e6, 1e10, 1e-2, 2e-2, 1e-3, -1e-3])
    found = converted(metres, values, additional_parameters("brown_mm", FORMAT))
    np.testing.assert_allclose(found.values, values * 1e-3 ** np.array([2, 4, 6, 1, 1, 0, 0]), rtol=1e-9)


def test_the_affinity_alone_is_inverted_in_closed_form() -> None:
    """x' = (1 + b1) x + b2 v with v = −y: x = x' − b1/(1 + b1) x' + b2/(1 + b1) y'."""
    given = additional_parameters("brown-forward:b1,b2", FORMAT)
    found = converted(given, np.array([0.01, 0.004]), additional_parameters("brown:B1,B2", FORMAT))
    np.testing.assert_allclose(found.values, [-0.01 / 1.01, 0.004 / 1.01], rtol=1e-10)
    assert found.largest < 1e-15


def test_the_leading_coefficient_turns_its_sign_and_is_divided_by_the_focal_length() -> None:
    """Of x' = x (1 + k r²) the inverse is x = x' (1 − k r'² + 3 k² r'⁴ − …)."""
    k = 1e-5
    given = additional_parameters("brown-forward:k1", FORMAT)
    found = converted(given, np.array([k]), additional_parameters("brown_mm:K1,K2", FORMAT))
    np.testing.assert_allclose(found.values, [-k / 8.8**2, 3 * k**2 / 8.8**4], rtol=1e-3)


def test_there_and_back_is_the_same_distortion_but_for_the_misfits() -> None:
    there = converted(FORWARD, VALUES, additional_parameters("brown", FORMAT), (20e-6, -30e-6))
    assert 1e-9 < there.rms < there.largest < NOTEWORTHY
    back = converted(there.parameters, there.values, FORWARD, (20e-6, -30e-6))
    assert back.largest < 2.0 * NOTEWORTHY
    ideal = ideal_from_measured(FORWARD, VALUES, there.xy)
    assert np.abs(ideal - there.xy).max() > 30e-6
    again, found = measured_from_ideal(back.parameters, back.values, ideal)
    assert found.all()
    assert np.linalg.norm(again - there.xy, axis=1).max() < there.largest + back.largest


def test_the_misfit_says_what_too_few_parameters_leave() -> None:
    all_of_them = converted(FORWARD, VALUES, additional_parameters("brown:K1-K3,P1,P2", FORMAT))
    radial_only = converted(FORWARD, VALUES, additional_parameters("brown:K1-K3", FORMAT))
    assert all_of_them.largest < NOTEWORTHY < 2e-6 < radial_only.largest
    xy = radial_only.xy
    left = ideal_from_measured(radial_only.parameters, radial_only.values, xy)
    left = left - ideal_from_measured(FORWARD, VALUES, xy)
    # The misfit is that of measured points: the ideal ones are off by as much, but for the slope of 1 %.
    np.testing.assert_allclose(radial_only.misfit, left, atol=0.03 * radial_only.largest)


def test_copied_coefficients_would_be_far_off() -> None:
    """With the sign turned, a copy of −8 % distortion in the corners is wrong by a hundred micrometres."""
    strong = additional_parameters("brown-forward:k1", FORMAT)
    values = np.array([-0.1])
    right = converted(strong, values, additional_parameters("brown_mm:K1-K3", FORMAT))
    copied = additional_parameters("brown_mm:K1", FORMAT)
    wrong = ideal_from_measured(copied, np.array([0.1 / 8.8**2]), right.xy)
    assert np.abs(wrong - ideal_from_measured(strong, values, right.xy)).max() > 100e-6
    # Three coefficients do not hold the inverse of such a lens: that is said, and it is far less.
    assert NOTEWORTHY < right.largest < 10e-6


def test_the_axes_of_the_set_are_turned() -> None:
    turned = additional_parameters("brown-forward:k1,p1,p2,b1,b2", FORMAT, 90)
    values = np.array([-0.01, 5e-4, -3e-4, 1e-3, 2e-3])
    found = converted(turned, values, additional_parameters("brown", FORMAT, 90))
    plain = additional_parameters("brown-forward:k1,p1,p2,b1,b2", FORMAT)
    same = converted(plain, values, additional_parameters("brown", FORMAT))
    np.testing.assert_allclose(found.values, same.values, rtol=1e-6)


def test_a_distortion_that_folds_the_image_over_is_refused() -> None:
    """1 + 3 k1 r² vanishes at r = 0.58, inside the format."""
    folding = additional_parameters("brown-forward:k1", FORMAT)
    with pytest.raises(AdditionalParametersError, match="folds the image over"):
        converted(folding, np.array([-1.0]), additional_parameters("brown:K1", FORMAT))
