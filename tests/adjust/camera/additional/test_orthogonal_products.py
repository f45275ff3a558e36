"""Ebner, Grün, Legendre, Chebyshev: counts, closed forms, and what is orthogonal to what."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from adjust.camera.additional import ebner, gruen
from adjust.camera.additional.base import ImageFormat, ParameterSet
from adjust.camera.additional.chebyshev import chebyshev
from adjust.camera.additional.legendre import legendre

SQUARE, ACROSS = ImageFormat(0.05, 0.05), ImageFormat(0.034, 0.052)
FORMATS = pytest.mark.parametrize("image_format", [SQUARE, ACROSS], ids=["square", "rectangular"])


def grid(image_format: ImageFormat, size: int) -> np.ndarray:
    """Points (size², 2) of a regular grid from edge to edge."""
    steps = np.linspace(-1.0, 1.0, size)
    return np.array(list(itertools.product(steps, steps))) * [image_format.half_x, image_format.half_y]


def covered(image_format: ImageFormat) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights (n,) of Gauss's quadrature: exact means over a uniformly covered image."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    xy = np.array(list(itertools.product(nodes, nodes))) * [image_format.half_x, image_format.half_y]
    return xy, np.outer(weights, weights).ravel() / 4.0


def exterior_orientation(xy: np.ndarray) -> np.ndarray:
    """What the six elements do to a vertical photograph of flat ground: (n, 2, 6)."""
    x, y = xy.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    columns = [(one, zero), (zero, one), (x, y), (-y, x), (x * x, x * y), (x * y, y * y)]
    return np.moveaxis(np.array(columns), 0, -1).swapaxes(0, 1)


def correlations(basis: np.ndarray, weights: np.ndarray) -> np.ndarray:
    gram = np.einsum("n,nci,ncj->ij", weights, basis, basis)
    length = np.sqrt(np.diag(gram))
    return gram / np.outer(length, length)


def evaluate(parameters: ParameterSet, xy: np.ndarray, image_format: ImageFormat) -> np.ndarray:
    return parameters.basis(xy, image_format, tuple(term.name for term in parameters.terms))


def orientation_without_means(xy: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The six columns, made orthonormal."""
    columns = (np.sqrt(weights)[:, None, None] * exterior_orientation(xy)).reshape(2 * len(xy), 6)
    orthonormal = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    return orthonormal.reshape(len(xy), 2, 6) / np.sqrt(weights)[:, None, None]


@FORMATS
@pytest.mark.parametrize(
    ("parameters", "size", "count"), [(ebner.SET, 3, 12), (gruen.SET, 5, 44)], ids=["Ebner", "Grün"]
)
def test_ebner_and_gruen_are_orthogonal_on_their_points(
    parameters: ParameterSet, size: int, count: int, image_format: ImageFormat
) -> None:
    xy = grid(image_format, size)
    weights = np.full(len(xy), 1.0 / len(xy))
    both = np.concatenate([evaluate(parameters, xy, image_format), orientation_without_means(xy, weights)], 2)
    correlation = correlations(both, weights)
    assert correlation.shape == (count + 6, count + 6)
    assert count + 6 == 2 * size**2  # nothing else is left
    np.testing.assert_allclose(correlation, np.eye(count + 6), atol=1e-12)


def test_ebner_in_a_hand_computed_point() -> None:
    # b = 50 mm, x = 10, y = 20 mm: k = 100 − 5000/3, l = 400 − 5000/3
    k, l_, x, y = 100.0 - 5000.0 / 3.0, 400.0 - 5000.0 / 3.0, 10.0, 20.0
    expected = [
        (x, -y),
        (y, x),
        (-2 * k, x * y),
        (x * y, -2 * l_),
        (l_, 0),
        (0, k),
        (x * l_, 0),
        (0, y * k),
        (y * k, 0),
        (0, x * l_),
        (k * l_, 0),
        (0, k * l_),
    ]
    basis = evaluate(ebner.SET, np.array([[0.010, 0.020]]), SQUARE)[0] * 1e3
    np.testing.assert_allclose(basis.T, expected, rtol=1e-12)


@pytest.mark.parametrize(("degree", "count"), [(2, 12), (4, 44), (5, 66)])
def test_counts_of_legendre_and_chebyshev(degree: int, count: int) -> None:
    assert len(legendre(degree).terms) == len(chebyshev(degree).terms) == count


@FORMATS
def test_legendre_is_orthogonal_over_a_covered_image(image_format: ImageFormat) -> None:
    xy, weights = covered(image_format)
    correlation = correlations(evaluate(legendre(5), xy, image_format), weights)
    np.testing.assert_allclose(correlation, np.eye(66), atol=1e-12)


@FORMATS
def test_legendre_is_orthogonal_to_the_exterior_orientation_from_its_fifth_term_on(
    image_format: ImageFormat,
) -> None:
    xy, weights = covered(image_format)
    both = np.concatenate(
        [evaluate(legendre(5), xy, image_format), orientation_without_means(xy, weights)], 2
    )
    between = np.abs(correlations(both, weights)[:66, 66:])
    assert between[4:].max() < 1e-12
    if image_format is SQUARE:
        assert between[:2].max() < 1e-12
        assert between[2:4].max() == pytest.approx(0.089, abs=5e-4)


def test_legendre_polynomials_are_those_of_numpy() -> None:
    x = np.linspace(-0.034, 0.034, 9)
    xy = np.column_stack([x, np.full(9, 0.052)])  # all P_j(v) are 1 at the edge
    single = {term.meaning: term.name for term in legendre(5).terms}
    for degree in (3, 4, 5):
        basis = legendre(5).basis(xy, ACROSS, (single[f"P{degree}(x) in x"],))
        expected = np.polynomial.Legendre.basis(degree)(x / 0.034)
        np.testing.assert_allclose(basis[:, 0, 0], 1e-6 * expected, atol=1e-20)


def test_chebyshev_is_the_cosine_of_a_multiple_but_correlated() -> None:
    angle = np.linspace(0.0, np.pi, 7)
    xy = np.column_stack([0.034 * np.cos(angle), np.full(7, 0.052)])
    single = {term.meaning: term.name for term in chebyshev(5).terms}
    basis = chebyshev(5).basis(xy, ACROSS, (single["T5(x) in x"],))
    np.testing.assert_allclose(basis[:, 0, 0], 1e-6 * np.cos(5 * angle), atol=1e-20)
    points, weights = covered(ACROSS)
    correlation = correlations(evaluate(chebyshev(5), points, ACROSS), weights)
    assert np.abs(correlation - np.eye(66)).max() == pytest.approx(0.50, abs=0.005)


@pytest.mark.parametrize("make", [legendre, chebyshev])
@pytest.mark.parametrize("degree", [1, 11])
def test_degrees_without_sense_are_refused(make, degree: int) -> None:
    with pytest.raises(ValueError, match=f"2 … 10, not {degree}"):
        make(degree)
