"""Parameters that come first: the geometry of the pixels before that of the lens."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.additional import brown
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.evaluation import correction_and_derivatives, slope_of, total_correction
from adjust.camera.additional.register import additional_parameters

FORMAT = ImageFormat(3.6e-3, 2.7e-3)
SELECTION = "brown_mm:K1,P2+pixel:aspect+brown_mm:B2"
VALUES = np.array([4.6e-3, -4.4e-5, 8e-3, 2e-4])
XY = np.random.default_rng(4).uniform(-1.0, 1.0, (30, 2)) * [3.6e-3, 2.7e-3]


def test_only_the_shape_of_the_pixels_comes_first() -> None:
    parameters = additional_parameters(SELECTION, FORMAT)
    assert dict(zip(parameters.names, parameters.first, strict=True)) == {
        "brown_mm:K1": False,
        "brown_mm:P2": False,
        "pixel:aspect": True,
        "brown_mm:B2": False,
    }


def test_the_lens_is_described_where_the_pixels_have_moved_the_point_to() -> None:
    parameters = additional_parameters(SELECTION, FORMAT)
    stretched = XY * [1.008, 1.0]
    of_lens = brown.SET_IN_MILLIMETRES.basis(stretched, FORMAT, ("K1", "P2", "B2")) @ VALUES[[0, 1, 3]]
    correction = total_correction(parameters, XY, VALUES)
    np.testing.assert_allclose(XY + correction, stretched + of_lens, rtol=0.0, atol=1e-18)


def test_derivatives_are_those_of_the_composition() -> None:
    parameters = additional_parameters(SELECTION, FORMAT)
    correction, derivatives = correction_and_derivatives(parameters, XY, VALUES)
    np.testing.assert_allclose(correction, total_correction(parameters, XY, VALUES), rtol=1e-12)
    for k, size in enumerate(np.abs(VALUES)):
        step = 0.01 * size * np.eye(len(VALUES))[k]
        ahead, behind = (total_correction(parameters, XY, VALUES + sign * step) for sign in (1.0, -1.0))
        numeric = (ahead - behind) / (2.0 * step[k])
        largest = np.abs(numeric).max()
        np.testing.assert_allclose(derivatives[:, :, k], numeric, atol=1e-7 * largest)
    # Without the slope of the lens the derivative by the aspect would be more than a tenth off.
    plain = parameters.basis(XY)[:, :, 2]
    assert np.abs(derivatives[:, :, 2] - plain).max() > 0.1 * np.abs(plain).max()


def test_slope_of_a_quadratic_correction() -> None:
    slope = slope_of(lambda xy: np.stack([100.0 * xy[:, 0] * xy[:, 1], xy[:, 1] ** 2], axis=1), XY)
    x, y = XY.T
    expected = np.stack([[100.0 * y, 100.0 * x], [np.zeros(30), 2.0 * y]]).transpose(2, 0, 1)
    np.testing.assert_allclose(slope, expected, atol=1e-7)


@pytest.mark.parametrize(("name", "same"), [("ebner12", "ebner"), ("gruen44", "gruen")])
def test_sets_have_the_usual_names_as_well(name: str, same: str) -> None:
    assert additional_parameters(name, FORMAT).names == additional_parameters(same, FORMAT).names


@pytest.mark.parametrize("selection", [SELECTION, "bluh12+ebner"])
def test_the_correction_of_many_points_is_that_of_each(selection: str) -> None:
    parameters = additional_parameters(selection, FORMAT)
    values = 1e-6 / np.abs(parameters.basis(XY)).max(axis=(0, 1))
    many = np.tile(XY, (300, 1))
    np.testing.assert_allclose(
        total_correction(parameters, many, values),
        np.tile(total_correction(parameters, XY, values), (300, 1)),
        rtol=0.0,
        atol=1e-18,
    )
