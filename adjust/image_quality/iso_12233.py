"""Spatial frequency response of slanted edges following ISO 12233 (edge-based SFR).

The pixels are projected along the edge into bins of a quarter pixel and averaged; the derivative by central
differences is multiplied by a window and transformed. The average over a bin and the difference over
two of them are filters themselves: the response is divided by theirs, sinc(f w) and sinc(2 f w), w the width
of a bin. Frequencies are those across the edge, in cycles/px; the response contains the pixel.

The standard bins along the rows and has later editions correct the frequency by the cosine of the slant; here
distances are taken along the normal at once. The window is flat within half of the reach (Tukey): Hamming's,
over so few pixels, would raise the response of a blur of 0.8 px by 5 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.image_quality.edge_profile import NormalizedPixels
from adjust.image_quality.edge_samples import REACH

BIN = 0.25
NYQUIST = 0.5
_LAST = 1.0
#: Zeros behind the window, for a finer grid of frequencies.
_PADDED = 512


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Spatial frequency response.

    Attributes
    ----------
    frequency : (m,) from 0 to 1, cycles/px.
    response : (m,) 1 at frequency 0.
    """

    frequency: Floats
    response: Floats

    @property
    def at_nyquist(self) -> float:
        """Response at half a cycle per pixel (MTF at Nyquist)."""
        return float(np.interp(NYQUIST, self.frequency, self.response))

    @property
    def mtf50(self) -> float:
        """Lowest frequency at which the response is a half, cycles/px; NaN if it is so nowhere."""
        below = np.flatnonzero(self.response < 0.5)
        if not len(below):
            return float("nan")
        k = int(below[0])
        rise = (self.response[k - 1] - 0.5) / (self.response[k - 1] - self.response[k])
        return float(self.frequency[k - 1] + rise * (self.frequency[k] - self.frequency[k - 1]))


def frequency_response(pixels: NormalizedPixels) -> FrequencyResponse:
    """The response of the pixels around one edge or several."""
    spread = _line_spread(pixels)
    transformed = np.asarray(np.abs(np.fft.rfft(spread, _PADDED)), dtype=np.float64)
    frequency = np.asarray(np.fft.rfftfreq(_PADDED, BIN), dtype=np.float64)
    used = frequency <= _LAST
    frequency = frequency[used]
    filters = np.sinc(frequency * BIN) * np.sinc(2.0 * frequency * BIN)
    return FrequencyResponse(frequency, transformed[used] / transformed[0] / filters)


def _line_spread(pixels: NormalizedPixels) -> Floats:
    """Line spread function in bins of a quarter pixel, windowed, its peak in the middle."""
    bins = round(2.0 * REACH / BIN)
    place = np.floor((pixels.distance + REACH) / BIN).astype(np.int64)
    used = (place >= 0) & (place < bins)
    count = np.bincount(place[used], minlength=bins)
    total = np.bincount(place[used], pixels.part[used], minlength=bins)
    known = count > 0
    # A bin without a pixel is interpolated, as the standard has it.
    middles = np.arange(bins, dtype=np.float64)
    edge = np.interp(middles, middles[known], total[known] / count[known])
    spread = np.zeros(bins)
    spread[1:-1] = 0.5 * (edge[2:] - edge[:-2])
    return spread * flat_within_half(bins)


def flat_within_half(count: int) -> Floats:
    """Tukey's window (count,), a cosine in the outer half: scipy.signal's, which takes 1.3 s to import."""
    along = 4.0 * np.arange(count) / (count - 1)
    # Each end by itself, as there, so that the last bit is the same.
    outer = np.where(along < 2.0, np.minimum(along - 1.0, 0.0), np.maximum(along - 3.0, 0.0))
    return np.asarray(0.5 * (1.0 + np.cos(np.pi * outer)))
