"""The profile across edges without a model of the blur: a spline through all pixels, and its derivative.

The edge spread function is a cubic spline by least squares over the unbinned distances, so nothing has to be
subtracted for the width of bins or the length of differences. Its derivative is the line spread function; the
full width at half maximum of that is the factor of effective resolution where the model of `edge_model` does
not hold, as in sharpened images. It is the width along the normal: of an oblique edge the pixel is narrower
there than along its sides, by up to 0.1 px at 45°.

An image is called sharpened if its edges overshoot: without sharpening, the profile comes from the dark to
the bright level without ever exceeding them. The mean of strips of half a pixel at both sides of the edge is
compared with the levels farther out. Edges of one kind are taken together, for what noise hides in one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from adjust.arrays import Floats
from adjust.image_quality.edge_fit import TREND, EdgeFit
from adjust.image_quality.edge_samples import REACH

_DEGREE = 3
#: Intervals of the spline in standard deviations of the line spread function, and their limits, px.
_INTERVAL, _NARROWEST, _WIDEST = 0.6, 0.25, 0.75
#: Where the levels of the two sides are taken, px from the edge.
LEVELS_FROM = 3.5
_STRIP, _STRIPS_FROM = 0.5, 0.5
_FINE = 1e-3
#: Overshoot in its standard deviations, and in parts of the contrast, above which edges are sharpened.
SIGNIFICANT, VISIBLE = 4.0, 0.01


@dataclass(frozen=True, eq=False)
class NormalizedPixels:
    """Pixels (n,) around edges.

    Attributes
    ----------
    distance : from their edge, px, positive on the bright side.
    part : grey value in parts of the contrast, 0 on the dark and 1 on the bright level.
    noise : standard deviation of one, in parts of the contrast.
    spread : standard deviation of the line spread function as it was adjusted, px.
    """

    distance: Floats
    part: Floats
    noise: float
    spread: float


def normalized(fits: Sequence[EdgeFit]) -> NormalizedPixels:
    """The pixels of adjusted edges, each between its own levels; at least one edge.

    Raises
    ------
    ValueError
        If an edge has no pixels on one of its levels.
    """
    distances, parts, variances = [], [], []
    for fit in fits:
        distance = fit.distance
        grey = fit.samples.grey - fit.values[TREND] * fit.samples.along(fit.angle)
        dark, bright = (grey[side * distance > LEVELS_FROM] for side in (-1.0, 1.0))
        if min(len(dark), len(bright)) < 2:
            raise ValueError("an edge without pixels on both levels")
        contrast = bright.mean() - dark.mean()
        distances.append(distance)
        parts.append((grey - dark.mean()) / contrast)
        variances.append(0.5 * (dark.var(ddof=1) + bright.var(ddof=1)) / contrast**2)
    noise = float(np.sqrt(np.mean(variances)))
    # The pixel is a box of side 1, or two that are as wide together.
    spread = float(np.sqrt(np.median([fit.blur for fit in fits]) ** 2 + 1.0 / 12.0))
    return NormalizedPixels(np.concatenate(distances), np.concatenate(parts), noise, spread)


@dataclass(frozen=True, eq=False)
class EdgeProfile:
    """The profile across edges, in parts of their contrast.

    Attributes
    ----------
    spline : edge spread function of the distance, px.
    covariance : of its coefficients.
    overshoot, sigma_overshoot : the largest mean of a strip beyond the levels, both sides together.
    """

    spline: BSpline
    covariance: Floats
    overshoot: float
    sigma_overshoot: float

    @property
    def sharpened(self) -> bool:
        """Whether the overshoot is more than noise."""
        return self.overshoot > max(SIGNIFICANT * self.sigma_overshoot, VISIBLE)

    def width(self) -> tuple[float, float]:
        """Full width at half maximum of the line spread function, px, and its standard deviation."""
        lsf = self.spline.derivative()
        d = np.arange(-REACH + 1.0, REACH - 1.0, _FINE)
        values = lsf(d)
        top = int(np.argmax(values))
        below = values < 0.5 * values[top]
        left = top - int(np.argmax(below[top::-1]))
        right = top + int(np.argmax(below[top:]))
        ends = np.array([d[left], d[right]])
        # The ends move with half the height at the top, and with the function there.
        basis = _derivative_basis(self.spline, np.array([d[top], *ends]))
        moved = (0.5 * basis[0] - basis[1:]) / lsf.derivative()(ends)[:, None]
        by_coefficients = moved[1] - moved[0]
        return float(ends[1] - ends[0]), float(np.sqrt(by_coefficients @ self.covariance @ by_coefficients))


def edge_profile(pixels: NormalizedPixels) -> EdgeProfile:
    """The profile through the pixels of one edge or several."""
    interval = float(np.clip(_INTERVAL * pixels.spread, _NARROWEST, _WIDEST))
    spline, cofactor = _spline_through(pixels.distance, pixels.part, interval)
    overshoot, sigma = _overshoot(pixels)
    return EdgeProfile(spline, cofactor * pixels.noise**2, overshoot, sigma)


def _spline_through(distance: Floats, part: Floats, interval: float) -> tuple[BSpline, Floats]:
    """The spline by least squares, and the cofactors of its coefficients."""
    reach = float(np.max(np.abs(distance))) + 1e-9
    inner = np.linspace(-reach, reach, max(round(2.0 * reach / interval), 1) + 1)
    knots = np.concatenate([[-reach] * _DEGREE, inner, [reach] * _DEGREE])
    basis = BSpline.design_matrix(distance, knots, _DEGREE)
    normal = np.asarray((basis.T @ basis).toarray(), dtype=np.float64)
    cofactor = np.asarray(np.linalg.pinv(normal, hermitian=True), dtype=np.float64)
    return BSpline(knots, np.asarray(cofactor @ (basis.T @ part)), _DEGREE), cofactor


def _derivative_basis(spline: BSpline, at: Floats) -> Floats:
    """Derivatives (m, k) of the line spread function at places (m,) by the coefficients."""
    unit = BSpline(spline.t, np.eye(len(spline.c)), spline.k)
    return np.asarray(unit.derivative()(at))


def _overshoot(pixels: NormalizedPixels) -> tuple[float, float]:
    """The largest mean beyond the levels of strips at both sides, and its standard deviation."""
    far = np.abs(pixels.distance)
    beyond = np.where(pixels.distance > 0.0, pixels.part - 1.0, -pixels.part)
    strip = np.floor((far - _STRIPS_FROM) / _STRIP).astype(np.int64)
    strips = round((LEVELS_FROM - _STRIPS_FROM) / _STRIP)
    used = (strip >= 0) & (strip < strips)
    count = np.maximum(np.bincount(strip[used], minlength=strips), 1)
    mean = np.bincount(strip[used], beyond[used], minlength=strips) / count
    largest = int(np.argmax(mean))
    of_levels = pixels.noise / np.sqrt(max(int(np.count_nonzero(far > LEVELS_FROM)), 1))
    return float(mean[largest]), float(np.hypot(pixels.noise / np.sqrt(count[largest]), of_levels))
