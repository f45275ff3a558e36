"""Edges of an image that are good enough, measured: blur, factor, contrast, noise, straightness.

An edge is taken if its adjustment converges near where it was found, its contrast is ten times the scatter of
the pixels on either side out to 9 px (texture and lines fail here), it is straight to a tenth of a pixel
beyond its noise, and it is slanted enough that its pixels see it at all phases.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from adjust.image_quality.edge_fit import OFFSET, EdgeFit, fit_edge, straightness
from adjust.image_quality.edge_profile import LEVELS_FROM
from adjust.image_quality.edge_samples import EdgeLine, EdgeSamples, samples_of

#: How far the levels of both sides must reach, px from the edge: beyond its pixels, or it is that of a line.
LEVELS_TO = 9.0
#: Contrast in standard deviations of the noise at least.
CONTRAST = 10.0
_MOVED, _TURNED = 3.0, np.deg2rad(6.0)
_STRAIGHT, _BENT = 0.1, 0.2
_SOFTEST = 2.5
#: Pixels along the edge over which it must cross a row or column, and angle it must keep from the diagonal.
_CROSSED, _FROM_DIAGONAL = 1.0, np.deg2rad(2.0)

Refusal = Literal[
    "outside the image", "not adjusted", "slant", "low contrast", "texture", "not straight", "soft"
]


@dataclass(frozen=True, eq=False)
class MeasuredEdge:
    """An edge that was taken.

    Attributes
    ----------
    line : in the image, as adjusted.
    fit : its adjustment.
    noise : standard deviation of the pixels on its levels, grey values: the larger of both sides.
    bend : px.
    """

    line: EdgeLine
    fit: EdgeFit
    noise: float
    bend: float

    def moved(self, rows: int) -> MeasuredEdge:
        """The same edge in an image that begins so many rows earlier."""
        return replace(self, line=replace(self.line, row=self.line.row + rows))


def measured_edge(grey: NDArray[Any], line: EdgeLine) -> MeasuredEdge | Refusal:
    """Adjust an edge found in an image (rows, columns), or say why it is none to measure with."""
    if not _inside(grey.shape, line):
        return "outside the image"
    samples = samples_of(grey, line)
    if not np.isfinite(samples_of(grey, line, LEVELS_TO).grey).all():
        return "outside the image"
    fit = fit_edge(samples)
    turned = abs(fit.angle - line.angle)
    if not fit.converged or abs(fit.values[OFFSET]) > _MOVED or turned > _TURNED or fit.contrast <= 0.0:
        return "not adjusted"
    adjusted = _adjusted(line, fit)
    crossed = line.length * np.sin(adjusted.slant)
    if crossed < _CROSSED or adjusted.slant > 0.25 * np.pi - _FROM_DIAGONAL:
        return "slant"
    noise = _scatter(samples_of(grey, adjusted, LEVELS_TO))
    if not fit.contrast >= CONTRAST * fit.noise:
        return "low contrast"
    if not fit.contrast >= CONTRAST * noise:
        return "texture"
    shifts = straightness(fit)
    if shifts.rms > np.hypot(_STRAIGHT, 1.25 * np.sqrt(np.mean(shifts.sigma**2))) or shifts.bend > _BENT:
        return "not straight"
    return MeasuredEdge(adjusted, fit, noise, shifts.bend) if fit.blur <= _SOFTEST else "soft"


def _inside(shape: tuple[int, ...], line: EdgeLine) -> bool:
    """Whether all pixels next to the edge are in the image."""
    sine, cosine = abs(np.sin(line.angle)), abs(np.cos(line.angle))
    half_width = LEVELS_TO * cosine + 0.5 * line.length * sine
    half_height = LEVELS_TO * sine + 0.5 * line.length * cosine
    return bool(
        half_width <= line.column <= shape[1] - 1 - half_width
        and half_height <= line.row <= shape[0] - 1 - half_height
    )


def _adjusted(line: EdgeLine, fit: EdgeFit) -> EdgeLine:
    offset, angle = float(fit.values[OFFSET]), fit.angle
    column, row = line.column + offset * np.cos(angle), line.row + offset * np.sin(angle)
    return EdgeLine(float(column), float(row), angle, line.length)


def _scatter(samples: EdgeSamples) -> float:
    """Standard deviation of the pixels on the levels, the larger of both sides, grey values."""
    distance = samples.across(samples.line.angle)
    sides = (samples.grey[side * distance > LEVELS_FROM] for side in (-1.0, 1.0))
    return max(float(np.std(side, ddof=1)) if len(side) > 1 else np.inf for side in sides)
