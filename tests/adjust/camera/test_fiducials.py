"""Affine interior orientation from fiducial marks."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats

from adjust.arrays import Floats, Ints
from adjust.camera.fiducials import film_orientations
from adjust.errors import InconsistentBlockError

MARKS = np.array(
    [(x, y) for x in (-0.11, 0.0, 0.11) for y in (-0.11, 0.0, 0.11) if (x, y) != (0.0, 0.0)], dtype=np.float64
)
SHRINKAGE = 1e-4


def film(images: int, noise: float, seed: int = 1) -> tuple[Ints, Floats, Floats, Floats]:
    """Index, measured and calibrated marks, and the true transformation to the camera (n, 2, 3)."""
    generator = np.random.default_rng(seed)
    stretch = (1.0 - SHRINKAGE) * (np.eye(2) + generator.normal(0.0, 5e-5, (images, 2, 2)))
    shift = generator.normal(0.0, 2e-4, (images, 2))
    image = np.repeat(np.arange(images), len(MARKS))
    calibrated = np.tile(MARKS, (images, 1))
    scanned = np.einsum("kij,kj->ki", stretch[image], calibrated) + shift[image]
    back = np.linalg.inv(stretch)
    true = np.concatenate([-np.einsum("nij,nj->ni", back, shift)[:, :, None], back], axis=2)
    return image, scanned + generator.normal(0.0, noise, scanned.shape), calibrated, true


def test_without_noise_the_deformation_is_undone_exactly() -> None:
    image, measured, calibrated, true = film(20, 0.0)
    found = film_orientations(20, image, measured, calibrated)
    np.testing.assert_allclose(found.coefficients, true, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(found.applied(image, measured), calibrated, atol=1e-15)
    assert np.abs(found.residual).max() < 1e-15


def test_errors_have_the_stated_standard_deviations() -> None:
    """1 µm: χ² of the six parameters of 400 images, and of σ0."""
    images, noise = 400, 1e-6
    image, measured, calibrated, true = film(images, noise)
    found = film_orientations(images, image, measured, calibrated)
    error = (found.coefficients - true) / noise
    squares = np.einsum("nij,njk,nik->n", error, np.linalg.inv(found.cofactor), error)
    low, high = scipy.stats.chi2.ppf((0.001, 0.999), 6 * images)
    assert low < squares.sum() < high
    assert np.all(found.redundancy == 2 * len(MARKS) - 6)
    low, high = scipy.stats.chi2.ppf((0.001, 0.999), found.redundancy.sum())
    assert low < np.sum(found.redundancy * found.sigma0**2) / noise**2 < high


def test_redundancy_numbers_add_up_to_the_redundancy() -> None:
    image, measured, calibrated, _ = film(5, 1e-6)
    found = film_orientations(5, image, measured, calibrated)
    np.testing.assert_allclose(2.0 * np.bincount(image, found.redundancy_number), found.redundancy)


def test_three_marks_determine_it_without_a_check() -> None:
    found = film_orientations(
        1, np.zeros(3, dtype=np.int64), 1.0001 * MARKS[[0, 1, 5]] + 0.002, MARKS[[0, 1, 5]]
    )
    assert found.redundancy[0] == 0
    assert np.isnan(found.sigma0[0])
    assert np.abs(found.residual).max() < 1e-12


@pytest.mark.parametrize(("rows", "words"), [([0, 7], "has 2 fiducial marks"), ([0, 1, 2], "are on a line")])
def test_too_few_marks_and_marks_on_a_line_are_refused(rows: list[int], words: str) -> None:
    with pytest.raises(InconsistentBlockError, match=words):
        film_orientations(1, np.zeros(len(rows), dtype=np.int64), MARKS[rows], MARKS[rows])
