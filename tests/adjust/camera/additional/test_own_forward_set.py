"""A forward set of one's own that measures the image by the sides of its format, not by the focal length."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat, ParameterSet, Term, stacked
from adjust.camera.additional.correction import measured_from_ideal
from adjust.camera.additional.register import AdditionalParameters
from adjust.camera.additional.selection import SelectedTerms
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.errors import AdditionalParametersError

HALF_X, HALF_Y = 0.027, 0.036


def _basis(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    u, v = xy[:, 0] / image_format.half_x, xy[:, 1] / image_format.half_y
    columns = {"bend": (1e-6 * u * u, np.zeros_like(u)), "bow": (np.zeros_like(u), 1e-6 * u * v)}
    return stacked([columns[name] for name in names], len(xy))


SHEET = ParameterSet(
    "sheet",
    "a bent sheet",
    "this file",
    (Term("bend", "x by x²", "µm", "published"), Term("bow", "y by xy", "µm", "published")),
    _basis,
    direction="forward",
)


def sheet(focal_length: float | None) -> AdditionalParameters:
    image_format = ImageFormat(HALF_X, HALF_Y, focal_length=focal_length)
    return AdditionalParameters((SelectedTerms(SHEET, ("bend", "bow")),), image_format)


@pytest.mark.parametrize("focal_length", [0.08, 0.3])
def test_it_displaces_ideal_points_by_what_it_states_in_metres(focal_length: float) -> None:
    x, y = ideal = np.random.default_rng(2).uniform(-1.0, 1.0, (2, 50)) * [[HALF_X], [HALF_Y]]
    u, v = x / HALF_X, y / HALF_Y
    expected = ideal.T + 1e-6 * np.column_stack([20.0 * u * u, -10.0 * u * v])
    found, inside = measured_from_ideal(sheet(focal_length), np.array([20.0, -10.0]), ideal.T)
    assert inside.all()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)


def test_without_a_focal_length_it_is_refused() -> None:
    parameters = sheet(None)
    calibration = SelfCalibration.of(parameters.names, (parameters,), np.zeros(1, dtype=np.int64))
    assert calibration.forward is not None
    with pytest.raises(AdditionalParametersError, match="Give the focal length"):
        calibration.forward.correction(np.zeros(1, dtype=np.int64), np.zeros((1, 2)), np.ones((1, 2)))
