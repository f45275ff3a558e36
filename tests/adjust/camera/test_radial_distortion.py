"""Stated radial distortion as Brown's parameters: recovered, reproduced, with no superfluous terms."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.brown import SET
from adjust.camera.radial_distortion import RadialDistortion, fit_distortion
from adjust.errors import InconsistentBlockError

C = 0.153
#: K0 … K3 of a lens with 9 µm of balanced distortion.
TRUE = np.array([1.6e-4, -2.3e-2, 0.8, -9.0])
RADIUS = np.arange(0.01, 0.15, 0.01)
NO_SHIFT = np.zeros(2)
ALL = np.empty(0)

#: Calibrated focal length, mm, symmetric radial distortion at 7.5 … 40°, µm, and K0, K1, K2, mm, of reports
#: OSL/2985, OSL/3030 and OSL/3221 of the U.S. Geological Survey (Wild RC30 cameras, 2003 to 2006).
ANGLES = np.deg2rad([7.5, 15.0, 22.7, 30.0, 35.0, 40.0])
USGS = {
    "OSL/2985": (153.743, (-1, -1, -1, -1, 0, 1), (0.2616e-4, -0.2295e-8, 0.1454e-13)),
    "OSL/3030": (153.247, (-1, -1, -1, 0, 1, 1), (0.3285e-4, -0.5215e-8, 0.1642e-12)),
    "OSL/3221": (153.527, (-1, -2, -3, -3, -1, 3), (0.6404e-4, -0.3587e-8, -0.9784e-13)),
}


def radial(radius: Floats, values: Floats = TRUE) -> Floats:
    """Outward displacement: the correction with its sign turned."""
    return -np.polynomial.polynomial.polyval(radius**2, values) * radius


def test_the_parameters_of_a_lens_are_recovered() -> None:
    stated = RadialDistortion(RADIUS, ALL, radial(RADIUS)[:, None], 1e-11, NO_SHIFT)
    assert 5e-6 < np.abs(stated.outward).max() < 2e-5
    found = fit_distortion(stated, C)
    assert found.names == ("K1", "K2", "K3")
    np.testing.assert_allclose(found.values, TRUE[1:] / (1.0 + TRUE[0]), rtol=1e-8)
    assert found.focal_length == pytest.approx(C / (1.0 + TRUE[0]), rel=1e-12)
    assert found.fits
    assert found.rms < 1e-13


def test_corrected_images_are_those_of_the_focal_length_found() -> None:
    """The images of a ray at the angle α are at c tan α + d; corrected, at c' tan α."""
    tangent = RADIUS / C
    measured = RADIUS + radial(RADIUS)
    stated = RadialDistortion(measured, ALL, radial(RADIUS)[:, None], 1e-9, NO_SHIFT)
    found = fit_distortion(stated, C)
    xy = np.column_stack([measured * np.cos(0.7), measured * np.sin(0.7)])
    correction = SET.basis(xy, ImageFormat(0.1, 0.1), found.names) @ found.values
    np.testing.assert_allclose(
        np.hypot(*(xy + correction).T), found.focal_length * tangent, rtol=0.0, atol=3e-9
    )


@pytest.mark.parametrize("report", list(USGS))
def test_tables_rounded_to_a_micrometre_agree_with_the_printed_parameters(report: str) -> None:
    c_mm, table, printed = USGS[report]
    radius = 1e-3 * c_mm * np.tan(ANGLES)
    outward = 1e-6 * np.array(table, dtype=np.float64)
    found = fit_distortion(RadialDistortion(radius, ALL, outward[:, None], 0.3e-6, NO_SHIFT), 1e-3 * c_mm)
    assert found.fits
    assert len(found.names) <= 2
    scale = 1e-3 * c_mm / found.focal_length
    ours = (scale - 1.0) * radius
    for name, value in zip(found.names, found.values, strict=True):
        ours += scale * value * radius ** (2 * int(name[1]) + 1)
    theirs = -radial(radius, np.array(printed) * np.array([1.0, 1e6, 1e12]))
    np.testing.assert_allclose(theirs, -outward, atol=0.75e-6)
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=0.75e-6)


def test_no_more_terms_than_the_values_support() -> None:
    generator = np.random.default_rng(1)
    for number, values in ((0, [2e-5]), (1, [1.6e-4, -2.3e-2]), (2, [1.6e-4, -2.3e-2, 0.8])):
        counts = []
        for _ in range(200):
            noisy = radial(RADIUS, np.array(values)) + generator.normal(0.0, 2e-7, len(RADIUS))
            found = fit_distortion(RadialDistortion(RADIUS, ALL, noisy[:, None], 2e-7, NO_SHIFT), C)
            counts.append(len(found.names))
        # One in twenty is expected to get a term too many.
        assert min(counts) == number
        assert 0.9 < np.mean(np.array(counts) == number) < 0.99


def test_an_offset_of_the_point_of_symmetry_is_a_decentring() -> None:
    """Against the exact displacement about that point, over the whole image."""
    shift = np.array([12e-6, -8e-6])
    found = fit_distortion(RadialDistortion(RADIUS, ALL, radial(RADIUS)[:, None], 1e-9, shift), C)
    assert found.names[-2:] == ("P1", "P2")
    grid = np.linspace(-0.1, 0.1, 9)
    xy = np.stack(np.meshgrid(grid, grid), -1).reshape(-1, 2)
    away = xy - shift
    exact = -radial(np.hypot(*away.T))[:, None] * away / np.hypot(*away.T)[:, None]
    scale = C / found.focal_length
    ours = (scale - 1.0) * xy + scale * (SET.basis(xy, ImageFormat(0.1, 0.1), found.names) @ found.values)
    # K0 times the offset is a shift of 2 nm.
    assert np.abs(ours - exact).max() < 1.2e-8
    without = (scale - 1.0) * xy + scale * (
        SET.basis(xy, ImageFormat(0.1, 0.1), found.names[:3]) @ found.values[:3]
    )
    assert np.abs(without - exact).max() > np.abs(ours - exact).max()


def test_decentring_is_found_from_four_semi_diagonals() -> None:
    decentring = np.array([3e-5, -2e-5])
    direction = np.deg2rad([45.0, 135.0, 225.0, 315.0])
    unit = np.column_stack([np.cos(direction), np.sin(direction)])
    outward = radial(RADIUS)[:, None] - 3.0 * RADIUS[:, None] ** 2 * (unit @ decentring)
    found = fit_distortion(RadialDistortion(RADIUS, direction, outward, 1e-10, NO_SHIFT), C)
    assert found.names == ("K1", "K2", "K3", "P1", "P2")
    np.testing.assert_allclose(found.values[3:], decentring / (1.0 + TRUE[0]), rtol=1e-6)
    assert found.redundancy == 4 * len(RADIUS) - 6


def test_a_distortion_without_a_smooth_curve_does_not_fit() -> None:
    jagged = 1e-5 * (-1.0) ** np.arange(len(RADIUS))
    assert not fit_distortion(RadialDistortion(RADIUS, ALL, jagged[:, None], 1e-6, NO_SHIFT), C).fits


def test_a_single_value_is_no_table() -> None:
    with pytest.raises(InconsistentBlockError, match="fewer values than parameters"):
        fit_distortion(RadialDistortion(RADIUS[:1], ALL, np.zeros((1, 1)), 1e-6, NO_SHIFT), C)
