"""Brown's parameters: hand-computed points, units, and the certificate of the DMC."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.camera.additional.base import ImageFormat, ParameterSet
from adjust.camera.additional.brown import PER_METRE_FROM_PER_MILLIMETRE, SET, SET_IN_MILLIMETRES

FORMAT = ImageFormat(0.046, 0.083)
MICROMETRE = 1e-6


def correction(parameters: ParameterSet, values: dict[str, float], xy: np.ndarray) -> np.ndarray:
    return parameters.basis(xy, FORMAT, tuple(values)) @ np.array(list(values.values()))


def test_every_term_in_a_hand_computed_point() -> None:
    # x = 3 mm, y = 4 mm: r² = 25, r⁴ = 625, r⁶ = 15625 (mm)
    expected_mm = {
        "K1": (75.0, 100.0),
        "K2": (1875.0, 2500.0),
        "K3": (46875.0, 62500.0),
        "P1": (25.0 + 18.0, 24.0),
        "P2": (24.0, 25.0 + 32.0),
        "B1": (3.0, 0.0),
        "B2": (4.0, 0.0),
    }
    basis = SET_IN_MILLIMETRES.basis(np.array([[0.003, 0.004]]), FORMAT, tuple(expected_mm))
    np.testing.assert_allclose(basis[0].T * 1e3, list(expected_mm.values()), rtol=1e-14)


def test_it_is_the_formula_of_opencv_with_p1_and_p2_exchanged() -> None:
    k1, k2, p1, p2, k3 = -0.12, 0.03, 4e-4, -7e-4, -0.002
    x, y = 0.31, -0.22
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    distorted = (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )
    values = {"K1": k1, "K2": k2, "K3": k3, "P1": p2, "P2": p1}
    ours = np.array([[x, y]]) + correction(SET, values, np.array([[x, y]]))
    np.testing.assert_allclose(ours[0], distorted, rtol=1e-15)


def test_the_two_units_describe_the_same_correction() -> None:
    per_mm = np.array([1e-5, -2e-9, 3e-13, 1e-7, -2e-7, 1e-4, -3e-5])
    xy = np.random.default_rng(1).uniform(-0.04, 0.04, (50, 2))
    names = tuple(term.name for term in SET.terms)
    per_m = PER_METRE_FROM_PER_MILLIMETRE * per_mm
    np.testing.assert_allclose(
        SET.basis(xy, FORMAT, names) @ per_m, SET_IN_MILLIMETRES.basis(xy, FORMAT, names) @ per_mm, rtol=1e-12
    )


def test_units_are_named() -> None:
    assert [term.unit for term in SET.terms] == ["1/m²", "1/m⁴", "1/m⁶", "1/m", "1/m", "1", "1"]
    assert [term.unit for term in SET_IN_MILLIMETRES.terms][:4] == ["1/mm²", "1/mm⁴", "1/mm⁶", "1/mm"]


@pytest.mark.parametrize(("radius_mm", "effect_um"), [(20.0, 3.8), (30.0, 7.8), (40.0, 2.0), (49.5, -33.8)])
def test_values_of_a_dmc_certificate_are_per_metre(radius_mm: float, effect_um: float) -> None:
    along = radius_mm * 1e-3 * np.array([[0.6, 0.8]])
    effect = correction(SET, {"K1": 0.6164, "K2": -365.3}, along)
    assert effect[0] @ [0.6, 0.8] == pytest.approx(effect_um * MICROMETRE, abs=0.05 * MICROMETRE)
