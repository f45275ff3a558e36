"""Distortion from ideal to measured: the equations of OpenCV, COLMAP and Metashape, written out."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.correction import (
    correction,
    ideal_from_measured,
    is_invertible,
    measured_from_ideal,
)
from adjust.camera.additional.effect import effects, image_error_field
from adjust.camera.additional.register import additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.camera.interior import FrameCamera
from adjust.errors import AdditionalParametersError

# c = 3667.4 px of 2.4 µm.
CAMERA = FrameCamera("drone", 5472, 3648, 2.4e-6, 8.80176e-3, (0.0, 0.0), "corner", 0)
HALF = np.array(CAMERA.half_format)
C = CAMERA.focal_length
FORMAT = ImageFormat(float(HALF[0]), float(HALF[1]), focal_length=C)
K1, K2, K3, K4, P1, P2 = -0.0135, 0.0182, -0.0121, 0.0011, 6.1e-4, -4.3e-4
F, CX, CY = C / 2.4e-6, 2741.3, 1819.6
#: Ideal directions, x right and y down, as computer vision has them.
RAYS = np.random.default_rng(3).uniform(-1.0, 1.0, (300, 2)) * HALF / C


def in_pixels(selection: str, values: list[float], focal_length: float = C) -> Floats:
    """Measured pixels from the corner (n, 2) of the directions, by the parameters of this project."""
    parameters = additional_parameters(
        selection, ImageFormat(FORMAT.half_x, FORMAT.half_y, focal_length=focal_length)
    )
    ideal = focal_length * RAYS * [1.0, -1.0]
    measured, found = measured_from_ideal(parameters, np.array(values), ideal)
    assert found.all()
    principal = CAMERA.image_from_pixel(np.array([[CX, CY]]))
    return CAMERA.pixel_from_image(measured + principal)


def test_projected_points_are_those_of_opencv() -> None:
    """calib3d, projectPoints with (k1, k2, p1, p2, k3) and fx, fy, cx, cy."""
    fy, fx = F, F * 1.0021
    x, y = RAYS.T
    r2 = x**2 + y**2
    radial = 1 + K1 * r2 + K2 * r2**2 + K3 * r2**3
    x_distorted = x * radial + 2 * P1 * x * y + P2 * (r2 + 2 * x**2)
    y_distorted = y * radial + P1 * (r2 + 2 * y**2) + 2 * P2 * x * y
    expected = np.column_stack([fx * x_distorted + CX, fy * y_distorted + CY])
    found = in_pixels("brown-forward:k1-k3,p1,p2,b1", [K1, K2, K3, P1, P2, 0.0021])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def test_projected_points_are_those_of_colmap() -> None:
    """sensor/models.h, OPENCV: u + du with du = u radial + 2 p1 uv + p2 (r² + 2 u²)."""
    u, v = RAYS.T
    r2 = u * u + v * v
    radial = K1 * r2 + K2 * r2 * r2
    du = u * radial + 2 * P1 * u * v + P2 * (r2 + 2 * u * u)
    dv = v * radial + 2 * P2 * u * v + P1 * (r2 + 2 * v * v)
    expected = np.column_stack([F * (u + du) + CX, F * (v + dv) + CY])
    found = in_pixels("brown-forward:k1,k2,p1,p2", [K1, K2, P1, P2])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def test_projected_points_are_those_of_full_opencv_without_a_denominator() -> None:
    """sensor/models.h, FULL_OPENCV with k4 = k5 = k6 = 0."""
    u, v = RAYS.T
    r2 = u * u + v * v
    radial = (1 + K1 * r2 + K2 * r2**2 + K3 * r2**3) / (1 + 0.0 * r2)
    du = u * radial + 2 * P1 * u * v + P2 * (r2 + 2 * u * u) - u
    dv = v * radial + 2 * P2 * u * v + P1 * (r2 + 2 * v * v) - v
    expected = np.column_stack([F * (u + du) + CX, F * (v + dv) + CY])
    found = in_pixels("brown-forward:k1-k3,p1,p2", [K1, K2, K3, P1, P2])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def test_projected_points_are_those_of_metashape() -> None:
    """User manual, appendix C: P1 and P2 the other way round, B1 and B2 in pixels after the lens."""
    metashape_p1, metashape_p2, b1, b2 = P2, P1, 4.4, -1.7
    x, y = RAYS.T
    r2 = x**2 + y**2
    radial = 1 + K1 * r2 + K2 * r2**2 + K3 * r2**3 + K4 * r2**4
    xd = x * radial + metashape_p1 * (r2 + 2 * x**2) + 2 * metashape_p2 * x * y
    yd = y * radial + metashape_p2 * (r2 + 2 * y**2) + 2 * metashape_p1 * x * y
    expected = np.column_stack([CX + xd * F + xd * b1 + yd * b2, CY + yd * F])
    values = [K1, K2, K3, K4, P1, P2, b1 / F, b2 / F]
    np.testing.assert_allclose(in_pixels("brown-forward", values), expected, rtol=0.0, atol=1e-9)


def test_coefficients_belong_to_directions_whatever_the_focal_length() -> None:
    """The same lens on a sensor twice as far: all of its image is twice as large."""
    once = in_pixels("brown-forward:k1,p1,b1", [K1, P1, 0.01]) - [CX, CY]
    twice = in_pixels("brown-forward:k1,p1,b1", [K1, P1, 0.01], 2.0 * C) - [CX, CY]
    np.testing.assert_allclose(twice, 2.0 * once, rtol=0.0, atol=1e-9)


def test_measured_points_are_made_ideal_by_inversion() -> None:
    """With a tenth of distortion in the corners, where a fixed point would need dozens of steps."""
    parameters = additional_parameters("brown-forward", FORMAT)
    values = np.array([-0.3, 0.12, -0.02, 0.001, 2e-3, -1e-3, 3e-3, 1e-3])
    ideal = 0.8 * C * RAYS
    measured, found = measured_from_ideal(parameters, values, ideal)
    assert found.all()
    assert np.abs(measured - ideal).max() > 400e-6
    np.testing.assert_allclose(ideal_from_measured(parameters, values, measured), ideal, atol=1e-14)
    assert is_invertible(parameters, values, measured).all()


def test_a_correction_beside_it_acts_on_the_measured_point() -> None:
    parameters = additional_parameters("brown_mm:K1+brown-forward:k1", FORMAT)
    values = np.array([1e-5, 0.02])
    measured = 0.7 * C * RAYS
    corrected = measured * (1 + 1e-5 * 1e6 * np.sum(measured**2, axis=1, keepdims=True))
    u = ideal_from_measured(parameters, values, measured) / C
    np.testing.assert_allclose(
        C * u * (1 + 0.02 * np.sum(u * u, axis=1, keepdims=True)), corrected, atol=1e-14
    )
    back, found = measured_from_ideal(parameters, values, C * u)
    assert found.all()
    np.testing.assert_allclose(back, measured, atol=1e-14)


def test_points_beyond_a_fold_are_not_invertible() -> None:
    """x (1 − r²) has its largest value 0.385 c at r = 0.577."""
    parameters = additional_parameters("brown-forward:k1", FORMAT)
    xy = np.array([[0.37, 0.0], [0.40, 0.0]]) * C
    np.testing.assert_array_equal(is_invertible(parameters, np.array([-1.0]), xy), [True, False])


def test_effect_and_image_error_are_those_of_the_distortion() -> None:
    parameters = additional_parameters("brown-forward:k1", FORMAT)
    corner = np.hypot(*HALF)
    assert effects(parameters).largest[0] == pytest.approx(corner**3 / C**2)
    field = image_error_field(parameters, np.array([1e-4]))
    assert field.largest == pytest.approx(1e-4 * corner**3 / C**2, rel=1e-3)
    outward = np.sum(field.error * field.xy, axis=1)
    assert (outward[np.any(field.xy != 0.0, axis=1)] > 0.0).all()
    np.testing.assert_allclose(correction(parameters, np.array([1e-4]), field.xy), -field.error, atol=1e-18)


def test_without_a_focal_length_it_cannot_be_used() -> None:
    with pytest.raises(AdditionalParametersError, match="focal length"):
        additional_parameters("brown-forward:k1", ImageFormat(0.03, 0.05))


def test_a_distortion_is_not_taken_for_a_correction() -> None:
    """It would be estimated with the other sign, at other points, and without a word."""
    parameters = additional_parameters("brown-forward:k1-k2", FORMAT)
    of_image = np.zeros(1, dtype=np.int64)
    with pytest.raises(ValueError, match=r"use SelfCalibration\.of"):
        SelfCalibration(parameters.names, (parameters,), of_image)
    assert SelfCalibration.of(parameters.names, (parameters,), of_image).distortions
