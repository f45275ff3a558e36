"""The balanced radial polynomial and Brown's describe the same camera."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.additional import brown
from adjust.camera.additional.balanced_radial import (
    SET,
    balanced_from_brown,
    brown_from_balanced,
    zero_crossing,
)
from adjust.camera.additional.base import ImageFormat

FORMAT = ImageFormat(0.036, 0.048)  # half the diagonal 60 mm, so r0 = 40 mm
NAMES = ("a1", "a2", "a3")
VALUES = np.array([2e-6, -4e-10, 5e-14])  # mm; 100 µm and more in the corner


def test_no_term_moves_a_point_at_two_thirds_of_half_the_diagonal() -> None:
    assert zero_crossing(FORMAT) == pytest.approx(0.040)
    assert np.abs(SET.basis(np.array([[0.024, -0.032]]), FORMAT, NAMES) @ VALUES).max() < 1e-18


def test_a_hand_computed_point() -> None:
    # r = 50 mm: (r² − r0²) = 900 mm², times x = 30 mm
    basis = SET.basis(np.array([[0.030, 0.040]]), FORMAT, ("a1",))
    np.testing.assert_allclose(basis[0, :, 0] * 1e3, [27000.0, 36000.0], rtol=1e-14)


def test_brown_form_gives_the_same_directions() -> None:
    k, focal_length_of_brown = brown_from_balanced(VALUES, 40.0, 120.0)
    xy = np.random.default_rng(2).uniform(-1.0, 1.0, (200, 2)) * [0.036, 0.048]
    balanced = xy + SET.basis(xy, FORMAT, NAMES) @ VALUES
    unbalanced = xy + brown.SET_IN_MILLIMETRES.basis(xy, FORMAT, ("K1", "K2", "K3")) @ k
    np.testing.assert_allclose(unbalanced / focal_length_of_brown, balanced / 120.0, rtol=1e-14)
    assert abs(focal_length_of_brown - 120.0) > 0.1


def test_the_conversion_has_an_inverse() -> None:
    k, focal_length = brown_from_balanced(VALUES, 40.0, 120.0)
    values, back = balanced_from_brown(k, 40.0, focal_length)
    np.testing.assert_allclose(values, VALUES, rtol=1e-13)
    assert back == pytest.approx(120.0, rel=1e-14)
