"""Rational polynomials: the terms of the standard, and a fit that finds a ratio of cubics."""

from __future__ import annotations

import numpy as np

from adjust.handover.rational import TERMS, RationalPolynomials, fit_rational_polynomials, monomials


def test_the_order_of_the_terms_is_that_of_the_standard() -> None:
    p, l, h = 2.0, 3.0, 5.0  # noqa: E741
    found = monomials(np.array([[p, l, h]]))[0]
    expected = [
        1, l, p, h, l * p, l * h, p * h, l**2, p**2, h**2, p * l * h, l**3, l * p**2, l * h**2, l**2 * p,
        p**3, p * h**2, l**2 * h, p**2 * h, h**3,
    ]  # fmt: skip
    np.testing.assert_array_equal(found, expected)


def test_a_ratio_of_polynomials_is_found_again() -> None:
    random = np.random.default_rng(3)
    ground = np.array([48.0, 11.0, 500.0]) + random.uniform(-1.0, 1.0, (2000, 3)) * [0.01, 0.02, 100.0]
    size = 0.02 * random.standard_normal((2, 2, TERMS))
    size[0, :, 1:3] += [[0.1, 1.0], [1.0, -0.1]]
    size[1, :, 0] = 1.0
    true = RationalPolynomials(
        np.array([5000.0, 4000.0]),
        np.array([5000.0, 4000.0]),
        np.array([48.0, 11.0, 500.0]),
        np.array([0.01, 0.02, 100.0]),
        size[0],
        size[1],
    )
    image = true.project(ground)
    found = fit_rational_polynomials(ground[:1500], image[:1500])
    assert np.abs(found.project(ground[1500:]) - image[1500:]).max() < 0.02
