"""Fourier parameters: counts, closed forms, orthogonality."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.fourier import fourier, frequencies

FORMAT = ImageFormat(0.034, 0.052)


@pytest.mark.parametrize(("order", "count"), [(1, 16), (2, 48), (3, 96)])
def test_counts(order: int, count: int) -> None:
    assert len(fourier(order).terms) == count


def test_the_first_order_has_four_directions() -> None:
    assert set(frequencies(1)) == {(1, 0), (0, 1), (1, 1), (1, -1)}


def test_orthogonal_over_a_covered_image() -> None:
    steps = (np.arange(16) + 0.5) / 8.0 - 1.0  # exact for waves up to the eighth
    xy = np.array(list(itertools.product(steps, steps))) * [0.034, 0.052]
    parameters = fourier(3)
    basis = parameters.basis(xy, FORMAT, tuple(term.name for term in parameters.terms)) * 1e6
    gram = np.einsum("nci,ncj->ij", basis, basis) / len(xy)
    np.testing.assert_allclose(gram, 0.5 * np.eye(96), atol=1e-12)


def test_terms_are_what_their_meaning_says() -> None:
    xy = np.random.default_rng(3).uniform(-1.0, 1.0, (20, 2)) * [0.034, 0.052]
    u, v = (xy / [0.034, 0.052]).T
    name_of = {term.meaning: term.name for term in fourier(2).terms}
    names = (name_of["cos(1, -2) in x"], name_of["sin(1, -2) in y"], name_of["sin(0, 2) in x"])
    basis = fourier(2).basis(xy, FORMAT, names) * 1e6
    wave = np.pi * (u - 2 * v)
    zero = np.zeros(20)
    expected = [[np.cos(wave), zero], [zero, np.sin(wave)], [np.sin(2 * np.pi * v), zero]]
    np.testing.assert_allclose(np.moveaxis(basis, 0, -1).swapaxes(0, 1), expected, atol=1e-14)


def test_a_wave_along_x_resembles_a_change_of_scale() -> None:
    steps = (np.arange(200) + 0.5) / 100.0 - 1.0
    xy = np.array(list(itertools.product(steps, steps))) * 0.05
    name = next(term.name for term in fourier(1).terms if term.meaning == "sin(1, 0) in x")
    wave = fourier(1).basis(xy, ImageFormat(0.05, 0.05), (name,))[:, :, 0]
    correlation = np.sum(wave * xy) / np.linalg.norm(wave) / np.linalg.norm(xy)
    assert correlation == pytest.approx(0.55, abs=0.005)


def test_orders_without_sense_are_refused() -> None:
    with pytest.raises(ValueError, match="1 … 6, not 0"):
        fourier(0)
