from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import Tiles
from adjust.camera.additional.calibration_axes import format_in_calibration_axes
from adjust.camera.additional.correction import correction
from adjust.camera.additional.register import additional_parameters
from adjust.simulate.image_errors import ImageErrors, ImageErrorSpecification, image_errors_of
from adjust.simulate.random_streams import RandomStreams, Source
from tests.adjust.simulate.specifications import CAMERA

HALF = np.array(CAMERA.half_format)
MICROMETRE = 1e-6


def _errors(**sizes: float) -> ImageErrors:
    specification = ImageErrorSpecification(**sizes)
    return image_errors_of(specification, CAMERA, RandomStreams(4).of(Source.IMAGE_ERRORS))


def _places(count: int = 5000) -> Floats:
    return np.random.default_rng(6).uniform(-0.98, 0.98, (count, 2)) * HALF


def test_measured_and_ideal_coordinates_are_inverse_to_each_other() -> None:
    errors = _errors(radial=3e-6, tile_shift=0.8e-6, corner=2e-6)
    ideal = _places()
    measured, unique = errors.measured_from_ideal(ideal)
    # Only a few micrometres beside the seams are lost.
    assert unique.mean() > 0.995
    np.testing.assert_allclose(errors.ideal_from_measured(measured[unique]), ideal[unique], atol=1e-15)
    assert np.abs(measured - ideal).max() > MICROMETRE


def test_the_error_is_measured_minus_ideal() -> None:
    errors = _errors(radial=2e-6)
    measured, _ = errors.measured_from_ideal(_places())
    np.testing.assert_allclose(
        measured - errors.ideal_from_measured(measured), errors.error(measured), atol=1e-17
    )


def test_the_radial_error_points_outward_in_the_corner_and_vanishes_at_its_zero() -> None:
    errors = _errors(radial=2.5e-6)
    corner = errors.error(HALF[None])[0]
    np.testing.assert_allclose(corner, 2.5e-6 * HALF / np.hypot(*HALF), rtol=1e-12)
    zero = 128.0 / 162.6 * np.hypot(*HALF)
    angles = np.linspace(0.0, 6.0, 7)
    circle = zero * np.stack([np.cos(angles), np.sin(angles)], -1)
    np.testing.assert_allclose(errors.error(circle), 0.0, atol=1e-20)


def test_tiles_are_shifted_as_a_whole_and_the_central_one_stays() -> None:
    errors = _errors(tile_shift=0.5e-6)
    outer = np.array([[-1, -1], [-1, 0], [-1, 1], [0, -1], [0, 1], [1, -1], [1, 0], [1, 1]]) * HALF * 0.7
    shifts = errors.error(outer)
    assert np.sqrt(np.mean(shifts**2)) == pytest.approx(0.5e-6)
    np.testing.assert_array_equal(errors.error(outer + 0.05 * HALF), shifts)
    np.testing.assert_array_equal(errors.error(np.array([[0.0, 0.0], HALF * 0.3])), np.zeros((2, 2)))


def test_nothing_is_measured_where_a_seam_leaves_no_single_place() -> None:
    errors = _errors(tile_shift=1e-6)
    across = np.linspace(-5e-6, 5e-6, 1001)
    ideal = np.column_stack([errors.seams[0] + across, np.full(1001, 1e-3)])
    measured, unique = errors.measured_from_ideal(ideal)
    assert 0 < (~unique).sum() < 1001
    np.testing.assert_allclose(errors.ideal_from_measured(measured[unique]), ideal[unique], atol=1e-15)


def test_corners_bend_without_a_step_on_the_axes() -> None:
    errors = _errors(corner=2e-6)
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * HALF
    assert np.sqrt(np.mean(errors.error(corners) ** 2)) == pytest.approx(2e-6)
    on_axis = np.array([[0.0, 0.9], [0.9, 0.0], [0.0, -0.5]]) * HALF
    np.testing.assert_array_equal(errors.error(on_axis), np.zeros((3, 2)))


def test_no_error_leaves_coordinates_as_they_are() -> None:
    measured, unique = _errors().measured_from_ideal(_places())
    np.testing.assert_array_equal(measured, _places())
    assert unique.all()


def test_errors_of_the_form_of_additional_parameters_are_as_large_as_stated_and_corrected_by_them() -> None:
    sizes = (("bluh:10", 0.8e-6), ("bluh:7-8", -0.3e-6), ("bluh:50", 0.5e-6))
    errors = _errors(additional=sizes)
    image_format = format_in_calibration_axes(
        CAMERA.half_format, 0, Tiles(*((-float(seam), float(seam)) for seam in errors.seams))
    )
    for selection, size in sizes:
        parameters = additional_parameters(selection, image_format)
        alone = _errors(additional=((selection, size),))
        grid = np.stack(np.meshgrid(*(np.linspace(-half, half, 401) for half in HALF)), -1).reshape(-1, 2)
        if len(parameters.names) == 1:
            largest = np.linalg.norm(alone.error(grid), axis=1).max()
            assert largest == pytest.approx(abs(size), rel=1e-2)
        values = np.linalg.lstsq(
            parameters.basis(_places()).reshape(-1, len(parameters.names)), -alone.error(_places()).ravel()
        )[0]
        assert (np.sign(values) == np.sign(size)).all()
        np.testing.assert_allclose(
            alone.error(grid), -correction(parameters, values, grid), atol=1e-12, rtol=0.0
        )
    together = sum(_errors(additional=(one,)).error(_places()) for one in sizes)
    np.testing.assert_allclose(errors.error(_places()), together, atol=1e-18)
    measured, unique = errors.measured_from_ideal(_places())
    assert unique.mean() > 0.997
    np.testing.assert_allclose(errors.ideal_from_measured(measured[unique]), _places()[unique], atol=1e-15)
