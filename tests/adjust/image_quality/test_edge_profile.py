"""The profile without a model: sharpening is noticed, the width right, the response that of ISO 12233."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.signal.windows import tukey

from adjust.arrays import Floats
from adjust.image_quality.edge_fit import EdgeFit, fit_edge
from adjust.image_quality.edge_model import edge_values, transfer
from adjust.image_quality.edge_profile import EdgeProfile, edge_profile, normalized
from adjust.image_quality.edge_samples import samples_of
from adjust.image_quality.iso_12233 import flat_within_half, frequency_response
from tests.adjust.image_quality.synthetic_edges import Kind, edge_image
from tests.grids import diagonal_daily


def fits_of(kind: Kind, seed: int, count: int = 20) -> list[EdgeFit]:
    rng = np.random.default_rng(seed)
    return [fit_edge(samples_of(*edge_image(kind, rng))) for _ in range(count)]


def true_width(kind: Kind) -> float:
    """Full width at half maximum along the normal, of the sharpened line spread function."""
    distance, angle = np.arange(-5.0, 5.0, 1e-3), float(np.deg2rad(kind.slant))

    def spread(shift: float) -> Floats:
        return edge_values(distance + shift, kind.blur**2, angle).slope

    p, q = np.cos(angle), np.sin(angle)
    neighbours = sum(spread(shift) for shift in (p, -p, q, -q))
    values = spread(0.0) - kind.sharpening * (neighbours - 4.0 * spread(0.0))
    above = distance[values > 0.5 * values.max()]
    return float(above[-1] - above[0])


@pytest.mark.parametrize(
    ("slant", "blur", "noise"), diagonal_daily([3.0, 8.0, 15.0, 40.0], [0.3, 0.5, 0.8], [1.0, 3.0, 5.0])
)
def test_sharpened_edges_are_flagged_and_their_width_is_right(
    slant: float, blur: float, noise: float
) -> None:
    kind = Kind(blur, slant, noise, sharpening=0.3)
    profile = edge_profile(normalized(fits_of(kind, seed=5)))
    width, sigma = profile.width()
    assert profile.sharpened
    assert abs(width - true_width(kind)) < 0.1
    assert sigma < 0.1


@pytest.mark.parametrize(
    ("slant", "blur", "noise"), diagonal_daily([3.0, 15.0, 40.0], [0.3, 0.5, 0.8], [1.0, 5.0])
)
def test_edges_that_were_not_sharpened_are_not_flagged(slant: float, blur: float, noise: float) -> None:
    fits = fits_of(Kind(blur, slant, noise), seed=6)
    assert not edge_profile(normalized(fits)).sharpened
    assert not any(edge_profile(normalized([fit])).sharpened for fit in fits)


def test_the_stated_sigma_of_a_width_is_that_of_the_coefficients() -> None:
    """Closed case: derivatives of the width by differences, in a profile that is not symmetric."""
    profile = edge_profile(normalized(fits_of(Kind(0.5, 9.0, 5.0), seed=8, count=2)))
    spline, step = profile.spline, 0.004

    def width(move: Floats) -> float:
        return replace(profile, spline=BSpline(spline.t, spline.c + move, spline.k)).width()[0]

    by_coefficients = np.array([width(move) - width(-move) for move in step * np.eye(len(spline.c))]) / (
        2.0 * step
    )
    expected = np.sqrt(by_coefficients @ profile.covariance @ by_coefficients)
    assert profile.width()[1] == pytest.approx(expected, rel=0.05)


def test_the_stated_sigma_of_a_width_is_that_of_the_scatter() -> None:
    widths = [edge_profile(normalized([fit])).width() for fit in fits_of(Kind(0.5, 9.0, 1.0), 8, 60)]
    ratio = np.std([width for width, _ in widths]) / np.sqrt(np.mean([sigma**2 for _, sigma in widths]))
    # 60 values know their standard deviation to 9 %.
    assert 0.7 < ratio < 1.3


@pytest.mark.parametrize(("slant", "blur"), diagonal_daily([5.0, 15.0, 30.0], [0.3, 0.5, 0.8]))
def test_the_response_is_the_transfer_of_blur_and_pixel(slant: float, blur: float) -> None:
    response = frequency_response(normalized(fits_of(Kind(blur, slant, 1.0), seed=9)))
    frequency = np.linspace(0.0, 1.0, 4001)
    true = transfer(frequency, blur**2, float(np.deg2rad(slant)))
    assert response.mtf50 == pytest.approx(frequency[np.argmax(true < 0.5)], rel=0.015)
    assert response.at_nyquist == pytest.approx(float(np.interp(0.5, frequency, true)), abs=0.01)


@pytest.mark.skipif(
    importlib.util.find_spec("quickMTF") is None, reason="pip install quickMTF matplotlib, for comparison"
)
@pytest.mark.parametrize("slant", [4.0, 7.0, 12.0])
@pytest.mark.parametrize("blur", [0.3, 0.5, 0.8])
def test_another_implementation_of_iso_12233_has_the_same_mtf50(slant: float, blur: float) -> None:
    from quickMTF.SFR_MTF import sfr_mtfcal

    class Peer(sfr_mtfcal):  # type: ignore[misc]
        """Its window four times as wide as the line spread function: the usual one raises MTF50 by 2.5 %."""

        def filter_window(self, lsf: Floats, oversampling: int) -> object:
            return super().filter_window(lsf, oversampling, win_width_factor=4.0)

    kind = Kind(blur, slant, 0.5, contrast=150.0, size=96, length=80.0)
    rng = np.random.default_rng(4)
    ours, theirs = [], []
    for _ in range(5):
        image, line = edge_image(kind, rng)
        ours.append(frequency_response(normalized([fit_edge(samples_of(image, line))])).mtf50)
        patch = image[8:-8, 8:-8]
        # It corrects neither bins nor differences: with narrow bins there is nothing to correct.
        curve, _ = Peer().calc_sfr(patch, oversampling=8)
        theirs.append(float(np.interp(-0.5, -curve[:, 1][curve[:, 0] < 0.8], curve[:, 0][curve[:, 0] < 0.8])))
    assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=0.02)


@pytest.mark.parametrize("count", [47, 48, 49, 50])
def test_the_window_is_that_of_scipy(count: int) -> None:
    np.testing.assert_array_equal(flat_within_half(count), tukey(count, 0.5))


@pytest.mark.parametrize(
    ("overshoot", "sigma", "sharpened"), [(0.009, 1e-4, False), (0.02, 0.01, False), (0.02, 1e-3, True)]
)
def test_an_overshoot_is_one_if_it_is_neither_noise_nor_too_small_to_be_seen(
    overshoot: float, sigma: float, *, sharpened: bool
) -> None:
    spline = BSpline(np.arange(8.0), np.ones(4), 3)
    assert EdgeProfile(spline, np.eye(4), overshoot, sigma).sharpened is sharpened
