"""Photon transfer: gain, read noise and full well of a sensor from pairs of flat images.

Two images of the same light differ by noise alone; half the variance of their difference is that of one
image, whatever the pixels' own sensitivities. For light that is counted, variance and mean are a straight
line,

    σ² = σ_read² + S / g,      S: mean above the dark level, g: electrons for one grey value

adjusted with weights from the variances of the variances, 2 σ⁴/n, until the weights stay. What was quantised
to whole grey values carries 1/12 more, which is subtracted but varies with the rest. The full well is the
signal at which the variance is largest: beyond it pixels clip, and the variance falls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats

_ROUNDS = 20
#: Part of the full well up to which the line is adjusted: near it, the first pixels clip.
_USED = 0.8
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class PhotonTransfer:
    """A photon transfer curve.

    Attributes
    ----------
    signal, variance : (m,) mean above the dark level and variance of a pixel, grey values.
    used : (m,) whether the level is used in the line.
    gain, sigma_gain : electrons for one grey value.
    read_noise, sigma_read_noise : electrons.
    full_well : electrons at the largest variance; None if the variance still rises at the last level.
    statistic : weighted mean square of the residuals of the line, 1 if the model holds.
    residual : largest residual of the line in parts of the variance.
    """

    signal: Floats
    variance: Floats
    used: Bools
    gain: float
    sigma_gain: float
    read_noise: float
    sigma_read_noise: float
    full_well: float | None
    statistic: float
    residual: float


def pair_statistics(first: Floats, second: Floats) -> tuple[float, float, int]:
    """Mean, variance of a pixel and number of pixels of two images (rows, columns) of the same light."""
    difference = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    mean = 0.5 * (float(np.mean(first, dtype=np.float64)) + float(np.mean(second, dtype=np.float64)))
    return mean, 0.5 * float(np.var(difference, ddof=1)), difference.size


def photon_transfer(
    mean: Floats, variance: Floats, pixels: Floats, dark: float, *, quantised: bool = True
) -> PhotonTransfer:
    """Adjust the line of a photon transfer curve.

    Parameters
    ----------
    mean, variance, pixels : (m,) of the levels, as of `pair_statistics`.
    dark : grey value without light.
    quantised : whether the images hold whole grey values, as those of the sensor.

    Raises
    ------
    ValueError
        If fewer than three levels lie below the full well.
    """
    order = np.argsort(mean)
    signal, pixels = mean[order] - dark, pixels[order]
    rounding = 1.0 / 12.0 if quantised else 0.0
    variance = variance[order] - rounding
    top = int(np.argmax(variance))
    clips = top < len(signal) - 1
    used = signal <= (_USED * signal[top] if clips else signal[top])
    if np.count_nonzero(used) < _FEWEST:
        raise ValueError("fewer than three levels below the full well")
    x, y, n = signal[used], variance[used], pixels[used]
    design = np.column_stack([np.ones_like(x), x])
    line = np.maximum(y, 1e-12)
    for _ in range(_ROUNDS):
        weight = n / (2.0 * (line + rounding) ** 2)
        normal = np.linalg.inv((design.T * weight) @ design)
        (offset, slope) = normal @ ((design.T * weight) @ y)
        adjusted = np.maximum(design @ np.array([offset, slope]), 1e-12)
        if np.allclose(adjusted, line, rtol=1e-12):
            break
        line = adjusted
    if not slope > 0.0:
        raise ValueError("the variance does not rise with the signal")
    gain = 1.0 / slope
    read = np.sqrt(max(offset, 0.0))
    # r = g √o: both move. An o below zero may be as large as its σ, and r as its root.
    of_offset = gain / (2.0 * read) if read > 0.0 else gain / normal[0, 0] ** 0.25
    by = np.array([of_offset, -read * gain**2])
    residual = y - design @ np.array([offset, slope])
    statistic = float(np.sum(weight * residual**2) / max(len(x) - 2, 1))
    return PhotonTransfer(
        signal, variance, np.asarray(used), float(gain), float(gain**2 * np.sqrt(normal[1, 1])),
        float(gain * read), float(np.sqrt(by @ normal @ by)),
        float(gain * signal[top]) if clips else None,
        statistic, float(np.max(np.abs(residual) / line)),
    )  # fmt: skip
